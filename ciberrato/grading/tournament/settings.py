"""The table ``[tournament]`` of a course: how many meet, how often, and what their places are worth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ciberrato.reprs import short_repr

if TYPE_CHECKING:
    from ciberrato.grading.fields import Fields

MOST_ROUNDS = 1000


@dataclass(frozen=True, slots=True)
class TournamentSettings:
    """Settings of a tournament; every entry has a default.

    Attributes
    ----------
    robots : int or None
        Greatest number in a run; None = as many as the lab's start grid has places.
    rounds : int or None
        None = until every two agents have met.
    draw : int
        Seed of the draw.
    rotate : bool
        Whether every meeting is run once from each start place for each agent; else there is one run, from
        places that are drawn so that all agents have them about equally often.
    points : tuple of float or None
        Points of the first place, the second, ...; None = the share of opponents that are beaten, in percent.
    """

    __repr__ = short_repr

    robots: int | None = None
    rounds: int | None = None
    draw: int = 1
    rotate: bool = True
    points: tuple[float, ...] | None = None


DEFAULT = TournamentSettings()


def read_settings(table: Fields) -> TournamentSettings:
    """Read the table; faults are noted in it."""
    robots = table.number("robots", None, least=2, most=255, whole=True)
    rounds = table.number("rounds", None, least=1, most=MOST_ROUNDS, whole=True)
    draw = table.number("draw", 1, least=0, whole=True)
    rotate = table.choice("places", ("rotate", "draw"), "rotate") == "rotate"
    points = table.numbers("points")
    table.end()
    if points is not None and list(points) != sorted(points, reverse=True):
        table.fault(f"points: {list(points)}: a place must not be worth less than one behind it")
    return TournamentSettings(
        None if robots is None else int(robots),
        None if rounds is None else int(rounds),
        int(draw or 0),
        rotate,
        points,
    )
