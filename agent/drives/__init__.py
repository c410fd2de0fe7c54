"""Drives: policies that turn the pose filter's belief into motor commands, one a file.

A new one is a new module and a line in `DRIVES`; see docs/extending.md.
"""

from __future__ import annotations

from agent.drives.registry import DRIVES, DriveKind, make_drive

__all__ = ["DRIVES", "DriveKind", "make_drive"]
