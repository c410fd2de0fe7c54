"""The drives by name, without loading any: the command line knows them before the robot registers."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from agent.drives.base import Drive
    from ciberrato.world.lab import Lab
    from ciberrato.world.parameters import Parameters


class DriveKind(NamedTuple):
    """A drive as the command line, the run and the evaluation see it.

    Attributes
    ----------
    home : str
        Dotted name of its module, which has ``make(setup: DriveSetup) -> Drive``.
    summary : str
        For the help text; may be empty.
    argument : callable or None
        Reads what follows ``NAME:`` on the command line, and raises ValueError if it cannot; None: the drive
        takes nothing.
    form : str
        What the argument looks like.
    """

    home: str
    summary: str = ""
    argument: Callable[[str], Any] | None = None
    form: str = ""


def read_place(text: str) -> tuple[float, float]:
    """Read a place as drives take it.

    Parameters
    ----------
    text : str
        ``X,Y``.

    Returns
    -------
    (float, float)
        Units.

    Raises
    ------
    ValueError
        If it is none.
    """
    x, y = (float(part) for part in text.split(","))
    if not (math.isfinite(x) and math.isfinite(y)):
        raise ValueError(text)
    return x, y


RIGHT = "right"
"""The published drive. The agent's controller does it by itself: it asks no pose filter."""

DRIVES = {
    RIGHT: DriveKind("agent.drives.right.controller", "default"),
    "explore": DriveKind("agent.drives.explore"),
    "active": DriveKind("agent.drives.active", "to where the pose shows, then stop"),
    "goto": DriveKind("agent.drives.goto", argument=read_place, form="X,Y"),
}
"""By name. A new one is a new module and a line here."""


def forms() -> list[str]:
    """Return what each drive looks like on the command line, with its argument."""
    return [name if kind.argument is None else f"{name}:{kind.form}" for name, kind in DRIVES.items()]


def parse_drive(text: str) -> tuple[str, Any]:
    """Read a drive as the command line names it.

    Parameters
    ----------
    text : str
        ``NAME`` or ``NAME:ARGUMENT``.

    Returns
    -------
    name : str
    argument : object or None

    Raises
    ------
    ValueError
        If there is no such drive, or it does not take this argument; the message lists those there are.
    """
    name, colon, rest = text.partition(":")
    kind = DRIVES.get(name)
    try:
        if kind is not None and kind.argument is None and not colon:
            return name, None
        if kind is not None and kind.argument is not None:
            return name, kind.argument(rest)
    except ValueError:
        pass
    *others, last = forms()
    raise ValueError(f"{text!r} is not {', '.join(others)} or {last}")


def make_drive(
    name: str,
    lab: Lab,
    parameters: Parameters,
    angles: tuple[float, float, float, float],
    *,
    goal: Any = None,
    cruise: float = 0.1,
    stop_when_localized: bool = True,
) -> Drive:
    """Make a drive by name.

    Parameters
    ----------
    name : str
        In `DRIVES`, and not the one to the right.
    lab : Lab
    parameters : Parameters
        As announced.
    angles : tuple of four float
        Mounting angles of the IR sensors in degrees.
    goal : object, optional
        The drive's argument: where ``goto`` goes, (x, y) in units.
    cruise : float
        Motor command for driving straight on, in units a cycle.
    stop_when_localized : bool
        Whether ``active`` stands still once the pose is known; otherwise it goes on as ``explore``.

    Returns
    -------
    Drive

    Raises
    ------
    ValueError
        If there is no such drive, or it lacks its argument.
    """
    kind = DRIVES.get(name)
    if kind is None or name == RIGHT or (kind.argument is not None and goal is None):
        raise ValueError(f"no drive {name!r}, or no argument for it")
    from agent.drives.base import DriveSetup

    setup = DriveSetup(
        lab=lab,
        parameters=parameters,
        angles=angles,
        argument=goal,
        cruise=cruise,
        stop_when_localized=stop_when_localized,
    )
    drive: Drive = load_drive(name).make(setup)
    return drive


def load_drive(name: str) -> Any:
    """Return the module of a drive; loading it takes time that a running robot does not have."""
    return importlib.import_module(DRIVES[name].home)
