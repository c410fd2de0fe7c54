"""Ways of scoring, one module each. A new one is a new module and a line in `SCORINGS`."""

from __future__ import annotations

from simulator_stub.scoring.base import Scoring
from simulator_stub.scoring.unscored import Unscored

__all__ = ["SCORINGS", "Scoring"]

SCORINGS: dict[int, type[Scoring]] = {scoring.mode: scoring for scoring in (Unscored,)}
"""By the number on the command line."""
