"""The names that Python agents of the course import from their ``croblink.py``, on this project's client.

An agent runs after changing one import::

    from ciberrato.croblink import *

It goes on as it was, and gains: a port behind the host (``host:7000``), the newest Measures where it was too
slow for older ones (`CRobLink.lost` and `CRobLink.skipped` count what it did not see), messages that say
what happened when no simulator answers, and a log of the run where ``CIBERRATO_LOG`` names a file.

Agents in any language also run unmodified, with their own file: this module is a convenience.
"""

from __future__ import annotations

import math
import os
import select
import socket
import sys
import time
from collections.abc import Iterable
from typing import Any

from ciberrato.client.core import RobotCore
from ciberrato.client.pace import Pace
from ciberrato.client.run_recorder import RunRecorder
from ciberrato.errors import ProtocolError
from ciberrato.net.address import DEFAULT_PORT, answers_for, parse_address, resolve
from ciberrato.protocol import Acceptance, Actions, Measures, Refusal, decode_simulator_message, encode
from ciberrato.protocol.order import MessageOrder, News

__all__ = [
    "NUM_IR_SENSORS",
    "NUM_LINE_ELEMENTS",
    "UDP_IP",
    "UDP_PORT",
    "CMeasures",
    "CParameters",
    "CRobLink",
    "CRobLinkAngs",
]

NUM_IR_SENSORS = 4
NUM_LINE_ELEMENTS = 7
UDP_IP = "127.0.0.1"
UDP_PORT = DEFAULT_PORT
LOG_VARIABLE = "CIBERRATO_LOG"

_SECONDS = 2.0
_REFUSAL_PATIENCE = 0.5
"""Seconds that an acceptance may still come after a refusal, which can be anybody's."""
_MOST = 65535


class CParameters:
    """Parameters of the simulation that agents read.

    Attributes
    ----------
    nBeacons, simTime : int
    """

    def __init__(self, acceptance: Acceptance) -> None:
        self.nBeacons = acceptance.n_beacons
        self.simTime = acceptance.parameters.sim_time
        self.parameters = acceptance.parameters


class CMeasures:
    """The readings of a cycle, under the names that agents use; values before any message.

    A sensor that did not come keeps its initial value, with its ``...Ready`` False.

    Attributes
    ----------
    time : int
        Cycles.
    compass, dir : float
        Degrees.
    x, y : float
        GPS, units.
    irSensor : list of 4 float
        About 1/distance.
    beacon : list of (bool, float)
        Visible, and degrees from the robot's heading; one a beacon.
    ground : int
        Number of the target that the robot is in, or -1.
    lineSensor : list of 7 str
        "0" or "1", leftmost first.
    hearMessage : str
        Message of another robot, the last of several.
    start, stop, endLed, returningLed, visitingLed, collision : bool
    score, arrivalTime, returningTime, collisions : int
    """

    def __init__(self) -> None:
        self.compassReady, self.compass = False, 0.0
        self.irSensorReady = [False] * NUM_IR_SENSORS
        self.irSensor = [0.0] * NUM_IR_SENSORS
        self.beaconReady: list[bool] = []
        self.beacon: list[tuple[bool, float]] = []
        self.time = 0
        self.groundReady, self.ground = False, -1
        self.collisionReady, self.collision = False, False
        self.lineSensorReady, self.lineSensor = False, ["0"] * NUM_LINE_ELEMENTS
        self.start = self.stop = False
        self.endLed = self.returningLed = self.visitingLed = False
        self.gpsReady, self.gpsDirReady = False, False
        self.x = self.y = self.dir = 0.0
        self.scoreReady, self.score = False, 100000
        self.arrivalTimeReady, self.arrivalTime = False, 10000
        self.returningTimeReady, self.returningTime = False, 10000
        self.collisionsReady, self.collisions = False, 0
        self.hearMessage = ""

    @classmethod
    def from_measures(cls, measures: Measures, *, n_beacons: int = 0, own_id: int = 0) -> CMeasures:
        """Return the readings of one message.

        Parameters
        ----------
        measures : Measures
        n_beacons : int
            Length of `beacon`.
        own_id : int
            The robot's position number, whose own words are not heard.
        """
        taken = cls()
        taken.time, taken.start, taken.stop = measures.time, measures.start, measures.stop
        taken.endLed, taken.returningLed = measures.end_led, measures.returning_led
        taken.visitingLed = measures.visiting_led
        taken._set("compass", measures.compass)
        taken._set("ground", measures.ground)
        taken._set("collision", measures.collision)
        taken._set("lineSensor", None if measures.line is None else list(measures.line))
        for sensor, value in enumerate(measures.infrared):
            if value is not None:
                taken.irSensorReady[sensor], taken.irSensor[sensor] = True, value
        length = max([n_beacons, *(one.beacon + 1 for one in measures.beacons)])
        taken.beaconReady, taken.beacon = [False] * length, [(False, 0.0)] * length
        for one in measures.beacons:
            taken.beaconReady[one.beacon] = True
            taken.beacon[one.beacon] = (one.bearing is not None, one.bearing or 0.0)
        if measures.gps is not None:
            taken.gpsReady, (taken.x, taken.y) = True, measures.gps
        if measures.score is not None:
            taken._set("score", measures.score.score)
            taken._set("arrivalTime", measures.score.arrival_time)
            taken._set("returningTime", measures.score.returning_time)
            taken._set("collisions", measures.score.collisions)
        for heard in measures.messages:
            if heard.sender != own_id:
                taken.hearMessage = heard.text
        return taken

    def _set(self, name: str, value: object) -> None:
        if value is not None:
            setattr(self, name, value)
            setattr(self, f"{name}Ready", True)


class CRobLink:
    """A robot's link to the simulator, as agents of the course use it.

    Parameters
    ----------
    robName : str
    robId : int
        Position in the start grid, from 1; 0 = the first free one.
    host : str
        HOST[:PORT].
    port : int
        The simulator's main port where `host` names none.

    Attributes
    ----------
    status : int
        0 = accepted, -1 = refused.
    port : int
        The simulator's port for this robot.
    sock : socket.socket
    measures : CMeasures
        Measures of the last call of `readSensors`.
    lost, skipped : int
        Simulated cycles whose Measures never came; Measures that newer ones had overtaken.

    Raises
    ------
    TimeoutError
        If no simulator answers within 2 s; it is the same as ``socket.timeout``.
    """

    def __init__(self, robName: str, robId: int, host: str = UDP_IP, port: int = UDP_PORT) -> None:
        self._register(robName, robId, None, host, port)

    def _register(
        self, name: str, robot_id: int, angles: Iterable[float] | None, host: str, port: int
    ) -> None:
        self.robName, self.robId, self.host = name, int(robot_id), host
        self.angs = None if angles is None else list(angles)
        self.measures = CMeasures()
        self.lost = self.skipped = 0
        self._unanswered: Measures | None = None
        self._moving = False
        self._core = RobotCore(name, position=self.robId, angles=self.angs)
        self._recorder = RunRecorder(os.environ.get(LOG_VARIABLE) or None, None)
        self._place = resolve(*parse_address(host, port))
        self.sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sock.sendto(encode(self._core.registration), self._place)
        answer = self._find_answer()
        self.sock.settimeout(_SECONDS)
        if answer is None:
            self.status = -1
            return
        self.status = 0
        self._order = MessageOrder(answer.parameters.sim_time)
        self._pace = Pace(answer.parameters.cycle_time, lockstep=answer.lockstep)
        self.params = CParameters(answer)
        self.nBeacons, self.simTime = self.params.nBeacons, self.params.simTime
        self._core.accept(answer)
        self._recorder.begin(self._core)

    def _find_answer(self) -> Acceptance | None:
        """Wait for the answer to the registration; None if it is a refusal."""
        end, refused, odd = time.monotonic() + _SECONDS, False, False
        while (left := end - time.monotonic()) > 0.0:
            self.sock.settimeout(left)
            try:
                data, (host, port) = self.sock.recvfrom(_MOST)
            except (TimeoutError, ConnectionError):
                continue
            if not answers_for(host, self._place[0]):
                continue
            try:
                answer = decode_simulator_message(data)
            except ProtocolError:
                odd = True
                continue
            if isinstance(answer, Acceptance):
                self.port = port
                return answer
            odd |= not isinstance(answer, Refusal)
            if isinstance(answer, Refusal) and not refused:
                refused, end = True, min(end, time.monotonic() + _REFUSAL_PATIENCE)
        if refused:
            return None
        self.sock.close()
        if odd:
            raise ProtocolError("the simulator has not answered the registration with a Reply")
        raise TimeoutError(
            f"no simulator has answered at {self._place[0]}:{self._place[1]} in {_SECONDS:g} s: start "
            "one (ciberrato-simulator), or check host and port"
        )

    def readSensors(self) -> None:
        """Wait for Measures and set `measures`: the newest, if several are there.

        Raises
        ------
        SystemExit
            If none come within 2 s: with status 0 if the run's time is up, with 1 otherwise.
        """
        for measures in (found := self._receive()):
            self.lost += max(measures.time - max(self.measures.time, 0) - 1, 0)
            self.measures = CMeasures.from_measures(measures, n_beacons=self.nBeacons, own_id=self.robId)
        self.skipped += len(found) - 1
        self._unanswered = found[-1]
        self.status = 0

    def syncRobot(self) -> None:
        """Send an empty message, for simulators that wait for one per cycle."""
        self._send(Actions())

    def driveMotors(self, lPow: float, rPow: float) -> None:
        """Send motor commands, in units per cycle."""
        self._send(Actions(left_motor=float(lPow), right_motor=float(rPow)))

    def setReturningLed(self, val: bool) -> None:
        """Switch the Returning LED; motors 0, as ever."""
        self._send(Actions(left_motor=0.0, right_motor=0.0, returning_led=bool(val)))

    def setVisitingLed(self, val: bool) -> None:
        """Switch the Visiting LED; motors 0, as ever."""
        self._send(Actions(left_motor=0.0, right_motor=0.0, visiting_led=bool(val)))

    def finish(self) -> None:
        """Switch the End LED on; motors 0, as ever."""
        self._send(Actions(left_motor=0.0, right_motor=0.0, end_led=True))

    # The other spelling that is met.
    read_sensors = readSensors
    sync_robot = syncRobot
    drive_motors = driveMotors
    set_returning_led = setReturningLed
    set_visiting_led = setVisitingLed

    @property
    def rob_name(self) -> str:
        """The robot's name."""
        return self.robName

    @property
    def rob_id(self) -> int:
        """The robot's position."""
        return self.robId

    def _receive(self) -> list[Measures]:
        found: list[Measures] = []
        end = time.monotonic() + _SECONDS
        while not found or select.select((self.sock,), (), (), 0.0)[0]:
            try:
                data, sender = self._next_datagram(end)
            except (TimeoutError, ConnectionError):
                if found:
                    break
                if time.monotonic() < end:
                    continue  # refused: no simulator there just now
                if 0 < self.simTime <= self.measures.time:
                    print(f"{self.robName}: the run is over (time {self.measures.time})", file=sys.stderr)
                    sys.exit(0)
                print(
                    f"{self.robName}: no Measures from the simulator for {_SECONDS:g} s (last time "
                    f"{self.measures.time}): it was ended or reset; ending, too",
                    file=sys.stderr,
                )
                sys.exit(1)
            if sender[1] != self.port:
                continue
            try:
                message = decode_simulator_message(data)
            except ProtocolError:  # one broken message must not end the agent
                continue
            if not isinstance(message, Measures):
                continue
            news = self._order.judge(message)
            if news is News.BEGUN_AGAIN:  # as ever, the agent goes on in the new run
                self._order = MessageOrder(self.simTime)
                news = self._order.judge(message)
            if news is News.FRESH:
                found.append(message)
                if message.start:
                    self._pace.heard(time.monotonic(), message.time)
        return found

    def _next_datagram(self, end: float) -> tuple[bytes, tuple[str, int]]:
        """Wait for a datagram, and stop a robot that would go on blindly meanwhile."""
        patience = self._pace.patience if self._moving else math.inf
        while True:
            left = end - time.monotonic()
            if left <= 0.0:
                raise TimeoutError
            self.sock.settimeout(min(left, patience))
            try:
                data, sender = self.sock.recvfrom(_MOST)
            except TimeoutError:
                if self._moving or patience < math.inf:
                    self.sock.sendto(encode(Actions(left_motor=0.0, right_motor=0.0)), self._simulator)
                    self._moving, patience = False, self._pace.seconds
            else:
                return data, sender

    def _send(self, actions: Actions) -> None:
        if self._unanswered is not None and actions.left_motor is not None:
            # A line a cycle: the first command that was sent in it.
            self._recorder.record(self._unanswered, actions)
            self._unanswered = None
        if actions.left_motor is not None:
            self._moving = (actions.left_motor, actions.right_motor) != (0.0, 0.0)
        self.sock.sendto(encode(actions), self._simulator)

    @property
    def _simulator(self) -> tuple[str, int]:
        return self._place[0], self.port


class CRobLinkAngs(CRobLink):
    """The same with the mounting angles of the IR sensors.

    Parameters
    ----------
    robName : str
    robId : int
    angs : sequence of four float
        Degrees, counter-clockwise from the front.
    host : str
        HOST[:PORT].
    port : int
        The simulator's main port where `host` names none.
    """

    def __init__(self, robName: str, robId: int, angs: Any, host: str = UDP_IP, port: int = UDP_PORT) -> None:
        self._register(robName, robId, angs, host, port)
