"""The robots' sensors, one module each. A new sensor is a new module and a line in `SENSORS`."""

from __future__ import annotations

from simulator_stub.sensors.base import Delay, Scene, Sensor
from simulator_stub.sensors.collision import CollisionSensor
from simulator_stub.sensors.compass import CompassSensor
from simulator_stub.sensors.ground import GroundSensor
from simulator_stub.sensors.infrared import InfraredSensors
from simulator_stub.sensors.line import LineSensor

__all__ = ["SENSORS", "Delay", "Scene", "Sensor"]

SENSORS: tuple[type[Sensor], ...] = (
    CollisionSensor,
    CompassSensor,
    GroundSensor,
    InfraredSensors,
    LineSensor,
)
"""What every robot carries. The order does not matter: each has its own random numbers."""
