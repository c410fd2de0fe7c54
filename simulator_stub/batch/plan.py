"""What stays the same in a batch: the lab, the rules, and what follows from them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ciberrato.infrared.face_tables import LabTables, tables_of
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid
from simulator_stub.world.world import World


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchPlan:
    """The lab and the parameters, in the units that the loops need.

    Attributes
    ----------
    world : World
    tables : LabTables
    worlds : int
    angles : tuple of four float
        Mounting angles of the IR sensors in radians.
    motor_deviation, compass_deviation, obstacle_deviation : float
        Of the factor on the power, of the heading in radians, of the reading.
    line_sensor : bool
        Whether the robots have line sensors.
    targets : array, shape (targets, 3)
        x, y, and how far the centre of a robot may be from it; units.
    """

    world: World
    tables: LabTables
    worlds: int
    angles: tuple[float, ...]
    motor_deviation: float
    compass_deviation: float
    obstacle_deviation: float
    line_sensor: bool
    targets: NDArray[np.float64]

    @classmethod
    def build(
        cls,
        lab: Lab,
        parameters: Parameters,
        *,
        worlds: int,
        sensor_angles: tuple[float, float, float, float],
        line_sensor: bool,
    ) -> BatchPlan:
        """Work out the rest."""
        lab_world = World.build(lab, StartGrid(), parameters)
        return cls(
            world=lab_world,
            tables=tables_of(lab_world.walls),
            worlds=worlds,
            angles=tuple(angle / 180.0 * math.pi for angle in sensor_angles),
            motor_deviation=parameters.motors_noise / 100.0,
            compass_deviation=parameters.compass_noise * math.pi / 180.0,
            obstacle_deviation=parameters.obstacle_noise,
            line_sensor=line_sensor,
            targets=np.array(
                [(target.x, target.y, target.radius - ROBOT_RADIUS) for target in lab.targets]
            ).reshape(-1, 3),
        )
