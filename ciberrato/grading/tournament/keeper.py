"""One run of a tournament, in a process of its own: the simulator, and a supervisor for each agent.

Agents are started one after the other, in order of their places, each when the one before has registered or
will not: so it is known whose robot registers. Then this process, the only view that the simulator takes,
presses Start. An agent that does not register, crashes or hangs is looked after by its own supervisor; the
run goes on with the others.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any

from ciberrato.errors import CiberratoError
from ciberrato.grading.supervisor import (
    GRACE,
    LOOK,
    SUPERVISOR,
    Stream,
    end_simulator,
    last_run,
    look_after,
    start_simulator,
)
from ciberrato.net import UdpLink
from ciberrato.processes import module_command
from ciberrato.protocol import Start, ViewRegistration, decode_simulator_message, encode
from ciberrato.system import descendants
from ciberrato.system.streams import streams

KEEPER = "ciberrato.grading.tournament.keeper"
_SAID = rb"^ciberrato-simulator: "
_REGISTERED = re.compile(
    _SAID + rb"robot (\d+), .*, registered from (?:udp|tcp) [\d.]+:(\d+)(?:, binary)?$", re.MULTILINE
)
_REFUSED = re.compile(_SAID + rb"refused a robot at position (-?\d+), from ", re.MULTILINE)

SECOND = "a second robot was registered"


class Seat:
    """An agent of the run: its supervisor, and what that says.

    Attributes
    ----------
    number : int
        Of its start place, from 1.
    robot : int or None
        The robot that it has registered.
    over : bool
        Whether its supervisor has said all.
    """

    def __init__(self, number: int, wanted: Mapping[str, Any]) -> None:
        self.number = number
        self.robot: int | None = None
        self.over = False
        self.answer = b""
        self.note: str | None = None
        self._wanted = wanted
        self.process = subprocess.Popen(
            module_command(SUPERVISOR),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )

    def begin(self) -> None:
        """Start the agent."""
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):
            self.process.stdin.write(json.dumps(self._wanted).encode() + b"\n")
            self.process.stdin.flush()

    def end(self) -> None:
        """Let the supervisor end the agent, and all that it has started."""
        assert self.process.stdin is not None
        with contextlib.suppress(OSError):
            self.process.stdin.close()

    def take(self, data: bytes) -> None:
        """Take what the supervisor says; nothing more: it has ended."""
        self.answer += data
        self.over = self.over or not data

    def document(self) -> dict[str, Any]:
        """Return what came of the agent, as its supervisor says."""
        try:
            document = dict(json.loads(self.answer))
        except ValueError:
            return {"error": "the process that looks after an agent failed"}
        document["stopped"] = document["stopped"] or self.note
        if self.note:
            document["exit"] = document["signal"] = None
        return document | {"registered": self.robot is not None, "robot": self.robot}


class Match:
    """A run.

    Parameters
    ----------
    wanted : mapping
        ``simulator`` (command line), ``host``, ``port``, ``agents`` (for each, or None for a place that stays
        empty, what its supervisor wants), ``names`` of all, ``limits``, ``result``.
    """

    def __init__(self, wanted: Mapping[str, Any]) -> None:
        self._wanted = wanted
        self._limits: Mapping[str, float] = wanted["limits"]
        self._streams = streams()
        self._output = Stream(1 << 18)
        self._orphaned = False
        self._simulator: subprocess.Popen[bytes] | None = None
        self._seats: list[Seat] = []
        self._seen = 0

    def run(self) -> dict[str, Any]:
        """Do it.

        Returns
        -------
        dict
            ``error`` and ``busy`` as of a single run; ``again``, the place of an agent that took what was not
            its own, so the run is to be done without it, and ``why``; or ``run``, the simulator's result, and
            ``agents``, a document for each, None for empty places.
        """
        try:
            return self._run()
        finally:
            self._end()

    def _run(self) -> dict[str, Any]:
        self._watch(sys.stdin.buffer, self._parent)
        self._simulator = start_simulator(self._wanted["simulator"])
        self._watch(self._simulator.stdout, self._output.add)
        self._seats = [
            Seat(number, agent) for number, agent in enumerate(self._wanted["agents"], 1) if agent is not None
        ]
        for seat in self._seats:
            self._watch(seat.process.stdout, seat.take)
        if not self._until(lambda: b"listening on udp" in self._output.tail, 60.0):
            text = self._output.text().strip().rpartition("\n")[2]
            return {"error": text or "the simulator does not start", "busy": "cannot listen" in text}
        with UdpLink(self._wanted["host"], self._wanted["port"]) as view:
            view.register(encode(ViewRegistration()))
            if view.receive(30.0) is None:
                return {"error": "the simulator does not answer", "busy": False}
            for seat in self._seats:
                wrong = self._seat(seat)
                if wrong is not None:
                    return {"error": None, "again": wrong[0].number, "why": wrong[1]}
            if any(seat.robot is not None for seat in self._seats):
                double = self._press_start(view)
                if double is not None:
                    return {"error": None, "again": double.number, "why": SECOND}
                # Each supervisor stops its agent in time, and a run whose robots are silent ends by itself.
                self._until(lambda: False, self._limits["time"] + 60.0 + 2.0 * self._limits["silence"])
        until = time.monotonic() + GRACE
        while not self._all_over() and time.monotonic() < until and not self._orphaned:
            self._look(LOOK)
        return self._document()

    # --- who is there ---------------------------------------------------------------------------

    def _seat(self, seat: Seat) -> tuple[Seat, str] | None:
        """Start an agent and see its robot registered; returns who took what was not its own, and how."""
        seat.begin()
        limit = self._limits["registration"]
        until = time.monotonic() + limit
        refused = len(_REFUSED.findall(self._output.tail))

        def asked() -> list[bytes]:
            return _REFUSED.findall(self._output.tail)[refused:]

        def told() -> bool:
            return seat.over or self._news() or bool(asked())

        while seat.robot is None and self._until(told, until - time.monotonic()):
            # An agent that has ended may have registered just before.
            ended = seat.over or bool(asked())
            for robot, port in self._newcomers():
                owner = self._owner(port) or seat
                if owner.robot is not None:
                    return owner, SECOND
                if robot > owner.number:
                    return owner, f"start place {robot} was taken, not {owner.number}; {{pos}} says which"
                owner.robot = robot
            if ended and not self._news():
                break
        if seat.robot is None and not seat.over and not self._orphaned:
            seat.note = f"not registered after {limit:g} s"
            for place in asked():
                seat.note = f"asked for start place {int(place)}, not {seat.number}: {{pos}} says which"
            seat.end()
            self._until(lambda: seat.over, 30.0)
        return None

    def _news(self) -> bool:
        return len(_REGISTERED.findall(self._output.tail)) > self._seen

    def _newcomers(self) -> list[tuple[int, int]]:
        """Return robots that have registered since the last look, each with the port of its client."""
        found = _REGISTERED.findall(self._output.tail)
        new = [(int(robot), int(port)) for robot, port in found[self._seen :]]
        self._seen = len(found)
        return new

    def _owner(self, port: int) -> Seat | None:
        """Find whose process has a port; None if that is not known."""
        socket = descendants.socket_of(port)
        for seat in self._seats if socket is not None else ():
            if descendants.holds_socket(descendants.descendants(seat.process.pid), str(socket)):
                return seat
        return None

    def _press_start(self, view: UdpLink) -> Seat | None:
        """Press it when the last robot has had its first cycle, so that every one sees a stopped cycle.

        Returns who has registered a robot too many meanwhile.
        """
        last = max(seat.robot for seat in self._seats if seat.robot is not None)
        until = time.monotonic() + 30.0
        while time.monotonic() < until and not self._orphaned:
            data = view.receive(LOOK)
            with contextlib.suppress(CiberratoError):
                if data and getattr(decode_simulator_message(data), "robot_id", None) == last:
                    break
        view.send(encode(Start()))
        # From then on no robot can register any more.
        self._until(lambda: b"running at time" in self._output.tail, 30.0)
        for _, port in self._newcomers():
            return self._owner(port) or self._seats[-1]
        return None

    # --- what goes on ---------------------------------------------------------------------------

    def _watch(self, stream: Any, take: Callable[[bytes], object]) -> None:
        self._streams.watch(stream, take)

    def _parent(self, data: bytes) -> None:
        self._orphaned = self._orphaned or not data

    def _goes_on(self) -> bool:
        return self._simulator is not None and self._simulator.poll() is None and not self._orphaned

    def _all_over(self) -> bool:
        return all(seat.over for seat in self._seats)

    def _until(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Look on until something is so, at the longest so many seconds and while the simulator runs."""
        until = time.monotonic() + seconds
        while not condition():
            if not self._goes_on() or time.monotonic() > until:
                return condition()
            self._look(LOOK)
        return True

    def _look(self, seconds: float) -> None:
        self._streams.read(seconds)

    def _document(self) -> dict[str, Any]:
        self._end()
        documents = {seat.number: seat.document() for seat in self._seats}
        failed = [document["error"] for document in documents.values() if document["error"]]
        if failed:
            return {"error": failed[0], "busy": False}
        return {
            "error": None,
            "again": None,
            "run": last_run(self._wanted["result"]),
            "names": {
                str(seat.robot): self._wanted["names"][seat.number - 1]
                for seat in self._seats
                if seat.robot is not None
            },
            "agents": [documents.get(number) for number in range(1, len(self._wanted["agents"]) + 1)],
        }

    def _end(self) -> None:
        """End all agents, then the simulator, so that it writes what it has."""
        for seat in self._seats:
            seat.end()
        until = time.monotonic() + 30.0
        while not self._all_over() and time.monotonic() < until:
            self._look(LOOK)
        end_simulator(self._simulator)
        descendants.end_all(lambda: descendants.descendants(os.getpid()))


def main() -> int:
    """Do the run that standard input asks for."""
    return look_after(lambda wanted: Match(wanted).run())


if __name__ == "__main__":
    sys.exit(main())
