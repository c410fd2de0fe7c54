"""Frequency of right most likely cells: both presets and the enumeration, over many drives.

``python -m benchmarks.accuracy --runs 200`` drives the agent's tracker and pilot in the simulation, in one
process, on `standard`, `corridors` and `maze`, each run from a start cell drawn at random, with the real
simulator's default noise and with still motors. A tie among n cells counts 1/n. The log loss is the mean of
-log2 of the probability given to the true cell; the uniform belief over 98 cells has 6.61 bits.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import multiprocessing
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from agent.drives.right.pilot import Pilot
from agent.drives.right.tracker import CellTracker, Crossing
from agent.offline.expected_readings import compute_expected_readings, standable_cells
from agent.offline.localizer import PRESETS, localize
from agent.offline.summary import peak
from benchmarks.enumeration import enumerate_starts
from ciberrato.files.lab import read_lab
from ciberrato.files.parameters import read_parameters
from ciberrato.labs import find_lab, find_parameters
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.world.coordinates import Cell
from ciberrato.world.lab import CELL_SIZE, Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation
from simulator_stub.world.simulator_state import SimulatorState

LABS = ("standard", "corridors", "maze")
ANGLES = (0.0, 90.0, -90.0, 180.0)
LONGEST = 700
"""Cycles after which a drive is given up."""


@dataclass(frozen=True, slots=True)
class Drive:
    """Result of one run: the readings, the true places, and their distances from the centres."""

    crossings: tuple[Crossing, ...]
    cells: tuple[Cell, ...]
    offsets: tuple[tuple[float, float, float], ...]
    expected_steps: int
    collisions: int


def random_start(lab: Lab, generator: np.random.Generator) -> GridPosition:
    """Draw a cell in which a robot can stand; heading 0."""
    cells = np.argwhere(standable_cells(lab))
    row, column = (int(value) for value in cells[generator.integers(len(cells))])
    return GridPosition(x=(column + 0.5) * CELL_SIZE, y=(row + 0.5) * CELL_SIZE)


def drive(lab: Lab, start: GridPosition, parameters: Parameters, seed: int | np.random.Generator) -> Drive:
    """Drive right from a cell until a wall stops the robot."""
    simulation = Simulation(lab, StartGrid(positions=(start,)), parameters, seed=seed)
    angles = tuple(enumerate(ANGLES))
    robot = simulation.register(RobotRegistration(name="study", sensor_angles=angles))
    assert robot is not None
    tracker, pilot = CellTracker(parameters, ANGLES), Pilot(0.1)
    command: tuple[float, float] | None = None
    # As over the wire: the Measures behind the Reply, then those of the cycle that reads Start.
    measures = simulation.step()[robot]
    crossings, truth, offsets, collisions, resting = [], [], [], 0, 0
    while resting < 5 and simulation.time < LONGEST:
        crossing = tracker.observe(measures, command)
        if crossing is not None:
            x, y, heading = simulation.poses()[0]
            crossings.append(crossing)
            truth.append((int(y // CELL_SIZE), int(x // CELL_SIZE)))
            offsets.append((x - start.x - CELL_SIZE * crossing.index, y - start.y, heading))
        collisions += bool(measures.collision)
        command = pilot.drive(tracker)
        resting = resting + 1 if command == (0.0, 0.0) and tracker.at_rest else 0
        if simulation.state is SimulatorState.STOPPED:
            command = (0.0, 0.0)
            simulation.start()
        measures = simulation.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
    row, column = int(start.y // CELL_SIZE), int(start.x // CELL_SIZE)
    east = compute_expected_readings(lab, ANGLES).east[row, column:]
    closed = np.flatnonzero(~east)
    expected = 1 + (int(closed[0]) if len(closed) else len(east))
    return Drive(tuple(crossings), tuple(truth), tuple(offsets), expected, collisions)


@dataclass(slots=True)
class Score:
    """Sums over steps."""

    steps: int = 0
    right: float = 0.0
    loss: float = 0.0

    def add(self, belief: np.ndarray, truth: Cell) -> None:
        best = peak(belief)
        self.steps += 1
        self.right += 1 / len(best.cells) if truth in best.cells else 0.0
        self.loss -= math.log2(max(belief[truth], 1e-300))

    def merge(self, other: Score) -> None:
        self.steps += other.steps
        self.right += other.right
        self.loss += other.loss


@dataclass(slots=True)
class Outcome:
    """Entries of one drive in the table."""

    scores: dict[str, Score]
    difference: float
    missed: bool
    extra: bool
    collisions: int
    recoveries: int
    offsets: list[tuple[float, float, float]]


def judge(task: tuple[str, Parameters, int]) -> Outcome:
    """Drive once and score both presets and the enumeration on the same readings."""
    lab_name, parameters, seed = task
    lab, generator = read_lab(find_lab(lab_name)), np.random.default_rng(seed)
    run = drive(lab, random_start(lab, generator), parameters, generator)
    truth = compute_expected_readings(lab, ANGLES, parameters)
    readings = [crossing.readings for crossing in run.crossings]
    scores: dict[str, Score] = {}
    difference, recoveries = 0.0, 0
    for preset in PRESETS:
        found = localize(readings, truth, preset=preset, obstacle_noise=parameters.obstacle_noise)
        oracle = enumerate_starts(readings, truth, preset=preset, sigma=parameters.obstacle_noise)
        scores[preset], scores[f"{preset}, enumerated"] = Score(), Score()
        recoveries += len(found.recoveries)
        for belief, posterior, cell in zip(found.beliefs[1:], oracle, run.cells, strict=True):
            scores[preset].add(belief, cell)
            scores[f"{preset}, enumerated"].add(
                np.full(belief.shape, 1 / belief.size) if posterior is None else posterior, cell
            )
            if posterior is not None:
                difference = max(difference, float(np.abs(belief - posterior).max()))
    return Outcome(
        scores=scores,
        difference=difference,
        missed=len(run.crossings) < run.expected_steps,
        extra=len(run.crossings) > run.expected_steps,
        collisions=run.collisions,
        recoveries=recoveries,
        offsets=list(run.offsets[1:]),
    )


def table(runs: int, seed: int) -> Iterator[str]:
    """Yield the lines of the table."""
    worlds = {"still motors": read_parameters(find_parameters("seed"))}
    worlds["default noise"] = read_parameters(find_parameters("default"))
    yield (
        f"{'lab':10} {'noise':14} {'filter':24} {'steps':>6} {'right':>7} {'log loss':>9}   (seeds {seed} to "
        f"{seed + runs - 1}; ties count 1/n; log loss in bits)"
    )
    with multiprocessing.get_context("spawn").Pool() as pool:
        for lab in LABS:
            for noise, parameters in worlds.items():
                tasks = [
                    (lab, dataclasses.replace(parameters, sim_time=0), seed + run) for run in range(runs)
                ]
                outcomes = pool.map(judge, tasks, chunksize=5)
                totals: dict[str, Score] = {}
                for outcome in outcomes:
                    for name, score in outcome.scores.items():
                        totals.setdefault(name, Score()).merge(score)
                for name, total in totals.items():
                    right, loss = total.right / total.steps, total.loss / total.steps
                    yield f"{lab:10} {noise:14} {name:24} {total.steps:6d} {right:7.1%} {loss:9.3f}"
                offsets = np.array([offset for outcome in outcomes for offset in outcome.offsets])
                spread = offsets.std(axis=0) if len(offsets) else np.zeros(3)
                yield (
                    f"{lab:10} {noise:14} greatest difference from the enumeration "
                    f"{max(outcome.difference for outcome in outcomes):.1e}; runs with a missed crossing "
                    f"{sum(o.missed for o in outcomes)}, with one too many {sum(o.extra for o in outcomes)}; "
                    f"colliding cycles {sum(o.collisions for o in outcomes)}; restarts "
                    f"{sum(o.recoveries for o in outcomes)}; pose error at crossings (std) along "
                    f"{spread[0]:.3f}, lateral {spread[1]:.3f}, heading {math.degrees(spread[2]):.2f} deg"
                )


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.accuracy", description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(argv)
    for line in table(options.runs, options.seed):
        print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
