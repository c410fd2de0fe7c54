"""Environments of Gymnasium beside the bare simulation that they stand on, in one run and in turns.

Each is stepped for a short while, then the next one, round after round, and the fastest round of each
counts. Times are processor times of the calling thread, because a clock on the wall tells of other
programs, too: with two threads each does half of what can be shared, so this is what a machine takes that
has two cores to spare, but for the waiting. What the wall said is in the notes. The reference is the plain
loop of `benchmarks.simulator_speed`. ``Navigate-v0`` in `maze`, free starts, wheels that change every 20
cycles; no episode ends meanwhile, and a row tells what one reset costs. The bare batch counts the same
scores.
"""

from __future__ import annotations

import functools
import importlib.util
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from benchmarks.measure import Row, absent
from benchmarks.simulator_speed import COMMANDS, HELD, NOISE, free_starts, plain_steps
from ciberrato.files.lab import read_lab
from ciberrato.labs import find_lab
from ciberrato.physics.kinematics import MAX_POWER
from simulator_stub.batch import BatchSimulation

WORLDS = (1, 64, 1024, 8192)
ROUNDS = 16
SLICE = 0.04
"""Seconds of a round, about, for each."""
KEPT = 0.9
"""Share of the bare batch's speed that many environments are to keep."""
TARGET = 1 / 2_000_000
"""Seconds a robot-step that were asked for of two threads."""
_FOREVER = 10**9


@dataclass
class Runner:
    """One of those that are compared.

    Attributes
    ----------
    who : str
    step : callable
        Does one cycle of all its worlds; told the number of the cycle.
    worlds : int
    best, wall : float
        Least seconds a robot-step so far, of the calling thread's processor time and by the wall.
    """

    who: str
    step: Callable[[int], object]
    worlds: int
    best: float = field(default=float("inf"))
    wall: float = field(default=float("inf"))
    cycle: int = 0
    cycles: int = 1

    def warm_up(self) -> None:
        """Compile, fill the tables, and find how many cycles make a round."""
        for _ in range(3 if self.worlds > 1 else 200):
            self.step(self.cycle)
        begun = 0.0
        for _ in range(HELD * len(COMMANDS) if self.worlds <= 1024 else HELD):
            begun = time.thread_time()
            self.step(self.cycle)
            self.cycle += 1
        self.cycles = max(1, round(SLICE / max(time.thread_time() - begun, 1e-6)))

    def run(self) -> None:
        """Run a round."""
        begun, wall = time.thread_time(), time.perf_counter()
        for _ in range(self.cycles):
            self.step(self.cycle)
            self.cycle += 1
        steps = self.cycles * self.worlds
        self.best = min(self.best, (time.thread_time() - begun) / steps)
        self.wall = min(self.wall, (time.perf_counter() - wall) / steps)


def rows() -> Iterator[Row]:
    """Yield the rows of this benchmark."""
    if importlib.util.find_spec("gymnasium") is None:
        yield from absent("Navigate-v0 in maze", "CiberRatoVectorEnv", "ciberrato[gym]")
        return
    for worlds in WORLDS:
        yield from _group(worlds)
    yield from _resets()


def _group(worlds: int) -> Iterator[Row]:
    group = f"Navigate-v0 in maze, {worlds} worlds; a robot-step"
    lab = read_lab(find_lab("maze"))
    start = free_starts(lab, 1, np.random.default_rng(1))[0]
    plain = Runner("plain Python, all faces", lambda cycle: plain_steps(lab, start, HELD), HELD)
    runners = [plain]
    if worlds == 1:
        runners.append(_single())
    pairs: list[tuple[Runner, Runner]] = []
    for name, options in _machines(worlds):
        pairs.append(_pair(worlds, name, options))
        runners += pairs[-1]
    for runner in runners:
        runner.warm_up()
    for _ in range(ROUNDS):
        for runner in runners:
            runner.run()
    bare_of = {id(many): bare for bare, many in pairs}
    one_thread = next((many.best for _, many in pairs if "1 thread" in many.who), None)
    for runner in runners:
        notes = [f"{1 / runner.best:,.0f} robot-steps/s, by the wall {1 / runner.wall:,.0f}"]
        target = None
        if id(runner) in bare_of:
            bare = bare_of[id(runner)].best
            notes.append(f"{bare / runner.best:.0%} of the bare batch")
            target = bare / KEPT if worlds >= WORLDS[2] else None
        if "threads" in runner.who and one_thread:
            notes.append(f"{one_thread / runner.best:.2f} times one thread's environments")
            target = TARGET if worlds == WORLDS[-1] else target
        yield Row(
            group=group,
            who=runner.who,
            seconds=runner.best,
            reference=runner is plain,
            ours=runner is not plain,
            target=target,
            note="; ".join(notes),
        )


def _machines(worlds: int) -> list[tuple[str, dict[str, object]]]:
    machines: list[tuple[str, dict[str, object]]] = [("numpy", {"compiled": False})]
    if importlib.util.find_spec("numba"):
        machines.append(("numba, 1 thread", {"compiled": True, "threads": 1}))
        if worlds >= WORLDS[2] and (os.cpu_count() or 1) > 1:
            machines.append(("numba, 2 threads", {"compiled": True, "threads": 2}))
    return machines


def _single() -> Runner:
    from ciberrato.gym import CiberRatoEnv

    env = CiberRatoEnv("navigate", starts="free", time_limit=_FOREVER)
    env.reset(seed=1)
    actions = [np.array(power, np.float32) / np.float32(MAX_POWER) for power in COMMANDS]
    return Runner("CiberRatoEnv", lambda cycle: env.step(actions[cycle // HELD % len(actions)]), 1)


def _pair(worlds: int, name: str, options: dict[str, object]) -> tuple[Runner, Runner]:
    from ciberrato.gym import CiberRatoVectorEnv

    lab = read_lab(find_lab("maze"))
    starts = free_starts(lab, worlds, np.random.default_rng(1))
    commands = [np.broadcast_to(np.array(power), (worlds, 2)) for power in COMMANDS]
    make = functools.partial(BatchSimulation, lab, starts, NOISE, line_sensor=False, scoring=0)
    bare = make(seeds=range(worlds), **options)  # type: ignore[arg-type]
    many = CiberRatoVectorEnv(
        "navigate",
        worlds,
        starts="free",
        time_limit=_FOREVER,
        **options,  # type: ignore[arg-type]
    )
    many.reset(seed=1)
    actions = [(command / MAX_POWER).astype(np.float32) for command in commands]
    return (
        Runner(
            f"bare batch, {name}", lambda cycle: bare.step(commands[cycle // HELD % len(COMMANDS)]), worlds
        ),
        Runner(
            f"environments, {name}", lambda cycle: many.step(actions[cycle // HELD % len(COMMANDS)]), worlds
        ),
    )


def _resets() -> Iterator[Row]:
    from ciberrato.gym import CiberRatoVectorEnv

    worlds = WORLDS[2]
    many = CiberRatoVectorEnv("navigate", worlds, starts="free", compiled=False)
    some = np.arange(worlds) % 16 == 0
    many.reset(seed=1)
    runner = Runner(
        "environments, each of 64 of them",
        lambda cycle: many.reset(options={"reset_mask": some}),
        int(some.sum()),
    )
    for _ in range(ROUNDS):
        runner.run()
    yield Row(
        group="a reset of an environment in a batch",
        who=runner.who,
        seconds=runner.best,
        ours=True,
        note=f"as long as {runner.best * 1e6:.0f} steps at 1,000,000 a second; an episode has 1800",
    )
