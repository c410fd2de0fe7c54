"""Where to go: deciders that turn what the pose filter knows into motor commands, one policy a file."""

from __future__ import annotations

from agent.drives.active import ActiveDrive
from agent.drives.base import Decision, Drive
from agent.drives.explore import ExploreDrive
from agent.drives.goto import GotoDrive
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters

__all__ = ["ActiveDrive", "Decision", "Drive", "ExploreDrive", "GotoDrive", "make_drive"]


def make_drive(
    name: str,
    lab: Lab,
    parameters: Parameters,
    angles: tuple[float, float, float, float],
    *,
    goal: tuple[float, float] | None = None,
    cruise: float = 0.1,
    stop_when_localized: bool = True,
) -> Drive:
    """Make a drive by name.

    Parameters
    ----------
    name : {"explore", "active", "goto"}
    lab : Lab
    parameters : Parameters
        As announced.
    angles : tuple of four float
        Mounting angles of the IR sensors in degrees.
    goal : (float, float), optional
        Where ``goto`` goes, in units.
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
        If there is no such drive, or goto has no goal.
    """
    noise = parameters.obstacle_noise
    if name == "explore":
        return ExploreDrive(angles, noise, cruise=cruise)
    if name == "active":
        return ActiveDrive(angles, noise, cruise=cruise, stop=stop_when_localized)
    if name == "goto" and goal is not None:
        return GotoDrive(goal, angles, noise, cruise=cruise)
    raise ValueError(f"no drive {name!r}, or no goal for it")
