"""Phases of the drive to the right, and the events that end them.

The simulator's Stop button does not change the phase: while it is pressed the motors get 0, and afterwards
the agent goes on where it was.
"""

from __future__ import annotations

from enum import StrEnum


class Phase(StrEnum):
    """Activities of the agent."""

    WAITING = "waiting"
    """Registered; the simulation has not been started yet."""
    ALIGNING = "aligning"
    """Turning to the right, and standing still for the reading of the start cell."""
    DRIVING = "driving"
    """On its way to the right."""
    HOLDING = "holding"
    """Standing in the last cell, motors 0."""


class Event(StrEnum):
    """Events that end a phase."""

    STARTED = "started"
    """Start is on for the first time."""
    START_CELL_READ = "start cell read"
    """The robot looks to the right and the start cell's reading is recorded."""
    WALL_AHEAD = "wall ahead"
    """The robot stands in a cell's centre before a wall."""
    STUCK = "stuck"
    """The robot has collided for many cycles in a row."""


TRANSITIONS: dict[tuple[Phase, Event], Phase] = {
    (Phase.WAITING, Event.STARTED): Phase.ALIGNING,
    (Phase.ALIGNING, Event.START_CELL_READ): Phase.DRIVING,
    (Phase.DRIVING, Event.WALL_AHEAD): Phase.HOLDING,
    (Phase.DRIVING, Event.STUCK): Phase.HOLDING,
}
"""The phase that follows; an event that is not listed for a phase changes nothing."""
