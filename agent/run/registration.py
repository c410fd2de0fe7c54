"""Gets the robot into the simulation: asks again and again until a simulator answers."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, NamedTuple

from agent.run.reporter import Reporter
from agent.run.signals import Interrupts
from ciberrato.errors import ProtocolError, UsageError
from ciberrato.net.link import Arrival, Link, LinkError
from ciberrato.protocol.registrations import RobotRegistration, encode_registration

if TYPE_CHECKING:
    from collections.abc import Callable

    from ciberrato.protocol import Acceptance

FIRST_WAIT = 1.0
"""Seconds until the second attempt. The simulator answers within a cycle; asking again before it could
means being refused, or taking a second place."""

LONGEST_WAIT = 5.0
REFUSAL_PATIENCE = 0.5
"""Seconds that an acceptance may still come after a refusal, which over UDP can be anybody's."""
_REMINDER = 30.0
_REFUSED = (
    "the connection is refused, no simulator listens on TCP there (the real simulator speaks UDP only: "
    "without --transport tcp)"
)
_PATIENCE = 2  # refused connections in a row; a simulator that is just starting refuses one


class Answer(NamedTuple):
    """The simulator has accepted the robot.

    Attributes
    ----------
    acceptance : Acceptance
    following : tuple of Arrival
        Messages that came right behind it.
    sent, arrived : float
        Times at which the last attempt left, and the acceptance came: seconds by the clock that stamps
        arrivals.
    """

    acceptance: Acceptance
    following: tuple[Arrival, ...]
    sent: float
    arrived: float


def register(
    link: Link,
    registration: RobotRegistration,
    place: str,
    interrupts: Interrupts,
    reporter: Reporter,
    *,
    give_up_after: float | None = None,
    when_sent: Callable[[], None] | None = None,
    patient: bool = False,
) -> Answer | None:
    """Register a robot.

    Parameters
    ----------
    link : Link
    registration : RobotRegistration
    place : str
        The simulator's address, for messages.
    interrupts : Interrupts
    reporter : Reporter
    give_up_after : float or None
        Seconds.
    when_sent : callable or None
        Called once, after the first attempt: what can be prepared while the simulator thinks.
    patient : bool
        Whether to try again after a refusal.

    Returns
    -------
    Answer or None
        None if a signal came first.

    Raises
    ------
    UsageError
        If the robot is refused, or no simulator answers in time.
    """
    data = encode_registration(registration)
    began = time.monotonic()
    end = math.inf if give_up_after is None else began + give_up_after
    wait, next_try, reminder = FIRST_WAIT, began, began + FIRST_WAIT
    refusals = 0
    refused, sent = math.inf, time.time()  # when a Refusal has come, and the last attempt has left
    while not interrupts.received:
        now = time.monotonic()
        if now >= end:
            why = f": {_REFUSED}" if refusals else ""
            raise UsageError(f"no simulator has answered at {place} in {give_up_after:g} s{why}")
        if now >= refused + REFUSAL_PATIENCE:
            if not patient:
                raise _refused(registration, place)
            reporter.warn_once(f"{place} refuses {registration.name!r}; trying again")
            refused, next_try = math.inf, now + LONGEST_WAIT
        if now >= next_try and refused == math.inf:
            sent = time.time()
            _attempt(link, data, reporter)
            refusals = refusals + 1 if link.refused else 0
            if refusals == _PATIENCE:
                reporter.warn_once(f"{place}: {_REFUSED}; trying again")
            if when_sent is not None:
                when_sent()
                when_sent = None
            next_try = time.monotonic() + wait
            wait = min(1.5 * wait, LONGEST_WAIT)
        try:
            arrivals = link.receive_arrivals()
            watched: int | None = link.fileno()
        except LinkError:  # no simulator is there, or no longer: wait for the next attempt
            arrivals, watched = [], None
        answer, is_refused = _find_answer(arrivals, sent, place, reporter)
        if answer is not None:
            return answer
        now = time.monotonic()
        if is_refused:
            # Any program that knows the port can say so; the simulator itself accepts within a cycle.
            refused = min(refused, now)
        if now >= reminder:
            reporter.say(f"waiting for a simulator at {place} (Ctrl-C ends this)")
            reminder = now + _REMINDER
        due = next_try if refused == math.inf else refused + REFUSAL_PATIENCE
        interrupts.wait(watched, min(due, reminder, end) - now)
    return None


def _attempt(link: Link, data: bytes, reporter: Reporter) -> None:
    try:
        link.register(data)
    except LinkError as error:
        reporter.warn_once(f"{error}; trying again")


def _find_answer(
    arrivals: list[Arrival], sent: float, place: str, reporter: Reporter
) -> tuple[Answer | None, bool]:
    """Return the answer among what has arrived, and whether there is a refusal."""
    if not arrivals:
        return None, False
    from ciberrato.protocol import Acceptance, Refusal, decode_simulator_message

    is_refused = False
    for index, arrival in enumerate(arrivals):
        try:
            message = decode_simulator_message(arrival.data)
        except ProtocolError as error:
            reporter.warn_once(f"{place} answers, but not like a CiberRato simulator: {error}")
            continue
        if isinstance(message, Acceptance):
            return Answer(message, tuple(arrivals[index + 1 :]), sent, arrival.time or time.time()), False
        is_refused |= isinstance(message, Refusal)
    return None, is_refused


def _refused(registration: RobotRegistration, place: str) -> UsageError:
    asked = f"position {registration.robot_id}" if registration.robot_id else "any free position"
    return UsageError(
        f"the simulator at {place} refuses {registration.name!r} at {asked}: the position is taken or not in "
        "its start grid, no position is free, or the simulation is already running; choose another position "
        "(-p), or start the simulator anew (it keeps the robots of programs that were ended)"
    )
