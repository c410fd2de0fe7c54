"""Tuples that stand for points, poses and cells."""

from __future__ import annotations

Point = tuple[float, float]
"""x, y in units, origin at the lower left corner of the lab."""
Pose = tuple[float, float, float]
"""x, y in units; heading in radians, counter-clockwise from +x."""
PoseInDegrees = tuple[float, float, float]
"""x, y in units; heading in degrees, as files and messages have it."""
Cell = tuple[int, int]
"""Row and column, from 0 at the bottom and at the left."""
SensorAngles = tuple[float, float, float, float]
"""Mounting angles of the IR sensors in degrees, counter-clockwise from straight ahead."""
