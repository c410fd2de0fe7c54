"""Prior of the start: the values of ``--start``, and the belief that each begins with."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ciberrato.errors import UsageError
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.reprs import short_repr

if TYPE_CHECKING:  # numpy is imported where it is used: options are read before the robot is registered
    from ciberrato.localization.belief.pose_belief import PoseBelief
    from ciberrato.localization.evidence.symmetry import Turn
    from ciberrato.world.lab import Lab

FORMS = "anywhere, centres, centres:DEGREES, X,Y or X,Y,DEGREES"
_TOLERANCE = 1e-6
_APART = 1.0  # units


@dataclass(frozen=True, slots=True, kw_only=True)
class StartPrior:
    """Possible poses at the start.

    Attributes
    ----------
    centres : bool
        Whether only the centres of cells are. Otherwise it is every free place, unless there is a `place`.
    place : (float, float) or None
        Units; known to about one square of the lattice.
    heading_deg : float or None
        With a place it is known to about one bin. None: any heading, or at centres four of them.
    """

    __repr__ = short_repr

    centres: bool = False
    place: tuple[float, float] | None = None
    heading_deg: float | None = None

    @property
    def on_nodes(self) -> bool:
        """Return whether the poses are exactly those of states: cell centres, headings along the axes."""
        return self.centres and math.remainder(self.heading_deg or 0.0, 90.0) == 0.0

    def excludes(self, turn: Turn) -> bool:
        """Return whether what the lab looks like turned round does not matter, as the start is known.

        Parameters
        ----------
        turn : Turn
            Turn of the lab under which it looks the same.
        """
        if self.heading_deg is not None:
            return True
        if self.place is None:
            return False
        x, y, _ = turn.apply((*self.place, 0.0))
        return math.dist((x, y), self.place) > _APART


ANYWHERE = StartPrior()


def parse_start(text: str) -> StartPrior:
    """Parse what is known of the start.

    Parameters
    ----------
    text : str
        See `FORMS`.

    Returns
    -------
    StartPrior

    Raises
    ------
    UsageError
        If it is nothing of the kind.
    """
    if text == "anywhere":
        return ANYWHERE
    if text == "centres":
        return StartPrior(centres=True)
    kind, colon, rest = text.partition(":")
    if colon and kind == "centres":
        values = _numbers(rest)
        if values is not None and len(values) == 1:
            return StartPrior(centres=True, heading_deg=values[0])
    elif not colon:
        values = _numbers(text)
        if values is not None and len(values) in (2, 3):
            heading = values[2] if len(values) == 3 else None
            return StartPrior(place=(values[0], values[1]), heading_deg=heading)
    raise UsageError(f"{text!r} is not {FORMS}")


def _numbers(text: str) -> list[float] | None:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        return None
    return values if all(math.isfinite(value) and abs(value) < 1e6 for value in values) else None


def check_start(prior: StartPrior, lab: Lab) -> None:
    """Refuse a start that is not possible in a lab.

    Parameters
    ----------
    prior : StartPrior
    lab : Lab

    Raises
    ------
    UsageError
    """
    if prior.place is not None:
        check_place(f"start {prior.place[0]:g},{prior.place[1]:g}", prior.place, lab)


def check_place(name: str, place: tuple[float, float], lab: Lab) -> None:
    """Refuse a place in which no robot can stand.

    Parameters
    ----------
    name : str
        Name of the option or argument, for the message.
    place : (float, float)
        Units.
    lab : Lab

    Raises
    ------
    UsageError
        If it is outside the lab, or nearer to a wall than a robot's radius (less 0.1 units).
    """
    from ciberrato.geometry.walls import WallMap

    x, y = place
    if not (0.0 < x < lab.width and 0.0 < y < lab.height):
        raise UsageError(f"{name}: outside the lab, which is {lab.width:g} by {lab.height:g} units")
    if float(WallMap.from_lab(lab).distance(x, y)) < ROBOT_RADIUS - 0.1:
        raise UsageError(f"{name}: less than a robot's radius from a wall")


def begin_with(belief: PoseBelief, prior: StartPrior) -> None:
    """Set a belief to what is known of the start.

    Parameters
    ----------
    belief : PoseBelief
        Uniform.
    prior : StartPrior

    Raises
    ------
    UsageError
        If nothing is possible.
    """
    if prior.place is not None:
        _begin_at(belief, prior.place, prior.heading_deg)
    elif prior.centres:
        _begin_at_centres(belief, prior.heading_deg)


def _begin_at_centres(belief: PoseBelief, heading: float | None) -> None:
    import numpy as np

    lattice = belief.lattice
    at_centre = np.flatnonzero(
        (np.abs(lattice.x % 2.0 - 1.0) < _TOLERANCE)
        & (np.abs(lattice.y % 2.0 - 1.0) < _TOLERANCE)
        & (lattice.clearance >= ROBOT_RADIUS - _TOLERANCE)
    )
    if heading is None:
        bins, offset = np.arange(4) * (belief.bins // 4), 0.0
    else:
        nearest, offset = _nearest_bin(belief, heading)
        bins = np.array([nearest])
    belief.set_states(np.repeat(bins, len(at_centre)), np.tile(at_centre, len(bins)))
    belief.heading_offset = offset


def _begin_at(belief: PoseBelief, place: tuple[float, float], heading: float | None) -> None:
    import numpy as np

    lattice = belief.lattice
    off = np.hypot(lattice.x - place[0], lattice.y - place[1]) / lattice.resolution
    squares = np.flatnonzero(off < 3.0)
    if not len(squares):
        raise UsageError(f"start {place[0]:g},{place[1]:g}: no free pose is near")
    by_square = np.exp(-0.5 * off[squares] ** 2)
    if heading is None:
        bins, by_bin, offset = np.arange(belief.bins), np.ones(belief.bins), 0.0
    else:
        nearest, offset = _nearest_bin(belief, heading)
        steps = np.arange(-3, 4)
        bins, by_bin = (nearest + steps) % belief.bins, np.exp(-0.5 * steps**2)
    belief.set_weighted(
        np.repeat(bins, len(squares)),
        np.tile(squares, len(bins)),
        np.outer(by_bin, by_square).ravel(),
        heading_offset=offset,
    )


def _nearest_bin(belief: PoseBelief, heading: float) -> tuple[int, float]:
    """Return the bin nearest to a heading in degrees, and by how many radians the heading is ahead of it."""
    angle = math.radians(heading)
    nearest = round(angle / belief.bin_width)
    return nearest % belief.bins, angle - nearest * belief.bin_width
