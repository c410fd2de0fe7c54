"""Errors between a robot's program and its simulator."""

from __future__ import annotations

from ciberrato.errors import CiberratoError


class SilenceError(CiberratoError):
    """The simulator does not answer, or has stopped to send Measures."""


class RefusedError(CiberratoError):
    """The simulator has refused the robot."""


def no_answer(place: str, seconds: float, transport: str) -> SilenceError:
    """Return the error for a registration without an answer."""
    tcp = "; the real simulator speaks UDP only" if transport == "tcp" else ""
    return SilenceError(
        f"no simulator has answered at {place} in {seconds:g} s: start one (ciberrato-simulator), or check "
        f"host and port{tcp}"
    )


def refused(place: str, name: str, position: int) -> RefusedError:
    """Return the error for a Refused reply."""
    asked = f"position {position}" if position else "any free position"
    return RefusedError(
        f"the simulator at {place} refuses {name!r} at {asked}: the position is taken or not in its start "
        "grid, no position is free, or the simulation is already running; choose another position, or start "
        "the simulator anew (it keeps the robots of programs that were ended)"
    )


def fell_silent(place: str, seconds: float, time: int | None) -> SilenceError:
    """Return the error for a simulator that was heard and is not any more."""
    when = "before the first Measures" if time is None else f"after time {time}"
    return SilenceError(
        f"no Measures from {place} for {seconds:g} s, {when}: the simulator was ended or reset, the robot "
        "was removed, or the network is down"
    )
