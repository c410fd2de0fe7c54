"""Calibration of the live filter on a bad network and a busy machine: of cells said 0.9, are 0.9 right?

``python -m benchmarks.bad_links --runs 20 --figure docs/figures/bad-links.png`` drives the agent's controller
and the simulation in one process, in virtual time, so that neither the machine nor its load has a say: each
message is lost or late by a condition and a seed, the agent's process stalls, answers take their time, too.
What the agent does when nothing comes is done as in `agent.run.session`.
"""

from __future__ import annotations

import argparse
import dataclasses
import heapq
import itertools
import json
import math
import multiprocessing
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from ciberrato.localization.pose_filter import PoseFilter
    from ciberrato.protocol.messages import Actions, Measures

CYCLE = 0.05
"""Seconds."""
ANGLES = (0.0, 90.0, -90.0, 180.0)
_THINKING = 0.008
_EVERY = 5  # cycles between two looks at the belief
_LEVELS = (0.5, 0.7, 0.85, 0.95, 0.99, 1.0001)


@dataclass(frozen=True)
class Condition:
    """Faults of messages and of the agent's process.

    Attributes
    ----------
    name : str
    loss : float
        Share of the messages that are lost, in each direction.
    delay, jitter : float
        Seconds of each message, in each direction: always, and uniformly random in addition.
    cut : float
        Seconds of each of four outages, in both directions.
    cut_down_only : bool
        Whether the agent's messages still arrive meanwhile.
    stall : float
        Longest pause of the agent's process, in seconds, after each message that it has processed.
    """

    name: str
    loss: float = 0.0
    delay: float = 0.0
    jitter: float = 0.0
    cut: float = 0.0
    cut_down_only: bool = False
    stall: float = 0.0


CONDITIONS = (
    Condition("undisturbed"),
    *(Condition(f"loss {share:.0%}", loss=share) for share in (0.1, 0.2, 0.3)),
    *(Condition(f"delay {1000 * time:.0f} ms", delay=time) for time in (0.05, 0.1, 0.15, 0.3)),
    *(Condition(f"jitter {1000 * time:.0f} ms", jitter=time) for time in (0.1, 0.3)),
    *(Condition(f"cuts {time:g} s", cut=time) for time in (0.5, 1.5, 3.0)),
    Condition("cuts down 1.5 s", cut=1.5, cut_down_only=True),
    *(Condition(f"stalls {1000 * time:.0f} ms", stall=time) for time in (0.2, 0.5)),
)


@dataclass
class Outcome:
    """Outcome of a run.

    Attributes
    ----------
    claims : list of (float, bool)
        Probability of the most likely cell, and whether it was right; every fifth cycle.
    poses : list of (float, float)
        Probability of the pose that the agent says, and how far it is off, in units, likewise.
    collisions : int
        Cycles.
    blind : float
        Most units driven in a row without any message from the agent.
    turned : float
        Most full turns in a row within half a unit.
    """

    condition: str
    seed: int
    claims: list[tuple[float, bool]] = field(default_factory=list)
    poses: list[tuple[float, float]] = field(default_factory=list)
    collisions: int = 0
    blind: float = 0.0
    turned: float = 0.0
    said: str = ""


class Network:
    """Messages under way, in one direction."""

    def __init__(self, condition: Condition, generator: np.random.Generator, cuts: list[float]) -> None:
        self._condition = condition
        self._generator = generator
        self._cuts = cuts
        self._under_way: list[tuple[float, int, Any]] = []
        self._number = itertools.count()

    def send(self, now: float, message: Measures | Actions) -> None:
        """Send a message, which may be lost."""
        condition = self._condition
        lost, late = self._generator.random(2)
        cut = any(begin <= now < begin + condition.cut for begin in self._cuts)
        if lost >= condition.loss and not cut:
            due = now + condition.delay + late * condition.jitter + 1e-4
            heapq.heappush(self._under_way, (due, next(self._number), message))

    def receive(self, now: float) -> Iterator[tuple[float, Any]]:
        """Yield what has arrived, with the time of its arrival."""
        while self._under_way and self._under_way[0][0] <= now:
            due, _, message = heapq.heappop(self._under_way)
            yield due, message

    @property
    def next(self) -> float:
        """Time of the next arrival."""
        return self._under_way[0][0] if self._under_way else math.inf


def run(condition: Condition, lab_name: str, drive_name: str, seed: int, cycles: int) -> Outcome:
    """Run the agent for a while on a network and a machine as the condition says."""
    from agent.drives import make_drive
    from agent.run.live_controller import LiveController
    from ciberrato.files.lab import read_lab
    from ciberrato.files.run_records import RunHeader
    from ciberrato.labs import find_lab
    from ciberrato.localization.belief import compiled
    from ciberrato.localization.pose_filter import PoseFilter
    from ciberrato.protocol.messages import Actions
    from ciberrato.protocol.registrations import RobotRegistration
    from ciberrato.world.parameters import Parameters
    from ciberrato.world.start_grid import GridPosition, StartGrid
    from simulator_stub.simulation import Simulation

    compiled.load()
    generator = np.random.default_rng([seed, 0xBAD])
    lab, parameters = read_lab(find_lab(lab_name)), Parameters()
    x, y, heading = _start(lab, generator)
    grid = StartGrid(positions=(GridPosition(x=x, y=y, direction_deg=heading),))
    simulation = Simulation(lab, grid, parameters, seed=seed)
    robot = simulation.register(RobotRegistration(name="r", sensor_angles=tuple(enumerate(ANGLES))))
    assert robot is not None
    cuts = [float(cycles * CYCLE * (0.2 * k + 0.1 * generator.random())) for k in range(1, 5)]
    down = Network(condition, generator, cuts)
    up = Network(condition, generator, [] if condition.cut_down_only else cuts)
    header = RunHeader(lab_name="", lab_sha256="", parameters=parameters, sensor_angles=ANGLES)
    outcome = Outcome(condition.name, seed)
    with PoseFilter(lab, parameters, ANGLES, wait=True) as localizer:
        drive = None if drive_name == "right" else make_drive(drive_name, lab, parameters, ANGLES)
        controller = LiveController(header, localizer, drive)
        agent = _Agent(condition, generator, controller, down, up)
        # A registration is answered in the next cycle: what it took beyond that was spent on the way.
        trip = 2.0 * (condition.delay + 0.5 * condition.jitter)
        controller.exchange.round_trip = max(trip + CYCLE * float(generator.random()) - CYCLE, 0.0)
        poses = []
        measures = simulation.launch()[robot]
        driven, turned, place, former = 0.0, 0.0, (x, y), (x, y, math.radians(heading))
        for cycle in range(cycles):
            now = cycle * CYCLE
            pose = simulation.poses()[0]
            poses.append(pose)
            outcome.collisions += bool(measures.collision)
            driven += math.hypot(pose[0] - former[0], pose[1] - former[1])
            turned += math.remainder(pose[2] - former[2], 2.0 * math.pi)
            if math.hypot(pose[0] - place[0], pose[1] - place[1]) > 0.5:
                place, turned = (pose[0], pose[1]), 0.0
            outcome.turned = max(outcome.turned, abs(turned) / (2.0 * math.pi))
            former = pose
            down.send(now, measures)
            for time in agent.work(now + CYCLE):
                _look(localizer, poses, time, outcome)
            told = [message for _, message in up.receive(now + CYCLE)]
            driven = 0.0 if told else driven
            outcome.blind = max(outcome.blind, driven)
            actions = told[-1] if told else Actions()
            measures = simulation.step({robot: actions})[robot]
        outcome.said = controller.exchange.summary() or ""
    return outcome


class _Agent:
    """Does what `agent.run.session` does, at the times that the condition leaves to it."""

    def __init__(
        self,
        condition: Condition,
        generator: np.random.Generator,
        controller: Any,
        down: Network,
        up: Network,
    ) -> None:
        self._condition, self._generator = condition, generator
        self._controller, self._down, self._up = controller, down, up
        self._free = 0.0
        self._next_stop = math.inf

    def work(self, until: float) -> Iterator[int]:
        """Process what arrives before a time; yield the times of the messages processed."""
        exchange = self._controller.exchange
        while (now := max(self._free, min(self._down.next, self._next_stop))) < until:
            arrived = [(message, due) for due, message in self._down.receive(now)]
            news = exchange.news(arrived)
            for number, (message, due) in enumerate(news, start=1):
                _, actions = self._controller.observe(message, newest=number == len(news), arrived=due)
                yield message.time
                if actions is not None:
                    self._controller.sent(now + _THINKING)
                    self._up.send(now + _THINKING, actions)
            if news:
                self._next_stop = now + _THINKING + exchange.patience
            elif now >= self._next_stop:
                self._up.send(now, exchange.stopped(now))
                self._next_stop = now + CYCLE
            self._free = now + _THINKING + self._condition.stall * float(self._generator.random())


def _start(lab: Any, generator: np.random.Generator) -> tuple[float, float, float]:
    from agent.offline.expected_readings import standable_cells

    cells = np.argwhere(standable_cells(lab))
    row, column = cells[generator.integers(len(cells))]
    return 2.0 * float(column) + 1.0, 2.0 * float(row) + 1.0, float(generator.integers(4)) * 90.0


def _look(localizer: PoseFilter, poses: Sequence[Any], time: int, outcome: Outcome) -> None:
    grid = localizer.live.filter
    if time % _EVERY or grid is None or time >= len(poses):
        return
    x, y, _ = poses[time]
    lab = localizer.lab
    belief = grid.belief
    shares = np.bincount(belief.lattice.cell, belief.square_weights(), lab.rows * lab.columns)
    best = int(shares.argmax())
    outcome.claims.append((float(shares[best]), best == int(y // 2) * lab.columns + int(x // 2)))
    found = localizer.live.estimate()
    if found is not None:
        outcome.poses.append((found.probability, math.hypot(found.x - x, found.y - y)))


def reliability(claims: Sequence[tuple[float, bool]]) -> list[tuple[float, float, int]]:
    """Return, for each level of probability, its mean, the share that was right, and how many there were."""
    said = np.array([one[0] for one in claims])
    right = np.array([one[1] for one in claims], float)
    bins = [np.flatnonzero((said >= low) & (said < high)) for low, high in itertools.pairwise(_LEVELS)]
    return [(float(said[one].mean()), float(right[one].mean()), len(one)) for one in bins if len(one)]


def summary(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Sum up the runs of a condition."""
    claims = [claim for one in outcomes for claim in one.claims]
    sure = [right for said, right in claims if said > 0.9]
    poses = [off for one in outcomes for said, off in one.poses if said > 0.9]
    runs_wrong = sum(any(said > 0.9 and not right for said, right in one.claims) for one in outcomes)
    return {
        "runs": len(outcomes),
        "claims": len(claims),
        "said": float(np.mean([said for said, _ in claims if said > 0.9])) if sure else math.nan,
        "sure": len(sure) / max(len(claims), 1),
        "right": float(np.mean(sure)) if sure else math.nan,
        "poses wrong": float(np.mean(np.array(poses) > 0.5)) if poses else math.nan,
        "runs with a wrong sure cell": runs_wrong,
        "collisions": sum(one.collisions for one in outcomes),
        "turns": max(one.turned for one in outcomes),
        "blind": max(one.blind for one in outcomes),
        "reliability": reliability(claims),
    }


def _run(words: tuple[Condition, str, str, int, int]) -> Outcome:
    return run(*words)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run what the command line says."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.bad_links", description=__doc__)
    parser.add_argument("--runs", type=int, default=6, help="a condition and lab")
    parser.add_argument("--first-seed", type=int, default=0, help="the others are counted up")
    parser.add_argument("--cycles", type=int, default=400)
    parser.add_argument("--lab", nargs="+", default=["maze", "corridors"])
    parser.add_argument("--drive", default="explore")
    parser.add_argument("--only", default="", help="conditions whose name contains this")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--figure", type=Path)
    options = parser.parse_args(arguments)
    chosen = [one for one in CONDITIONS if options.only in one.name]
    tasks = [
        (one, lab, options.drive, seed, options.cycles)
        for one in chosen
        for lab in options.lab
        for seed in range(options.first_seed, options.first_seed + options.runs)
    ]
    with multiprocessing.get_context("spawn").Pool(options.jobs) as pool:
        outcomes = pool.map(_run, tasks, chunksize=1)
    table = {
        one.name: summary([outcome for outcome in outcomes if outcome.condition == one.name])
        for one in chosen
    }
    print("condition          runs  sure  said right  poses wrong  runs wrong  collisions  turns  blind")
    for name, row in table.items():
        print(
            f"{name:18} {row['runs']:4d}  {row['sure']:.2f}  {row['said']:.3f} {row['right']:.3f}"
            f"  {row['poses wrong']:11.3f}  {row['runs with a wrong sure cell']:10d}"
            f"  {row['collisions']:10d}  {row['turns']:5.1f}  {row['blind']:5.2f}"
        )
    pooled = reliability([claim for one in outcomes for claim in one.claims])
    print("all together, of cells said with (mean of a class): right (number)")
    print(", ".join(f"{said:.4f}: {right:.3f} ({number})" for said, right, number in pooled))
    if options.json is not None:
        options.json.write_text(json.dumps([dataclasses.asdict(one) for one in outcomes]))
    if options.figure is not None:
        draw(table, pooled, options.figure)


def draw(table: dict[str, dict[str, Any]], pooled: Sequence[tuple[float, float, int]], path: Path) -> None:
    """Draw how often the sure were right; of all conditions, what was said against what was right."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
    names = list(table)
    left.barh(names, [table[name]["right"] for name in names], color="0.6", label="right")
    said = [table[name]["said"] for name in names]
    left.plot(said, names, "k|", markersize=9, label="said (mean)")
    left.set_xlim(0.5, 1.0)
    left.invert_yaxis()
    left.set_xlabel("share of the cells said with more than 0.9")
    left.legend(fontsize=7, loc="lower left")
    left.tick_params(labelsize=7)
    for level, share, count in pooled:
        right.plot(level, share, "ko", markersize=4)
        right.annotate(f"{count}", (level, share), fontsize=6, xytext=(4, -8), textcoords="offset points")
    right.plot((0.5, 1.0), (0.5, 1.0), "k:", lw=1.0)
    right.set_xlabel("probability said")
    right.set_ylabel("share right")
    figure.savefig(path, dpi=90)


if __name__ == "__main__":
    main()
