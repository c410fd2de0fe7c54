"""In process: steps a second in `maze` with four IR sensors, one world at a time and a thousand at once.

The reference is the same world in plain Python: motors, pose, collisions, and for each sensor three rays and
the corners, over all faces of the lab, with a random number drawn whenever one is needed. It has no messages,
no states, no score and no line sensor, which `Simulation` has. The batches are without line sensors, too.
"""

from __future__ import annotations

import importlib.util
import math
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from benchmarks.measure import Row, absent, best_time
from ciberrato.files.lab import read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.labs import find_lab
from ciberrato.physics.kinematics import ROBOT_RADIUS, advance, filter_power
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.batch import BatchSimulation
from simulator_stub.simulation import Simulation

GROUP = "a robot's step in maze, four IR sensors"
WORLDS = 1000
TARGETS = {"single": 1 / 30_000, "numpy": 1 / 100_000, "numba": 1 / 1_000_000}
"""Seconds a robot-step that were asked for."""

COMMANDS = ((0.15, 0.15), (0.15, 0.1), (0.1, 0.15), (0.12, 0.05), (-0.05, 0.1), (0.15, 0.15))
"""Motor powers, each for `HELD` cycles."""
HELD = 20
ANGLES = tuple(math.radians(angle) for angle in (0.0, 60.0, -60.0, 180.0))
NOISE = Parameters(sim_time=0)


def rows() -> Iterator[Row]:
    """Yield the rows of this benchmark."""
    lab = read_lab(find_lab("maze"))
    starts = free_starts(lab, WORLDS, np.random.default_rng(1))
    cycles = HELD * len(COMMANDS)
    seconds = best_time(lambda: plain_steps(lab, starts[0], cycles)) / cycles
    yield _row("plain Python, all faces", seconds, reference=True)
    seconds = single_seconds(lab, starts[0], compiled=False)
    yield _row("Simulation", seconds, target=TARGETS["single"])
    if importlib.util.find_spec("numba"):
        seconds = single_seconds(lab, starts[0], compiled=True)
        yield _row("Simulation, compiled", seconds, target=TARGETS["single"])
    yield from _batch_row(lab, starts[:1], "numpy", compiled=False)
    yield from _batch_row(lab, starts, "numpy", compiled=False)
    if importlib.util.find_spec("numba"):
        yield from _batch_row(lab, starts, "numba", compiled=True)
    else:
        yield from absent(GROUP, "BatchSimulation, 1000 worlds, numba", "ciberrato[fast]")


def _row(
    who: str, seconds: float, *, reference: bool = False, target: float | None = None, note: str = ""
) -> Row:
    speed = f"{1 / seconds:,.0f} robot-steps/s"
    return Row(
        group=GROUP,
        who=who,
        seconds=seconds,
        reference=reference,
        ours=not reference,
        target=target,
        note=f"{speed}{'; ' if note else ''}{note}",
    )


def free_starts(lab: Lab, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Draw poses where a robot touches nothing: x, y in units, direction in degrees."""
    walls = WallMap.from_lab(lab)
    poses = rng.uniform((0.5, 0.5, -180.0), (lab.width - 0.5, lab.height - 0.5, 180.0), (20 * count, 3))
    return poses[walls.distance(poses[:, 0], poses[:, 1]) >= ROBOT_RADIUS][:count]


def single_seconds(lab: Lab, start: NDArray[np.float64], *, compiled: bool) -> float:
    """Drive one robot; return the seconds of one step."""
    x, y, direction = (float(number) for number in start)
    grid = StartGrid(positions=(GridPosition(x=x, y=y, direction_deg=direction),))
    simulation = Simulation(lab, grid, NOISE, seed=1, compiled=compiled)
    robot = simulation.register(RobotRegistration(name="fast"))
    assert robot is not None
    simulation.launch()
    actions = [{robot: Actions(left_motor=left, right_motor=right)} for left, right in COMMANDS]

    def drive() -> None:
        for wanted in actions:
            for _ in range(HELD):
                simulation.step(wanted)

    for _ in range(10):  # so that what the lab's index keeps is there
        drive()
    return best_time(drive, budget=2.0, repeats=10) / (HELD * len(COMMANDS))


def _batch_row(lab: Lab, starts: NDArray[np.float64], name: str, *, compiled: bool) -> Iterator[Row]:
    worlds = len(starts)
    batch = BatchSimulation(
        lab, starts, NOISE, seeds=range(worlds), line_sensor=False, compiled=compiled, threads=1
    )
    powers = [np.broadcast_to(np.array(power), (worlds, 2)) for power in COMMANDS]

    def drive() -> None:
        for command in powers:
            for _ in range(HELD):
                batch.step(command)

    drive()
    cycles = HELD * len(COMMANDS)
    seconds = best_time(drive, budget=3.0, repeats=8) / cycles / worlds
    note = f"reading sensors {_share_of_sensors(batch, drive):.0%} of it"
    # One world in a batch need not be faster than one by itself, but not much slower either.
    target = TARGETS[name] if worlds > 1 else 2.0 * TARGETS["single"]
    yield _row(f"BatchSimulation, {worlds} worlds, {name}", seconds, target=target, note=note)


def _share_of_sensors(batch: BatchSimulation, drive: Callable[[], None]) -> float:
    """Drive once more, and return the share of the time that reading IR, compass and ground takes."""
    kernels = batch._kernels
    spent = 0.0

    def sense(*arguments: object) -> None:
        nonlocal spent
        began = time.perf_counter()
        kernels.sense(*arguments)
        spent += time.perf_counter() - began

    batch._kernels = SimpleNamespace(sense=sense, move=kernels.move, line=kernels.line)
    began = time.perf_counter()
    drive()
    total = time.perf_counter() - began
    batch._kernels = kernels
    return spent / total


def plain_steps(lab: Lab, start: NDArray[np.float64], cycles: int) -> list[list[float]]:
    """Drive in the plainest way that returns such readings; return those of the last cycle."""
    walls = WallMap.from_lab(lab)
    faces = np.column_stack((walls.start, walls.end)).tolist()
    generator = np.random.default_rng(1)
    x, y, heading = float(start[0]), float(start[1]), math.radians(float(start[2]))
    left = right = 0.0
    readings: list[list[float]] = []
    for cycle in range(cycles):
        wanted_left, wanted_right = COMMANDS[cycle // HELD % len(COMMANDS)]
        right = filter_power(wanted_right, right, 1.0 + 0.015 * generator.standard_normal())
        left = filter_power(wanted_left, left, 1.0 + 0.015 * generator.standard_normal())
        to_x, to_y, heading = advance(x, y, heading, left, right)
        if all(_distance(to_x, to_y, *face) >= ROBOT_RADIUS for face in faces):
            x, y = to_x, to_y
        readings = [
            [1.0 / _seen(faces, x, y, heading + angle) + 0.1 * generator.standard_normal()]
            for angle in ANGLES
        ]
    return readings


def _distance(x: float, y: float, x0: float, y0: float, x1: float, y1: float) -> float:
    ex, ey = x1 - x0, y1 - y0
    share = ((x - x0) * ex + (y - y0) * ey) / (ex * ex + ey * ey)
    share = min(max(share, 0.0), 1.0)
    return math.hypot(x - x0 - share * ex, y - y0 - share * ey)


def _seen(faces: list[list[float]], robot_x: float, robot_y: float, direction: float) -> float:
    cosine, sine = math.cos(direction), math.sin(direction)
    x, y = robot_x + 0.5 * cosine, robot_y + 0.5 * sine
    rays = [
        (math.cos(direction + turn), math.sin(direction + turn)) for turn in (0.0, math.pi / 6, -math.pi / 6)
    ]
    nearest = 1e3
    for x0, y0, x1, y1 in faces:
        dx, dy, ex, ey = x0 - x, y0 - y, x1 - x0, y1 - y0
        for ray_x, ray_y in rays:
            slope = ray_x * ey - ray_y * ex
            if slope != 0.0:
                along = (dx * ey - dy * ex) / slope
                share = (dx * ray_y - dy * ray_x) / slope
                if along > 0.0 and 0.0 <= share <= 1.0:
                    nearest = min(nearest, along)
        if abs(dy * cosine - dx * sine) <= math.tan(math.pi / 6) * (dx * cosine + dy * sine):
            nearest = min(nearest, math.hypot(dx, dy))
    return nearest
