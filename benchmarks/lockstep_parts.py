"""Processor time of a lockstep cycle, part by part, and how it grows with robots and walls.

Processor time, as it counts on a busy machine, too: what is measured by the wall clock is in
`benchmarks.simulator_lockstep`. The parts are measured in this process, with clients that answer at once and
no sockets; the whole in a simulator of its own (Linux), which may use one processor only, so that it does not
wait awake. ``python -m benchmarks.lockstep_parts`` prints the growth; with ``before FOLDER``, it compares the
version in another checkout with this one, in turns.
"""

from __future__ import annotations

import math
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from benchmarks.measure import Row
from benchmarks.simulator_lockstep import ANSWER, CYCLES, REGISTRATION, bare_loop, echo, run_cycles
from ciberrato.files.lab import read_lab
from ciberrato.labs import find_lab
from ciberrato.protocol import Measures, decode_actions, encode
from ciberrato.world.lab import Lab, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.service.client_process import ClientProcess
from simulator_stub.service.pace import Lockstep
from simulator_stub.service.session import Session
from simulator_stub.service.transports import Newcomer, Peer
from simulator_stub.simulation import Simulation

SERIES = 5
ROUND = 400
"""Cycles of a series in this process."""


class _Answering(Peer):
    def send(self, data: bytes) -> None:
        """Send nothing."""

    def close(self) -> None:
        """Close nothing."""


class _Registering(Newcomer):
    label = "in this process"

    def accept(self) -> Peer:
        return _Answering(self.label)


class _Resting(ClientProcess):
    """A client's process that has always said all."""

    def __init__(self) -> None:
        self.gone, self.truthful, self.reader = False, True, (1, 1)

    def rests(self) -> bool:
        return True

    def before_message(self) -> None:
        """Return at once."""

    after_message = before_message


class Loop:
    """A session in lockstep with robots that answer at once.

    Parameters
    ----------
    lab : Lab
    grid : StartGrid
    robots : int
    """

    def __init__(self, lab: Lab, grid: StartGrid, robots: int) -> None:
        self.simulation = Simulation(lab, grid, Parameters(sim_time=0), seed=1)
        self.session = Session(self.simulation, autostart=robots)
        for number in range(1, robots + 1):
            self.session.welcome(_Registering(), REGISTRATION % (number, number))
        self.pace = Lockstep(self.session, 0.05, limit=1.0)
        self._answered = True
        for _ in range(3):
            self.cycle()
        for client in self.session.robots.values():
            client.answers.process = _Resting()

    def _poll(self, seconds: float) -> bool:
        if not self._answered:
            self._answered = True
            for client in self.session.robots.values():
                client.peer.deliver(ANSWER)
        return True

    def cycle(self) -> None:
        """Run one cycle."""
        self._answered = False
        self.pace.wait(self._poll)
        self.session.cycle()


def rows() -> Iterator[Row]:
    """Yield the parts for one robot and for five."""
    lab = read_lab(find_lab("maze"))
    single = 0.0
    for robots in CYCLES:
        group = f"processor time of a lockstep cycle, {robots} robot{'s' * (robots > 1)} in maze, UDP"
        bare = whole = math.inf
        for _ in range(SERIES):
            bare = min(bare, echo(robots)[1])
            whole = min(whole, run_cycles("udp", robots, alone=True)[1])
        places = [GridPosition(x=3.0 + 4 * number, y=3.0) for number in range(robots)]
        parts = _parts(lab, StartGrid(positions=tuple(places)), robots)
        single = single or parts["simulation"]
        yield Row(group=group, who="bare exchange", seconds=bare, note="the same datagrams, nothing done")
        yield Row(group=group, who="the simulator", seconds=whole, ours=True, reference=True)
        for who, seconds in parts.items():
            yield Row(group=group, who=f"of it {who}", seconds=seconds, ours=True)
        rest = whole - sum(parts.values()) - bare
        yield Row(group=group, who="of it sockets, polls, caches gone cold", seconds=rest, ours=True)
        steps = (whole - bare) / (robots * single)
        note = f"{steps:.1f} times {robots} plain step{'s' * (robots > 1)}"
        target = single * (1.5 if robots == 1 else 1.2 * robots)
        yield Row(
            group=group,
            who="beyond the bare exchange",
            seconds=whole - bare,
            ours=True,
            target=target,
            note=note,
        )


def _parts(lab: Lab, grid: StartGrid, robots: int) -> dict[str, float]:
    """Measure the parts of a cycle in this process, in seconds."""
    loop = Loop(lab, grid, robots)
    measures: dict[int, Measures] = {}
    actions = decode_actions(ANSWER)

    def step() -> None:
        nonlocal measures
        measures = loop.simulation.step(dict.fromkeys(range(1, robots + 1), actions))

    whole, simulation = math.inf, math.inf
    for _ in range(2 * SERIES):  # in turns: what a step costs depends on where the robots are
        whole = min(whole, processor_seconds(loop.cycle))
        simulation = min(simulation, processor_seconds(step))
    decoding = robots * min(processor_seconds(lambda: decode_actions(ANSWER)) for _ in range(SERIES))
    encoding = min(
        processor_seconds(lambda: [encode(message) for message in measures.values()]) for _ in range(SERIES)
    )
    return {
        "simulation": simulation,
        "decoding Actions": decoding,
        "encoding Measures": encoding,
        "session and pace": whole - simulation - decoding - encoding,
    }


def processor_seconds(work: Callable[[], object], calls: int = ROUND) -> float:
    """Return the processor time of one call, out of many."""
    began = time.process_time()
    for _ in range(calls):
        work()
    return (time.process_time() - began) / calls


def pillars(walls: int, spacing: float = 3.0) -> Lab:
    """Return a lab with that many square pillars in rows; free places are on the odd multiples of 1.5."""
    side = math.ceil(math.sqrt(walls))
    places = [(spacing * (1 + number % side), spacing * (1 + number // side)) for number in range(walls)]
    squares = tuple(
        Wall(height=5.0, corners=((x, y), (x + 0.4, y), (x + 0.4, y + 0.4), (x, y + 0.4))) for x, y in places
    )
    return Lab(width=spacing * (side + 1), height=spacing * (side + 1), walls=squares)


def growth() -> Iterator[str]:
    """Yield lines: processor time of a cycle by robots and walls, in this process."""
    yield "| robots | walls | a cycle in new places | a cycle, mean of the later half | a robot |"
    yield "| --- | --- | --- | --- | --- |"
    counts = [(robots, 1000) for robots in (1, 5, 20, 100)] + [
        (1, walls) for walls in (10, 100, 10_000, 100_000)
    ]
    for robots, walls in counts:
        lab = pillars(walls)
        row = max(1, round(lab.width / 3.0) - 1)
        places = [(1.5 + 3.0 * (number % row), 1.5 + 3.0 * (number // row)) for number in range(robots)]
        grid = StartGrid(positions=tuple(GridPosition(x=x, y=y, direction_deg=0.0) for x, y in places))
        loop = Loop(lab, grid, robots)
        times = np.array([processor_seconds(loop.cycle, 20) for _ in range(40)]) * 1e6
        first, later = times[:5].mean(), times[20:].mean()
        yield f"| {robots} | {walls:,} | {first:,.0f} us | {later:,.0f} us | {later / robots:,.0f} us |"


_STEP = """
from benchmarks import lockstep_parts as parts
from ciberrato.files.lab import read_lab
from ciberrato.labs import find_lab
from ciberrato.world.start_grid import GridPosition, StartGrid
places = [GridPosition(x=3.0 + 4 * number, y=3.0) for number in range({robots})]
found = parts._parts(read_lab(find_lab("maze")), StartGrid(positions=tuple(places)), {robots})
print(found["simulation"])
"""


def compare(folder: str, rounds: int = 4) -> Iterator[str]:
    """Yield lines: a cycle of the version in another checkout, of this one, and of its machine code.

    Beside them the bare exchange, and a loop that does nothing but what a cycle needs.

    All by processor time, in turns: the least of some rounds, and the median in brackets.
    """
    yield "| | 1 robot | 5 robots |"
    yield "| --- | --- | --- |"
    versions: dict[str, tuple[str | None, tuple[str, ...]]] = {
        "before": (folder, ()),
        "now": (None, ()),
        "now, `--compiled`": (None, ("--compiled",)),
    }
    loops = {"a loop that receives, decodes, steps, encodes, sends": False, "the same, machine code": True}
    cycles: dict[tuple[str, int], list[float]] = {}
    steps: dict[tuple[str, int], list[float]] = {}
    for robots in CYCLES:
        for _ in range(rounds):
            cycles.setdefault(("bare", robots), []).append(echo(robots)[1])
            for name, (where, options) in versions.items():
                seconds = run_cycles("udp", robots, *options, folder=where, alone=True)[1]
                cycles.setdefault((name, robots), []).append(seconds)
            for name, compiled in loops.items():
                cycles.setdefault((name, robots), []).append(bare_loop(robots, compiled=compiled))
            for name in ("before", "now"):
                command = [sys.executable, "-c", _STEP.format(robots=robots)]
                text = subprocess.run(command, cwd=versions[name][0], check=True, capture_output=True).stdout
                steps.setdefault((name, robots), []).append(float(text))

    def shown(found: dict[tuple[str, int], list[float]], name: str) -> list[str]:
        times = [np.array(found[name, robots]) * 1e6 for robots in CYCLES]
        return [f"{each.min():.1f} ({np.median(each):.1f}) us" for each in times]

    yield _line("bare exchange", shown(cycles, "bare"))
    for name in loops:
        yield _line(name, shown(cycles, name))
    for name in versions:
        yield _line(f"a cycle {name}", shown(cycles, name))
    for name in ("before", "now"):
        yield _line(f"plain step {name}", shown(steps, name))
    for name in versions:
        for reference in ("before", "now"):
            ratios = []
            for robots in CYCLES:
                beyond = min(cycles[name, robots]) - min(cycles["bare", robots])
                ratios.append(f"{beyond / (robots * min(steps[reference, 1])):.2f}")
            yield _line(f"beyond the bare exchange {name}, in plain single steps {reference}", ratios)


def _line(title: str, cells: list[str]) -> str:
    return f"| {' | '.join((title, *cells))} |"


if __name__ == "__main__":
    if sys.argv[1:] and (len(sys.argv) != 3 or sys.argv[1] != "before"):
        sys.exit(f"usage: python -m benchmarks.{Path(__file__).stem} [before FOLDER]")
    for line in compare(sys.argv[2]) if sys.argv[1:] else growth():
        print(line, flush=True)
