"""One honest robot at a simulator with hostile neighbours: how many of its Measures it answered in time.

As a program, each fault once, and the undisturbed run before it, of the same session::

    python -m tests.chaos.scenario [KIND ...] [--cycles 80]
"""

from __future__ import annotations

import argparse
import contextlib
import json
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ANSWER = b'<Actions LeftMotor="0.1" RightMotor="0.08"/>'
GRID = "3,3,0;7,3,0;11,3,0;15,3,0;19,3,0;23,3,0"

FAULTS: dict[str, tuple[str, ...]] = {
    "none": (),
    "nul": ("nul",),
    "flood": ("flood",),
    "flood-4": ("flood", "-n", "4"),
    "heavy": ("heavy",),
    "newcomers": ("newcomers", "-n", "20"),
    "labreq": ("labreq",),
    "labreq-60": ("labreq", "-n", "60"),
    "udp-flood": ("udp-flood",),
    "junk-200": ("junk", "--rate", "200"),
    "junk": ("junk", "--rate", "5000"),
    "junk-flood": ("junk",),
    "dead-views": ("dead-views", "-n", "64"),
    "idle": ("idle", "-n", "512"),
}


@dataclass
class Outcome:
    """What an honest robot met.

    Attributes
    ----------
    registered : bool
        Whether it was accepted within a minute.
    answered, cycles : int
        Running cycles that the simulator counts as answered, of how many.
    stall : float
        Seconds, the longest time between two Measures of the run.
    waited : float
        Seconds from its registration to the Reply.
    result : dict
        The result file.
    said : str
        Standard error of the simulator.
    """

    registered: bool = False
    answered: int = 0
    cycles: int = 0
    stall: float = 0.0
    waited: float = float("inf")
    status: int | None = None
    result: dict[str, Any] = field(default_factory=dict)
    said: str = ""

    def __str__(self) -> str:
        if not self.registered:
            return "the honest robot is not answered"
        return (
            f"{self.answered} of {self.cycles} answered, longest stall {self.stall * 1000:.0f} ms, "
            f"Reply after {self.waited * 1000:.0f} ms"
        )


@contextlib.contextmanager
def simulator(
    *options: str, cycles: int, period: int, preexec: Callable[[], None] | None = None, folder: Path
) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """Run a simulator; yield its process and its port."""
    parameters = folder / "parameters.xml"
    parameters.write_text(f'<Parameters SimTime="{cycles}" CycleTime="{period}"/>', encoding="utf-8")
    command = [sys.executable, "-m", "simulator_stub", "--lab", "maze", "--grid", GRID, "--seed", "1"]
    command += ["--param", str(parameters), "--exit-at-end", "--bind", "127.0.0.1", "--port", "0", *options]
    with (
        open(folder / "stderr", "w") as errors,
        subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=errors, text=True, preexec_fn=preexec
        ) as process,
    ):
        assert process.stdout is not None
        try:
            lines = [process.stdout.readline() for _ in range(3)]
            yield process, int(lines[1].rsplit(":", 1)[1])
        finally:
            process.kill()


@contextlib.contextmanager
def hostile(port: int, seconds: float, *arguments: str) -> Iterator[subprocess.Popen[str] | None]:
    """Run hostile clients while the block does."""
    if not arguments:
        yield None
        return
    command = [sys.executable, "-m", "tests.chaos.hostile", *arguments]
    command += ["--port", str(port), "--seconds", str(seconds)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            process.stdout.readline()
            yield process
        finally:
            process.kill()


def honest(port: int, outcome: Outcome, *, transport: str = "udp", tries: int = 1) -> None:
    """Register on place 1, and answer every Measures until the end.

    A datagram may be lost where the port is flooded: as agents do, the registration is sent again, `tries`
    times in a minute.
    """
    tcp = transport == "tcp"
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM if tcp else socket.SOCK_DGRAM) as robot:
        if tcp:
            robot.connect(("127.0.0.1", port))
            robot.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        else:
            robot.bind(("127.0.0.1", 0))
        robot.settimeout(60.0 / tries)
        began = time.monotonic()
        data = b""
        for _ in range(tries):
            try:
                if tcp:
                    robot.sendall(b'<Robot Id="1" Name="honest"/>\0')
                    data = robot.recv(1 << 16)
                else:
                    robot.sendto(b'<Robot Id="1" Name="honest"/>', ("127.0.0.1", port))
                    data, own = robot.recvfrom(1 << 16)
                    robot.connect(own)
                break
            except OSError:
                continue
        robot.settimeout(60.0)
        outcome.registered = b'Status="Ok"' in data
        outcome.waited = time.monotonic() - began
        last: float | None = None
        while outcome.registered:
            try:
                data = robot.recv(1 << 16)
            except OSError:
                return
            now = time.monotonic()
            if not data or b'Start="Off" Stop="Off"' in data:
                return
            if b'Time="0"' not in data:
                outcome.stall = max(outcome.stall, now - last) if last else 0.0
                last = now
            robot.send(ANSWER + b"\0" * tcp)


def run(
    *arguments: str,
    cycles: int = 80,
    period: int = 50,
    options: tuple[str, ...] = (),
    lead: float = 0.5,
    transport: str = "udp",
) -> Outcome:
    """Let an honest robot drive next to hostile clients.

    Parameters
    ----------
    *arguments : str
        Of `tests.chaos.hostile`; none for an undisturbed run.
    lead : float
        Seconds that the hostile ones are there before the honest one.
    """
    outcome = Outcome()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        result = folder / "result.json"
        words = ("--result", str(result), "--autostart", "1", *options)
        # Hostile robots are there first: then the honest one is the last that the start waits for.
        robots = 1 + (int(arguments[2]) if len(arguments) > 2 and arguments[1] == "-n" else 1) * bool(
            {"nul", "flood", "heavy", "udp-flood"} & set(arguments[:1])
        )
        words = tuple(str(robots) if word == "1" else word for word in words)
        with (
            simulator(*words, cycles=cycles, period=period, folder=folder) as (process, port),
            hostile(port, 600.0, *arguments),
        ):
            time.sleep(lead)
            honest(port, outcome, transport=transport, tries=120 if transport == "udp" else 1)
            if outcome.registered:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    outcome.status = process.wait(120.0)
        outcome.said = (folder / "stderr").read_text()
        if result.exists():
            outcome.result = json.loads(result.read_text())
            for world in outcome.result["runs"]:
                for robot in world["robots"]:
                    if robot["id"] == 1:
                        outcome.answered, outcome.cycles = robot["answered"], world["time"]
    return outcome


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.chaos.scenario")
    parser.add_argument("kinds", nargs="*", default=list(FAULTS), metavar="KIND", help=", ".join(FAULTS))
    parser.add_argument("--cycles", type=int, default=80)
    parser.add_argument("--period", type=int, default=50, help="CycleTime, ms")
    parser.add_argument("--transport", default="udp", choices=("udp", "tcp"))
    parser.add_argument("--tries", type=int, default=1)
    parser.add_argument("--lockstep", action="store_true")
    options = parser.parse_args()
    extra = ("--lockstep",) if options.lockstep else ()
    for kind in options.kinds:
        for _ in range(options.tries):
            outcome = run(
                *FAULTS[kind],
                cycles=options.cycles,
                period=options.period,
                transport=options.transport,
                options=extra,
            )
            print(f"{kind:12} {outcome}", flush=True)
            dropped = {
                name: number
                for world in outcome.result.get("runs", ())
                for name, number in world.get("dropped", {}).items()
                if number
            }
            if dropped:
                print(f"{'':12} dropped: {dropped}", flush=True)


if __name__ == "__main__":
    main()
