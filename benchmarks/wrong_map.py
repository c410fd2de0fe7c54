"""Frequency of the agent's alarm that the lab is wrong: in runs with the right one, and in runs with another.

``python -m benchmarks.wrong_map`` simulates drives to the right from cell centres, and holds each against its
own lab and against another (the published method, `agent.offline.map_fit`). ``--live`` does so with the pose
filter in the loop of ``explore`` (`ciberrato.localization.evidence.map_fit`). Starts, labs, noise and sensors
are drawn from the seed.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import sys
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agent.offline.expected_readings import ExpectedReadings, compute_expected_readings
from agent.offline.map_fit import map_fit
from ciberrato.evaluation.episode import ANGLES, RIGHT_ANGLES, lab_of, tables_of
from ciberrato.files.parameters import read_parameters
from ciberrato.files.run_records import RunHeader
from ciberrato.labs import find_parameters
from ciberrato.protocol import Actions, Measures, RobotRegistration
from ciberrato.world.coordinates import SensorAngles
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

LABS = ("standard", "maze", "corridors", "rooms")
"""Labs that ship, of one size, each unlike the others."""
NOISES = ("default", "harsh", "seed")
LONGEST = 600  # cycles of a drive to the right


class Outcome(NamedTuple):
    """Outcome of a run: its lab, the lab of the agent, the statistic, and whether it is an alarm."""

    world: str
    told: str
    level: float
    alarm: bool
    note: str


def main(argv: Sequence[str] | None = None) -> int:
    """Print the rates."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.wrong_map", description=__doc__.partition("\n")[0]
    )
    parser.add_argument("--runs", type=int, default=1000, help="of each kind; default: 1000")
    parser.add_argument("--live", action="store_true", help="with the pose filter while driving; minutes")
    parser.add_argument("--cycles", type=int, default=300, help="of a live run; default: 300")
    parser.add_argument("--first", type=int, default=0, help="first seed; default: 0")
    parser.add_argument("--show", action="store_true", help="print every run")
    options = parser.parse_args(argv)
    outcomes: list[Outcome] = []
    for seed in range(options.first, options.first + options.runs):
        new = live(seed, options.cycles) if options.live else published(seed)
        outcomes += new
        for outcome in new if options.show else ():
            print(seed, *outcome, flush=True)
    print(table(outcomes))
    return 0


def published(seed: int) -> list[Outcome]:
    """Drive to the right once, and hold the readings against the right lab and against another."""
    from agent.drives.right.controller import Controller

    generator = np.random.default_rng(seed)
    world, other = (LABS[number] for number in generator.choice(len(LABS), 2, replace=False))
    parameters = _parameters(generator)
    cells = np.argwhere(_expected(world, parameters.motors_noise, parameters.obstacle_noise).free)
    row, column = cells[generator.integers(len(cells))]
    simulation, robot = _world(
        world, (2.0 * column + 1.0, 2.0 * row + 1.0, 0.0), parameters, RIGHT_ANGLES, seed
    )
    header = RunHeader(lab_name="", lab_sha256="", parameters=parameters, sensor_angles=RIGHT_ANGLES)
    controller = Controller(header, exit_at_wall=True)
    steps: list[tuple[float | None, ...]] = []
    measures: Measures = simulation.launch()[robot]
    for _ in range(LONGEST):
        cycle, actions = controller.observe(measures)
        if cycle.step is not None:
            steps.append(cycle.readings or cycle.infrared)
        if controller.ended is not None:
            break
        measures = simulation.step({robot: actions or Actions()})[robot]
    outcomes = []
    for told in (world, other):
        expected = _expected(told, parameters.motors_noise, parameters.obstacle_noise)
        fit = map_fit(steps, expected, parameters.obstacle_noise)
        outcomes.append(Outcome(world, told, fit.score, fit.is_doubtful, f"{len(steps)} steps"))
    return outcomes


def live(seed: int, cycles: int) -> list[Outcome]:
    """Explore twice from one start, once with the right lab and once with another."""
    from agent.drives.registry import make_drive
    from ciberrato.localization.filtering.staged_filter import staged_filter
    from ciberrato.localization.tables.pose_tables import COARSE, FINE

    outcomes = []
    for is_right in (True, False):
        generator = np.random.default_rng(seed)
        world, other = (LABS[number] for number in generator.choice(len(LABS), 2, replace=False))
        told = world if is_right else other
        parameters = _parameters(generator)
        lattice = tables_of(world, ANGLES, COARSE).lattice
        place = generator.choice(np.flatnonzero(lattice.clearance >= 0.6))
        start = float(lattice.x[place]), float(lattice.y[place]), float(generator.uniform(-180.0, 180.0))
        simulation, robot = _world(world, start, parameters, ANGLES, seed)
        lab, coarse, fine = lab_of(told), tables_of(told, ANGLES, COARSE), tables_of(told, ANGLES, FINE)
        pose_filter = staged_filter(lab, coarse, fine, parameters)
        drive = make_drive("explore", lab, parameters, ANGLES)
        measures, command, claims = simulation.launch()[robot], None, 0
        for _ in range(cycles):
            pose_filter.observe(measures, command)
            claims += pose_filter.estimate().certain
            command = drive.decide(measures, pose_filter).command
            measures = simulation.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
        fit = pose_filter.map_fit
        assert fit is not None
        note = f"{claims} of {cycles} cycles claimed; doubted since {fit.since}"
        outcomes.append(Outcome(world, told, fit.worst, fit.since is not None, note))
    return outcomes


def table(outcomes: Sequence[Outcome]) -> str:
    """Tabulate alarms by whether the lab was the right one."""
    lines = [f"{'lab':8} {'runs':>6} {'alarms':>7} {'rate':>8}   statistic: median, 99 % / 1 %, most / least"]
    for is_right, name in ((True, "right"), (False, "wrong")):
        some = [outcome for outcome in outcomes if (outcome.world == outcome.told) is is_right]
        levels = np.sort([outcome.level for outcome in some])
        alarms = sum(outcome.alarm for outcome in some)
        tail = (np.quantile(levels, 0.99), levels[-1]) if is_right else (np.quantile(levels, 0.01), levels[0])
        lines.append(
            f"{name:8} {len(some):6} {alarms:7} {alarms / len(some):8.2%}   "
            f"{np.median(levels):.2f}, {tail[0]:.2f}, {tail[1]:.2f}"
        )
    return "\n".join(lines)


def _parameters(generator: np.random.Generator) -> Parameters:
    announced = read_parameters(find_parameters(str(generator.choice(NOISES))))
    compass = bool(generator.random() < 0.5)
    return dataclasses.replace(announced, compass_sensor=compass, gps=False, sim_time=0)


def _world(
    name: str, start: tuple[float, float, float], parameters: Parameters, angles: SensorAngles, seed: int
) -> tuple[Simulation, int]:
    grid = StartGrid(positions=(GridPosition(x=start[0], y=start[1], direction_deg=start[2]),))
    simulation = Simulation(lab_of(name), grid, parameters, seed=seed)
    robot = simulation.register(RobotRegistration(name="held", sensor_angles=tuple(enumerate(angles))))
    assert robot is not None
    return simulation, robot


@functools.cache
def _expected(lab: str, motors_noise: float, obstacle_noise: float) -> ExpectedReadings:
    parameters = Parameters(motors_noise=motors_noise, obstacle_noise=obstacle_noise)
    return compute_expected_readings(lab_of(lab), RIGHT_ANGLES, parameters)


if __name__ == "__main__":
    sys.exit(main())
