"""Mode 0: visit all targets, signal the return inside one, drive back to the start. 0 is perfect."""

from __future__ import annotations

from simulator_stub.scoring.targets import TARGET_REWARD, TargetScoring


class Competitive(TargetScoring):
    """A robot begins with 100 points and 100 for each target, and loses them.

    The returning LED leads to Returning inside a target when all are visited, and anywhere else to Finished.
    """

    mode = 0
    judges_returning = True

    def start_value(self) -> int:
        """Return the points that a robot has before it does anything."""
        return TARGET_REWARD * (1 + len(self.world.lab.targets))
