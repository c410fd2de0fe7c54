"""Ways of scoring, one module each. A new one is a new module and a line in `SCORINGS`."""

from __future__ import annotations

from simulator_stub.scoring.base import Scoring
from simulator_stub.scoring.competitive import Competitive
from simulator_stub.scoring.control import Control
from simulator_stub.scoring.linecontrol import LineControl
from simulator_stub.scoring.linecontrol45 import LineControl45
from simulator_stub.scoring.linemapping import LineMapping
from simulator_stub.scoring.lineplanning import LinePlanning
from simulator_stub.scoring.mapping import Mapping
from simulator_stub.scoring.own import find_scoring
from simulator_stub.scoring.planning import Planning

__all__ = ["SCORINGS", "Scoring", "find_scoring"]

SCORINGS: dict[int, type[Scoring]] = {
    scoring.mode: scoring
    for scoring in (
        Competitive,
        Control,
        Mapping,
        Planning,
        LineControl,
        LineMapping,
        LinePlanning,
        LineControl45,
    )
}
"""By the number on the command line."""
