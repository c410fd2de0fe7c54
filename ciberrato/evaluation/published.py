"""Holds the pose filter against the published method, on the published method's own ground.

The robot starts in a cell's centre, looks to the right, has motors without noise, and drives to the right
until a wall. Both are told so. The published method takes one reading a cell and says what it thinks at
each centre; the pose filter has taken in every message until then and is asked at the same messages.
Neither looks back on a cell from later ones.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from agent.drives.right.controller import Controller
from agent.drives.right.phases import Phase
from agent.offline.expected_readings import ExpectedReadings, compute_expected_readings, standable_cells
from agent.offline.localizer import localize
from ciberrato.arrays import Floats
from ciberrato.evaluation.episode import RIGHT_ANGLES, lab_of, tables_of
from ciberrato.evaluation.report import MOST_NAME, aligned
from ciberrato.evaluation.workers import worker_processes
from ciberrato.files.parameters import read_parameters
from ciberrato.files.run_records import RunHeader
from ciberrato.infrared.model import cell_centres
from ciberrato.labs import find_parameters
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.localization.filtering.staged_filter import staged_filter
from ciberrato.localization.tables.pose_tables import COARSE
from ciberrato.plaintext import plain
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.reprs import short_repr
from ciberrato.system.process import processors
from ciberrato.world.coordinates import Cell
from ciberrato.world.lab import CELL_SIZE, Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

PRIOR = "centres:0"
"""Start prior of both: a cell's centre, looking to the right."""
_LONGEST = 700
_SLACK = 0.01
"""Of a probability: less than this counts for nothing."""


@dataclass(frozen=True, slots=True)
class Step:
    """Statements of both at the centre of a cell.

    Attributes
    ----------
    index : int
        0 = start cell, k = k-th cell entered.
    published, ours : (float, float)
        Probability of the true cell; and 1 if no other is as probable, 1/n if it is one of n, 0 otherwise.
    """

    __repr__ = short_repr

    index: int
    published: tuple[float, float]
    ours: tuple[float, float]


@dataclass(frozen=True, slots=True)
class LabTask:
    """Lab and runs to compare.

    Attributes
    ----------
    lab : str
    resolution : float
        Resolution of the fine lattice, in units.
    runs : int
        Start cells, drawn at random, none twice.
    parameters : str
    """

    __repr__ = short_repr

    lab: str
    resolution: float
    runs: int
    parameters: str = "seed"


@dataclass(frozen=True, slots=True)
class Compared:
    """The steps of the runs in a lab."""

    __repr__ = short_repr

    task: LabTask
    runs: tuple[tuple[Step, ...], ...]

    @property
    def steps(self) -> list[Step]:
        """Steps of all runs."""
        return [step for run in self.runs for step in run]

    def figures(self, who: str) -> tuple[float, float, float]:
        """Return mean probability of the true cell, that at the last steps, and how often it is the best."""
        last = [run[-1] for run in self.runs]
        return _mean(self.steps, who, 0), _mean(last, who, 0), _mean(self.steps, who, 1)

    @property
    def worse(self) -> bool:
        """Return whether the pose filter falls behind in one of the figures."""
        pairs = zip(self.figures("published"), self.figures("ours"), strict=True)
        return any(mine < theirs - _SLACK for theirs, mine in pairs)


def compare_with_published(tasks: Sequence[LabTask], *, jobs: int = 0) -> Iterator[Compared]:
    """Compare both methods in some labs.

    Parameters
    ----------
    tasks : sequence of LabTask
    jobs : int
        Processes; 0 = as many as there are cores.

    Yields
    ------
    Compared
        In the order of the tasks.
    """
    workers = min(jobs or processors(), len(tasks))
    if workers <= 1:
        yield from map(compare_in_lab, tasks)
        return
    with worker_processes(workers) as executor:
        yield from executor.map(compare_in_lab, tasks)


def compare_in_lab(task: LabTask) -> Compared:
    """Compare both methods in a lab."""
    lab = lab_of(task.lab)
    expected = compute_expected_readings(lab, RIGHT_ANGLES)
    parameters = dataclasses.replace(read_parameters(find_parameters(task.parameters)), sim_time=0)
    cells = np.argwhere(standable_cells(lab))
    chosen = np.random.default_rng(0).permutation(len(cells))[: task.runs]
    runs = (
        _run(task, expected, parameters, (int(cells[number][0]), int(cells[number][1])), seed)
        for seed, number in enumerate(chosen)
    )
    return Compared(task, tuple(run for run in runs if run))


def _run(
    task: LabTask, expected: ExpectedReadings, parameters: Parameters, start: Cell, seed: int
) -> tuple[Step, ...]:
    lab = lab_of(task.lab)
    x, y = (float(value) for value in cell_centres(lab)[start])
    grid = StartGrid(positions=(GridPosition(x=x, y=y),))
    simulation = Simulation(lab, grid, parameters, seed=seed)
    angles = tuple(enumerate(RIGHT_ANGLES))
    robot = simulation.register(RobotRegistration(name="judged", sensor_angles=angles))
    assert robot is not None
    controller = Controller(
        RunHeader(lab_name="", lab_sha256="", parameters=parameters, sensor_angles=RIGHT_ANGLES)
    )
    pose_filter = _pose_filter(task, lab, parameters)
    measures = simulation.launch()[robot]
    readings, beliefs, cells = [], [], []
    command: tuple[float, float] | None = None
    while simulation.time < _LONGEST and controller.phase is not Phase.HOLDING:
        pose_filter.observe(measures, command)
        cycle, actions = controller.observe(measures)
        if cycle.step is not None:
            pose = simulation.poses()[0]
            readings.append(cycle.readings or (None,) * len(RIGHT_ANGLES))
            beliefs.append(_cells(pose_filter, lab))
            # A strip that is too narrow for cells of its own belongs to the last ones.
            row, column = int(pose[1] // CELL_SIZE), int(pose[0] // CELL_SIZE)
            cells.append((min(row, lab.rows - 1), min(column, lab.columns - 1)))
        command = (0.0, 0.0) if actions is None else (actions.left_motor or 0.0, actions.right_motor or 0.0)
        measures = simulation.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
    published = localize(readings, expected, preset="seed").beliefs[1:]
    return tuple(
        Step(index, _score(theirs, cell), _score(mine, cell))
        for index, (theirs, mine, cell) in enumerate(zip(published, beliefs, cells, strict=True))
    )


def _pose_filter(task: LabTask, lab: Lab, parameters: Parameters) -> GridFilter:
    fine = tables_of(task.lab, RIGHT_ANGLES, task.resolution)
    if task.resolution >= COARSE:
        return GridFilter(lab, fine, parameters, start=PRIOR)
    coarse = tables_of(task.lab, RIGHT_ANGLES, COARSE)
    return staged_filter(lab, coarse, fine, parameters, start=PRIOR)


def _cells(pose_filter: GridFilter, lab: Lab) -> Floats:
    """Sum the belief up over headings and the squares of each cell; shape (rows, columns)."""
    belief = pose_filter.belief
    weights = np.bincount(belief.lattice.cell, belief.square_weights(), lab.rows * lab.columns)
    return np.asarray((weights / weights.sum()).reshape(lab.rows, lab.columns))


def _score(belief: Floats, truth: Cell) -> tuple[float, float]:
    equal = belief >= belief.max() * (1.0 - 1e-6)
    share = 1.0 / float(equal.sum()) if equal[truth] else 0.0
    return float(belief[truth]), share


def published_table(compared: Sequence[Compared]) -> str:
    """Return the comparison as a table, one line per lab, with a summary."""
    rows = [
        [
            "lab",
            "runs",
            "steps",
            *(f"{who} {what}" for what in ("P(true)", "last P", "best cell") for who in ("publ.", "our")),
            "less by 0.05",
            "verdict",
        ]
    ]
    for one in compared:
        name = plain("/".join(one.task.lab.removesuffix(".xml").split("/")[-2:]), MOST_NAME)
        if not one.runs:
            rows.append([name, "0", "0", *["-"] * 7, "no way to drive"])
            continue
        pairs = zip(one.figures("published"), one.figures("ours"), strict=True)
        rows.append(
            [
                name,
                str(len(one.runs)),
                str(len(one.steps)),
                *(f"{value:.3f}" for pair in pairs for value in pair),
                str(sum(step.ours[0] < step.published[0] - 0.05 for step in one.steps)),
                "WORSE" if one.worse else "no worse",
            ]
        )
    driven = [one for one in compared if one.runs]
    steps = [step for one in compared for step in one.steps]
    losses = [
        -sum(math.log2(max(getattr(step, who)[0], 1e-12)) for step in steps) / max(len(steps), 1)
        for who in ("published", "ours")
    ]
    return "\n".join(
        [
            aligned(rows),
            "P(true): mean probability of the true cell over all steps; last P: at the last step of a run;",
            "best cell: how often it is the true one, ties shared; less by 0.05: steps where ours gives the",
            f"true cell so much less. WORSE: by more than {_SLACK:g} in one of the three.",
            f"The pose filter is worse in {sum(one.worse for one in driven)} of {len(driven)} labs. "
            f"Log loss, bits a step: published {losses[0]:.3f}, ours {losses[1]:.3f}.",
        ]
    )


def _mean(steps: Sequence[Step], who: str, which: int) -> float:
    return float(np.mean([getattr(step, who)[which] for step in steps]))
