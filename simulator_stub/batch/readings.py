"""Readings of the robots of a batch."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ciberrato.arrays import Booleans, Floats, Integers
from simulator_stub.batch.plan import SENSORS, BatchPlan
from simulator_stub.sensors.line import SIDEWAYS


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchReadings:
    """The readings of one cycle, world by world.

    Attributes
    ----------
    time : array of int, shape (worlds,)
        Simulated cycles so far in each world.
    over : array of bool, shape (worlds,)
        Mask of worlds that have reached SimTime: the robot stands still from then on, and its sensors go on.
    infrared : array, shape (worlds, 4)
        Readings of the IR sensors, about 1/distance.
    compass : array, shape (worlds,)
        Degrees.
    ground : array of int, shape (worlds,)
        Number of the target that the robot is in, -1 for none.
    collision : array of bool, shape (worlds,)
    line : array of bool, shape (worlds, 7), or None
        Elements of the line sensor, leftmost first; None if the batch has none.
    gps : array, shape (worlds, 2), or None
        x and y with an offset, in units; None if the parameters give no GPS.
    beacons : array, shape (worlds, beacons), or None
        Bearings in degrees, nan where a beacon is hidden, and behind those that the world's lab has; None if
        the parameters give no sensors for them.
    score : array of int, shape (worlds,), or None
        After this cycle has been counted; None if the batch counts none.
    """

    time: Integers
    over: Booleans
    infrared: Floats
    compass: Floats
    ground: Integers
    collision: Booleans
    line: Booleans | None = None
    gps: Floats | None = None
    beacons: Floats | None = None
    score: Integers | None = None

    @classmethod
    def empty(cls, plan: BatchPlan, *, scored: bool) -> BatchReadings:
        """Create arrays for all worlds."""
        worlds, shared = plan.worlds, plan.shared
        return cls(
            time=np.zeros(worlds, np.int64),
            over=np.zeros(worlds, np.bool_),
            infrared=np.zeros((worlds, SENSORS)),
            compass=np.zeros(worlds),
            ground=np.zeros(worlds, np.int64),
            collision=np.zeros(worlds, np.bool_),
            line=np.zeros((worlds, len(SIDEWAYS)), np.bool_) if plan.line_sensor else None,
            gps=np.zeros((worlds, 2)) if shared.gps else None,
            beacons=np.zeros((worlds, plan.beacons)) if shared.beacon_sensor else None,
            score=np.zeros(worlds, np.int64) if scored else None,
        )

    def with_worlds(self, which: Integers, fresh: BatchReadings) -> BatchReadings:
        """Return readings in which some worlds' are replaced by others."""
        changed: dict[str, Any] = {}
        for name in self.__slots__:
            array = getattr(self, name)
            if array is not None:
                changed[name] = array.copy()
                changed[name][which] = getattr(fresh, name)[which]
        return replace(self, **changed)
