"""Simulation parameters: the record that the simulator announces and that parameter files hold."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from ciberrato.world.fields import (
    check_noise,
    check_number,
    check_probability,
    check_switch,
    check_text,
    check_whole,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameters:
    """Every parameter of a simulation, with the built-in defaults of the real simulator.

    Attributes
    ----------
    sim_time : int
        Length of a run in cycles; 0 means without limit.
    cycle_time : int
        Milliseconds a cycle.
    key_time : int
        Cycles; announced, without effect.
    compass_noise, beacon_noise : float
        Standard deviation in degrees.
    obstacle_noise : float
        Standard deviation of an IR reading, in units of 1/distance.
    motors_noise : float
        Standard deviation of the motor factor, in percent.
    gps, beacon_sensor, compass_sensor, score_sensor : bool
        Whether the sensor is there at all.
    gps_linear_noise : float
        Standard deviation in units of length.
    gps_direction_noise : float
        Standard deviation in degrees; the direction is never sent.
    line_sensor_true_probability : float
        Probability that an element of the line sensor is right; never announced.
    requests_per_cycle : int
        Number of requestable sensors that a robot may ask for in one cycle.
    obstacle_requestable, beacon_requestable, ground_requestable : bool
    compass_requestable, collision_requestable : bool
        Whether the sensor is sent only when asked for.
    obstacle_latency, beacon_latency, ground_latency, compass_latency, collision_latency : int
        Age of the delivered reading in cycles.
    beacon_aperture : float
        Half angle in radians.
    return_time_penalty, arrival_time_penalty, target_reward, home_reward : int
        Announced, without effect on the scores.
    collision_wall_penalty, collision_robot_penalty : int
        Points a collision.
    lab_file, grid_file : str or None
        Names of the files, announced when they were given.
    """

    sim_time: int = 1800
    cycle_time: int = 50
    key_time: int = 1350
    compass_noise: float = 2.0
    beacon_noise: float = 2.0
    obstacle_noise: float = 0.1
    motors_noise: float = 1.5
    gps: bool = False
    gps_linear_noise: float = 0.5
    gps_direction_noise: float = 5.0
    line_sensor_true_probability: float = 0.98
    beacon_sensor: bool = False
    compass_sensor: bool = True
    score_sensor: bool = False
    show_actions: bool = True
    requests_per_cycle: int = 0
    obstacle_requestable: bool = False
    beacon_requestable: bool = False
    ground_requestable: bool = False
    compass_requestable: bool = False
    collision_requestable: bool = False
    obstacle_latency: int = 0
    beacon_latency: int = 0
    ground_latency: int = 0
    compass_latency: int = 0
    collision_latency: int = 0
    beacon_aperture: float = math.pi
    return_time_penalty: int = 25
    arrival_time_penalty: int = 100
    collision_wall_penalty: int = 2
    collision_robot_penalty: int = 2
    target_reward: int = 100
    home_reward: int = 100
    lab_file: str | None = None
    grid_file: str | None = None

    def __post_init__(self) -> None:
        for field in fields(self):
            name, value = field.name, getattr(self, field.name)
            if field.type == "float":
                noise, probability = name.endswith("_noise"), name.endswith("_probability")
                (check_noise if noise else check_probability if probability else check_number)(name, value)
            elif field.type == "int":
                check_whole(name, value)
            elif field.type == "bool":
                check_switch(name, value)
            elif value is not None:
                check_text(name, value)

    def __repr__(self) -> str:
        default = {field.name: field.default for field in fields(self)}
        other = [
            f"{name}={getattr(self, name)!r:.40}" for name in default if getattr(self, name) != default[name]
        ]
        shown = ", ".join(other[:4])
        return f"Parameters({shown}{f', ... {len(other)} in all' if len(other) > 4 else ''})"
