"""One cycle of a batch of few worlds, robot by robot: for less than some 30, numpy's calls cost more.

The functions are those of `simulator_stub.batch.arrays`, and so are the numbers, to the last bit.
"""

from __future__ import annotations

import math

from ciberrato.arrays import Floats, Integers
from ciberrato.geometry.angles import wrap_once
from ciberrato.infrared.exact import exact_distance, hangs_on_rounding
from ciberrato.infrared.model import SENSOR_OFFSET, distances_at, ideal_reading
from ciberrato.physics.kinematics import ROBOT_RADIUS, advance
from simulator_stub.batch.arrays import line
from simulator_stub.batch.plan import LabPlan
from simulator_stub.batch.state import BatchState
from simulator_stub.sensors.ground import NOWHERE

__all__ = ["line", "move", "sense"]


def move(lab: LabPlan, robots: Integers, state: BatchState, noise: Floats | None) -> None:
    """Apply the motors and move the robots, as `simulator_stub.batch.arrays.move`."""
    for robot in robots.tolist():
        right = (float(state.right_command[robot]) + float(state.right_output[robot])) / 2.0
        left = (float(state.left_command[robot]) + float(state.left_output[robot])) / 2.0
        if noise is not None:
            deviation = float(state.motor_deviation[robot])
            right *= 1.0 + deviation * float(noise[robot, 0])
            left *= 1.0 + deviation * float(noise[robot, 1])
        state.right_output[robot], state.left_output[robot] = right, left
        pose = float(state.x[robot]), float(state.y[robot]), float(state.heading[robot])
        x, y, heading = advance(*pose, left, right)
        collides = lab.world.walls.touches(x, y, ROBOT_RADIUS)
        moves = bool(state.moves[robot])
        begins = collides and moves and not state.collides[robot]
        state.collision_begins[robot] = begins
        state.collisions[robot] += begins
        state.collides[robot] = collides
        if moves:
            state.heading[robot] = heading
            if not collides:
                state.x[robot], state.y[robot] = x, y


def sense(
    lab: LabPlan,
    robots: Integers,
    state: BatchState,
    noise: tuple[Floats | None, Floats | None],
    out: tuple[Floats, Floats, Integers],
) -> None:
    """Read IR sensors, compasses and ground sensors, as `simulator_stub.batch.arrays.sense`."""
    angles = state.angles.tolist()
    targets = lab.targets.tolist()
    for robot in robots.tolist():
        x, y, heading = float(state.x[robot]), float(state.y[robot]), float(state.heading[robot])
        directions = [heading + angle for angle in angles]
        distances = distances_at(lab.world.walls, x, y, directions)
        deviation = float(state.obstacle_deviation[robot])
        if deviation == 0.0:
            for number, distance in enumerate(distances):
                if hangs_on_rounding(distance):
                    place = x, y, directions[number]
                    distances[number] = exact_distance(lab.world.walls, *place, SENSOR_OFFSET)
        draws = [0.0] * len(angles) if noise[0] is None else noise[0][robot].tolist()
        out[0][robot] = [
            math.floor(10.0 * (ideal_reading(distance) + deviation * draw) + 0.5) / 10.0
            for distance, draw in zip(distances, draws, strict=True)
        ]
        if noise[1] is not None:
            heading += float(state.compass_deviation[robot]) * float(noise[1][robot, 0])
        out[1][robot] = math.floor(wrap_once(heading) * 180.0 / math.pi + 0.5)
        found = NOWHERE
        for number, (target_x, target_y, reach) in enumerate(targets):
            if math.hypot(x - target_x, y - target_y) <= reach:
                found = number
        out[2][robot] = found
