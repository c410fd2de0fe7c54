"""The rows of the check: what is done to an agent, and what is expected of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ciberrato.reprs import short_repr

Ending = Literal["any", "itself", "clean"]
"""Required state of the agent at a row's end: any; ended by itself; ended, and without an error."""

CYCLES = 30
"""Cycles that go well before something happens, and after it."""

LONG = 100
"""Cycles of a longer run."""

STOPPED = 20
"""Cycles of a pause."""

QUIET = 0.5
"""Seconds without Measures in which an agent has nothing to answer."""

MOST_UNASKED = 4
"""Messages that may come all the same: what an agent sends a cycle, brakes and LEDs included."""

END = 5.0
"""Seconds that an agent may take to end by itself. The courses' clients give up after 2."""


@dataclass(frozen=True, slots=True)
class Row:
    """A row.

    Attributes
    ----------
    name : str
    done, expected : str
        For people.
    hint : str
        Likely cause in the agent when it fails.
    """

    __repr__ = short_repr

    name: str
    done: str
    expected: str
    hint: str


ROWS = (
    Row(
        "register",
        "the agent is started, and the simulator waits for it",
        'one registration as <Robot Id="1" Name="ana"/>, to the host and port that it was told',
        "is {host} (and {port}, if it takes one) in the command line? Does it send the registration once, "
        "over UDP, as one message of at most 1023 bytes?",
    ),
    Row(
        "refused",
        'the simulator answers the registration with <Reply Status="Refused">',
        f"the program ends by itself within {END:g} s",
        "look at Status in the Reply, say so and end; do not wait for Measures that never come",
    ),
    Row(
        "answers",
        f"{LONG} cycles are run, each as soon as the last was answered",
        "every Measures is answered with a message that the simulator understands",
        "answer every Measures with an <Actions>, also when nothing changes; at most 1023 bytes, "
        "numbers with a point and without nan",
    ),
    Row(
        "unasked",
        f"after {CYCLES} cycles no Measures come for {QUIET:g} s; then {CYCLES} more cycles",
        f"it waits: at most {MOST_UNASKED} messages meanwhile; then it answers as before",
        "send when Measures have come, not by a clock or in a loop of its own, and wait 2 s before giving up",
    ),
    Row(
        "stop-start",
        f"{STOPPED} cycles before Start, {CYCLES} running, Stop for {STOPPED}, Start, {2 * CYCLES} running",
        "it answers every running cycle, and drives again after the pause if it drove before",
        'look at Start and Stop in <Buttons>: wait while Stop="On" (time stands still), and go on after it; '
        "if it had come to where it wants to stand, choose a longer way by --lab",
    ),
    Row(
        "lost",
        f"after {CYCLES} cycles every third Measures is lost, then ten in a row; then {CYCLES} cycles",
        "it answers whatever arrives; only the first after the ten it may leave to the next",
        "do not take for granted that Time grows by 1: use the difference to the last one",
    ),
    Row(
        "doubled",
        f"after {CYCLES} cycles every Measures arrives twice, for {STOPPED} cycles; then {CYCLES} cycles",
        "it goes on, and answers at least one of the two",
        "two Measures may have the same Time: do not divide by the difference, ignore the second",
    ),
    Row(
        "late",
        f"after {CYCLES} cycles a Measures overtakes the one before it, five times; then {CYCLES} cycles",
        "it goes on, and answers at least the newer one",
        "Time may step back by one: ignore Measures that are older than those already seen",
    ),
    Row(
        "restart",
        f"after {LONG} cycles the run begins again: Time 0, the robot at its start",
        "it drives on, or ends by itself without an error",
        "Time far behind the last one is a new run: begin again or end, but do not wait for the old Time",
    ),
    Row(
        "silence",
        f"after {CYCLES} cycles the simulator is gone, without a word",
        f"the program ends by itself within {END:g} s",
        "wait for Measures with a time-out (2 s are usual), and end when it has passed",
    ),
    Row(
        "end",
        f"the time is up after {LONG} cycles: both buttons off; then the simulator is gone",
        f"the program ends by itself within {END:g} s, without an error",
        "end when Time has reached SimTime of the Reply, or after 2 s without Measures, with exit status 0",
    ),
)

NAMES = tuple(row.name for row in ROWS)
