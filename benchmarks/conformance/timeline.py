"""Times at which the real simulator read its messages: recorded sessions cut into cycles.

The recorder's clock is good for what it sent. What it received carries the time at which it got round to
reading, so whole stretches may collapse into one moment. But a robot gets one Measures a cycle, so counting
tells the cycle of each; and no Measures is read before it was sent, so the earliest readings tell when cycles
took place.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
import shlex
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

from ciberrato.errors import ProtocolError
from ciberrato.protocol import decode_registration
from simulator_stub.options import parse_arguments

_ARGUMENTS = re.compile(r"simulator arguments[^:]*: (.*)")

WINDOW = 60
"""Cycles before a reading for which it tells when they took place; the real timer drifts."""

PROMPT = 0.015
"""Seconds: a message that was read no later than this after its cycle tells the cycle's time by itself."""

AT_ONCE = 0.010
"""Seconds: what a client sends this soon after a Reply is still read in the Reply's cycle (not Actions)."""

UNCERTAIN = 0.010
"""Seconds: what was sent this close to a cycle may have been read on its other side."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """One recorded datagram.

    Attributes
    ----------
    number : int
        Its line in the file, from 1.
    seconds : float
    sent : bool
        Whether a client sent it, and not the simulator.
    client_port, simulator_port : int
    data : bytes
    """

    number: int
    seconds: float
    sent: bool
    client_port: int
    simulator_port: int
    data: bytes

    @property
    def kind(self) -> str:
        """Name of the root element, where there is one at the very beginning."""
        match = re.match(rb"<(\w+)", self.data)
        return match[1].decode() if match else ""


@dataclass(slots=True, kw_only=True)
class Timeline:
    """A recorded session in cycles.

    Attributes
    ----------
    name : str
    arguments : list of str
        Of the real simulator's command line.
    main_port : int
    inputs : dict of int to list of Event
        Messages that the simulator read in each cycle, in order.
    answers : dict of int to list of Event
        Messages that it sent from each port, in order.
    cycle_of : dict of int to int
        The cycle of an answer that counting or the clock tells, by its line number.
    last_cycle : int
    opened_by : dict of int to int
        For each port that the simulator opened, the line of the registration that asked for it.
    died : bool
        Whether the simulator came to an end by itself.
    uncertain : dict of int to int
        By line, the other cycle in which it may have been read, reckoned from the likely one: where it was
        sent close to the end of a cycle, and where a command was sent at once after a Reply.
    """

    name: str
    arguments: list[str]
    main_port: int
    inputs: dict[int, list[Event]] = field(default_factory=lambda: defaultdict(list))
    answers: dict[int, list[Event]] = field(default_factory=lambda: defaultdict(list))
    cycle_of: dict[int, int] = field(default_factory=dict)
    last_cycle: int = 0
    opened_by: dict[int, int] = field(default_factory=dict)
    died: bool = False
    uncertain: dict[int, int] = field(default_factory=dict)


def read_timeline(path: Path, files: Path, moved: Collection[int] = ()) -> Timeline:
    """Read a session and return the cycle of everything that clients sent.

    Parameters
    ----------
    path : Path
        A file of `transcripts`.
    files : Path
        The folder of the files that it names.
    moved : collection of int
        Lines of which the other cycle is to be taken (see `Timeline.uncertain`).

    Returns
    -------
    Timeline
    """
    events: list[Event] = []
    notes: list[str] = []
    with gzip.open(path, "rt", encoding="utf-8") as lines:
        for number, line in enumerate(lines, 1):
            record = json.loads(line)
            if record["direction"] == "note":
                notes.append(record["text"])
                continue
            sent = record["direction"] == "client->sim"
            ports = (record["from_port"], record["to_port"])
            events.append(
                Event(
                    number=number,
                    seconds=record["t"],
                    sent=sent,
                    client_port=ports[0] if sent else ports[1],
                    simulator_port=ports[1] if sent else ports[0],
                    data=base64.b64decode(record["payload_b64"]),
                )
            )
    arguments = next((shlex.split(found[1]) for note in notes if (found := _ARGUMENTS.search(note))), [])
    timeline = Timeline(
        name=path.name.removesuffix(".jsonl.gz"),
        arguments=arguments,
        main_port=next(event.simulator_port for event in events if event.sent),
        died=any("still alive at end: False" in note for note in notes),
    )
    for event in events:
        if not event.sent:
            timeline.answers[event.simulator_port].append(event)
    clock = _clock(timeline, events, _period(arguments, files))
    _assign(timeline, events, clock, moved)
    return timeline


def _period(arguments: list[str], files: Path) -> float:
    from ciberrato.files.parameters import read_parameters
    from ciberrato.world.parameters import Parameters

    named = parse_arguments(arguments).param
    parameters = Parameters() if named is None else read_parameters(files / named)
    return parameters.cycle_time / 1000.0


class _Clock:
    """Times of all cycles, from those that are known."""

    def __init__(self, period: float) -> None:
        self.period = period
        self.readings: dict[int, float] = {}

    def add(self, cycle: int, seconds: float) -> None:
        self.readings[cycle] = min(seconds, self.readings.get(cycle, seconds))

    def bound(self, cycle: int) -> float:
        """Return the latest time of a cycle that later ones allow: the real timer is never early."""
        known = sorted(self.readings)
        low = bisect_left(known, cycle)
        later = known[low : bisect_left(known, cycle + WINDOW + 1)]
        near = later or known[max(low - 1, 0) : low] or known[:1]
        return min(self.readings[other] + (cycle - other) * self.period for other in near)

    def time(self, cycle: int) -> float:
        """Return the time of a cycle."""
        bound = self.bound(cycle)
        own = self.readings.get(cycle, bound)
        return own if own - bound < PROMPT else bound

    def nearest(self, seconds: float) -> int:
        """Find the cycle that took place about then."""
        guess = min(self.readings.items(), key=lambda item: abs(item[1] - seconds))
        around = max(guess[0] + round((seconds - guess[1]) / self.period), 0)
        return min(range(max(around - 3, 0), around + 4), key=lambda cycle: abs(self.time(cycle) - seconds))

    def first_after(self, seconds: float) -> int:
        """Find the first cycle after that time."""
        cycle = max(self.nearest(seconds) - 2, 0)
        while self.time(cycle) <= seconds:
            cycle += 1
        return cycle


def _clock(timeline: Timeline, events: list[Event], period: float) -> _Clock:
    """Number the cycles: from each Reply on, a robot's Measures count them."""
    clock = _Clock(period)
    replies = [event for event in events if not event.sent and event.kind == "Reply"]
    clock.add(0, replies[0].seconds)
    for reply in replies:
        cycle = clock.nearest(reply.seconds)
        clock.add(cycle, reply.seconds)
        timeline.cycle_of[reply.number] = cycle
        measures = [event for event in timeline.answers[reply.simulator_port] if event.kind == "Measures"]
        for count, event in enumerate(measures):
            clock.add(cycle + count, event.seconds)
            timeline.cycle_of[event.number] = cycle + count
    last = next(event for event in reversed(events) if not event.sent)
    timeline.last_cycle = max(clock.nearest(last.seconds), *timeline.cycle_of.values())
    return clock


def _assign(timeline: Timeline, events: list[Event], clock: _Clock, moved: Collection[int]) -> None:
    """Assign what clients sent to cycles."""
    robots = {answer.simulator_port for answer in events if answer.kind == "Measures"}
    at_least = 0
    reply: Event | None = None
    for event in events:
        if not event.sent:
            if event.number in timeline.cycle_of:
                at_least = max(at_least, timeline.cycle_of[event.number] + 1)
            if event.kind == "Reply":
                reply = event
            continue
        cycle = max(clock.first_after(event.seconds), at_least)
        if clock.time(cycle) - event.seconds < UNCERTAIN:
            timeline.uncertain[event.number] = 1
        elif cycle > at_least and event.seconds - clock.time(cycle - 1) < UNCERTAIN:
            timeline.uncertain[event.number] = -1
        if event.simulator_port == timeline.main_port:
            answer = _answer(timeline, events, event)
            if answer is not None:
                timeline.uncertain.pop(event.number, None)
                cycle = timeline.cycle_of[answer.number]
                timeline.opened_by[answer.simulator_port] = event.number
        elif (
            reply is not None
            and event.seconds - reply.seconds < AT_ONCE
            and event.simulator_port not in robots
        ):
            # Commands are read after registrations: the Reply was sent, and the cycle still going on.
            timeline.uncertain[event.number] = 1
            cycle = timeline.cycle_of[reply.number]
        if event.number in moved:
            cycle += timeline.uncertain[event.number]
        timeline.inputs[cycle].append(event)
        timeline.last_cycle = max(timeline.last_cycle, cycle)


def _answer(timeline: Timeline, events: list[Event], registration: Event) -> Event | None:
    """Find the Reply to a registration: the next one to its sender that answers nothing before it."""
    try:
        decode_registration(registration.data)
    except ProtocolError:
        return None
    for event in events:
        if (
            event.number > registration.number
            and event.kind == "Reply"
            and event.client_port == registration.client_port
            and event.simulator_port not in timeline.opened_by
        ):
            return event
    return None
