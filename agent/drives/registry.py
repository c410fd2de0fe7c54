"""The drives by name, without loading any: the command line knows them before the robot registers."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from ciberrato.errors import did_you_mean
from ciberrato.plugins import REFERENCE, failure, installed, load_part, refuse_taken

if TYPE_CHECKING:
    from agent.drives.base import Drive, DriveSetup
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
        Form of the argument, for help texts.
    check : callable or None
        Raises UsageError if the argument, as it was read, cannot be in a lab: asked before the robot
        registers.
    make : callable or None
        Makes the drive, of one that is no module: then `home` is only said.
    argument_may_be_left_out : bool
    """

    home: str
    summary: str = ""
    argument: Callable[[str], Any] | None = None
    form: str = ""
    check: Callable[[Any, Lab], None] | None = None
    make: Callable[[DriveSetup], Any] | None = None
    argument_may_be_left_out: bool = False


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


def check_goal(place: tuple[float, float], lab: Lab) -> None:
    """Refuse a goal in which no robot can stand; see `DriveKind.check`."""
    from ciberrato.localization.evidence.start_prior import check_place

    check_place(f"goto:{place[0]:g},{place[1]:g}", place, lab)


RIGHT = "right"
"""The published drive. The agent's controller does it by itself: it asks no pose filter."""

DRIVES = {
    RIGHT: DriveKind("agent.drives.right.controller", "default"),
    "explore": DriveKind("agent.drives.explore"),
    "active": DriveKind("agent.drives.active", "to where the pose shows, then stop"),
    "goto": DriveKind("agent.drives.goto", argument=read_place, form="X,Y", check=check_goal),
}
"""By name. A new one is a new module and a line here; those that others wrote are found by `drive_kind`."""

GROUP = "ciberrato.drives"


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
    UsageError
        If one that others wrote cannot be loaded.
    """
    name, colon, rest = text.partition(":")
    if name not in DRIVES and (name in installed(GROUP) or REFERENCE.match(text)):
        if name not in installed(GROUP):
            first, _, after = rest.partition(":")
            name, colon, rest = f"{name}:{first}", rest[len(first) : len(first) + 1], after
        kind: DriveKind | None = drive_kind(name)
        if kind is not None and kind.argument_may_be_left_out:
            return name, rest if colon else None
    else:
        refuse_taken(GROUP, [name])
        kind = DRIVES.get(name)
    try:
        if kind is not None and kind.argument is None and not colon:
            return name, None
        if kind is not None and kind.argument is not None:
            return name, kind.argument(rest)
    except ValueError:
        pass
    *others, last = [*forms(), *sorted(installed(GROUP))]
    meant = did_you_mean(name, DRIVES) if kind is None else ""
    raise ValueError(f"{text!r} is not {', '.join(others)} or {last}{meant}")


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
    """Create a drive by name.

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
        Motor command for driving straight on, in units per cycle.
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
    kind = DRIVES.get(name) if name in DRIVES or not _is_own(name) else drive_kind(name)
    lacks = kind is not None and kind.argument is not None and not kind.argument_may_be_left_out
    if kind is None or name == RIGHT or (lacks and goal is None):
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
    if name in DRIVES:
        drive: Drive = load_drive(name).make(setup)
        return drive
    from agent.drives.own import OwnDrive

    return OwnDrive(f"drive {name!r}", kind.make or load_drive(name).make, setup)


def load_drive(name: str) -> Any:
    """Return the module of a drive; loading it takes time that a running robot does not have."""
    kind = drive_kind(name)
    return kind if kind.make is not None else importlib.import_module(kind.home)


def drive_kind(name: str) -> DriveKind:
    """Return the description of a drive: one of `DRIVES`, or a user's own.

    Parameters
    ----------
    name : str
        In `DRIVES`, of an entry point (``ciberrato.drives``), or ``module:object``. Such an object is a
        `DriveKind`, or a function or class that makes a drive from a `DriveSetup`.

    Returns
    -------
    DriveKind

    Raises
    ------
    UsageError
        If it cannot be loaded; see `ciberrato.plugins.load_part`.
    """
    if name in DRIVES:
        return DRIVES[name]
    part = load_part(
        GROUP,
        name,
        fits=lambda value: isinstance(value, DriveKind) or callable(value),
        wanted="a DriveKind, or a function that makes a drive from a DriveSetup",
        built_in=DRIVES,
    )
    if not isinstance(part.value, DriveKind):
        return DriveKind(
            part.label, argument=str, form="TEXT", make=part.value, argument_may_be_left_out=True
        )
    if part.value.make is None:
        try:
            importlib.import_module(part.value.home)
        except Exception as error:
            raise failure(f"{part.label} cannot be loaded", error) from None
    return part.value


def _is_own(name: str) -> bool:
    return bool(REFERENCE.fullmatch(name)) or name in installed(GROUP)
