"""No points at all: for runs that are about something else."""

from __future__ import annotations

from simulator_stub.scoring.base import Scoring


class Unscored(Scoring):
    """Leaves every score at 0; only EndLed ends a robot's run."""

    mode = 0
