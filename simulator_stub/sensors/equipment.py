"""All sensors of one robot: from the readings of a cycle to the message that carries them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ciberrato.protocol import Measures, encode
from ciberrato.protocol.drafts import MeasuresDraft
from ciberrato.protocol.measures_text import usual_measures
from simulator_stub.sensors.base import Sensor
from simulator_stub.sensors.collision import CollisionSensor
from simulator_stub.sensors.compass import CompassSensor
from simulator_stub.sensors.ground import GroundSensor
from simulator_stub.sensors.hearing import Hearing
from simulator_stub.sensors.infrared import InfraredSensors
from simulator_stub.sensors.line import LineSensor
from simulator_stub.sensors.own import fill_in

if TYPE_CHECKING:
    from simulator_stub.world.robot import Robot

Buttons = tuple[bool, bool]

_USUAL = (CollisionSensor, CompassSensor, GroundSensor, InfraredSensors, LineSensor, Hearing)
"""The sensors of a robot by the default parameters: all of them are sent in every cycle."""


class Equipment:
    """The sensors of one robot.

    Parameters
    ----------
    sensors : sequence of Sensor
        Those that are absent, but can be requested, too.

    Attributes
    ----------
    sensors : tuple of Sensor
        Those that are present.
    updates : list of callable
        Their methods of that name, bound once.
    request_names : frozenset of str
        Names in SensorRequests.
    usual : (CollisionSensor, CompassSensor, GroundSensor, InfraredSensors, LineSensor, Hearing) or None
        The sensors, where they are just these, and each is sent in every cycle.
    """

    __slots__ = ("_reports", "request_names", "sensors", "updates", "usual")

    def __init__(self, sensors: Sequence[Sensor]) -> None:
        self.sensors = tuple(sensor for sensor in sensors if sensor.is_present)
        self.updates = [sensor.update for sensor in self.sensors]
        self._reports = [sensor.report for sensor in self.sensors]
        self.request_names = frozenset(name for sensor in sensors for name in sensor.request_names)
        by_kind: dict[type[Sensor], Any] = {type(sensor): sensor for sensor in self.sensors}
        self.usual: tuple[Any, ...] | None = None
        present = len(by_kind) == len(self.sensors) and by_kind.keys() == {*_USUAL}
        if present and all(sensor.sent_always for sensor in self.sensors):
            self.usual = tuple(by_kind[kind] for kind in _USUAL)

    def measures(self, robot: Robot, time: int, buttons: Buttons) -> Measures:
        """Return what the robot receives.

        Parameters
        ----------
        robot : Robot
        time : int
            Simulated cycles so far.
        buttons : (bool, bool)
            Start and Stop.
        """
        fields: dict[str, Any] = {}
        for report in self._reports:
            report(robot, fields)
        return _complete(robot, fields, time, buttons)

    def encoded(self, robot: Robot, time: int, buttons: Buttons) -> bytes:
        """Return the same as a datagram: ``encode(measures(...))``, to the byte, but sooner."""
        if self.usual is not None:
            collision, compass, ground, infrared, line, hearing = self.usual
            if not hearing.heard:
                data = usual_measures(
                    time, collision.reading, compass.reading, ground.reading, infrared.reading, line.reading,
                    (robot.end_led, robot.returning_led, robot.visiting_led, *buttons),
                )  # fmt: skip
                if data is not None:
                    return data
        return encode(self.measures(robot, time, buttons))

    def readings(self, robot: Robot, time: int, buttons: Buttons) -> Measures:
        """Return what the log holds: the last readings, requested or not, and the LEDs."""
        fields: dict[str, Any] = {}
        for sensor in self.sensors:
            sensor.record(fields)
        return _complete(robot, fields, time, buttons)


def _complete(robot: Robot, fields: dict[str, Any], time: int, buttons: Buttons) -> Measures:
    draft: Any = MeasuresDraft()
    draft.time = time
    draft.start, draft.stop = buttons
    draft.end_led = robot.end_led
    draft.returning_led = robot.returning_led
    draft.visiting_led = robot.visiting_led
    fill_in(draft, fields)
    measures: Measures = draft.finish()
    return measures
