"""The robots' sensors, one module each. A new sensor is a new module and a line in `SENSORS`."""

from __future__ import annotations

from simulator_stub.sensors.base import Delay, Scene, Sensor
from simulator_stub.sensors.beacons import BeaconSensors
from simulator_stub.sensors.collision import CollisionSensor
from simulator_stub.sensors.compass import CompassSensor
from simulator_stub.sensors.equipment import Equipment
from simulator_stub.sensors.gps import GpsSensor
from simulator_stub.sensors.ground import GroundSensor
from simulator_stub.sensors.hearing import Hearing
from simulator_stub.sensors.infrared import InfraredSensors
from simulator_stub.sensors.line import LineSensor
from simulator_stub.sensors.own import own_sensors, report_other
from simulator_stub.sensors.score import ScoreSensor

__all__ = ["SENSORS", "Delay", "Equipment", "Scene", "Sensor", "own_sensors", "report_other"]

SENSORS: tuple[type[Sensor], ...] = (
    CollisionSensor,
    CompassSensor,
    GroundSensor,
    InfraredSensors,
    BeaconSensors,
    GpsSensor,
    LineSensor,
    Hearing,
    ScoreSensor,
)
"""Sensors that every robot carries. The order does not matter: each has its own random numbers."""
