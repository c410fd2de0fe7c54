"""One robot as the simulator knows it: its pose, motors, LEDs, flags and score."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ciberrato.physics.kinematics import MAX_POWER, clamp_power
from ciberrato.protocol import Actions, RobotStatus
from ciberrato.protocol.limits import SAY_LIMIT
from ciberrato.world.lab import Beacon
from ciberrato.world.start_grid import GridPosition
from simulator_stub.world.robot_state import RobotState

if TYPE_CHECKING:
    from simulator_stub.world.noise import Stream


class Robot:
    """The mutable record of one robot.

    Attributes
    ----------
    robot_id : int
        Position number, from 1.
    name : str
    angles : tuple of four float
        Mounting angles of the IR sensors in degrees.
    beacons_known : tuple of Beacon
        Those that were there when it registered: it has a sensor for each.
    x, y, heading : float
        True pose, units and radians.
    wanted : (x, y, heading)
        Pose after the last running cycle if nothing had been in the way.
    left_command, right_command : float
        Motor commands after clamping; they stay until changed.
    left_output, right_output : float
        Noisy filtered motor powers of the last running cycle.
    end_led, returning_led, visiting_led : bool
        As last commanded.
    touches_wall, touches_robot : bool
        Whether a wall, or a robot, stopped it in the last running cycle.
    collided_before : bool
        Whether anything had stopped it in the running cycle before that.
    collisions : int
        Number of collisions that have begun.
    state, remembered_state : RobotState
        The current state, and the one that follows a pause.
    removal_requested : bool
    request_names : frozenset of str
        Names of all its sensors in SensorRequests.
    requests, requests_left : set of str, int
        Sensors requested in this cycle, within the limit, and the rest of the limit.
    said : str or None
        Text that the robot says in this cycle.
    received : set of str
        Motors and LEDs commanded in this cycle, by the names of the fields of `Actions`.
    motor_noise : Stream
    score, arrival_time, returning_time : int
        As the way of scoring keeps them.
    visited : set of int
        Numbers of the targets visited.
    """

    __slots__ = (
        "angles",
        "arrival_time",
        "beacons_known",
        "collided_before",
        "collisions",
        "end_led",
        "heading",
        "left_command",
        "left_output",
        "motor_noise",
        "name",
        "received",
        "remembered_state",
        "removal_requested",
        "request_names",
        "requests",
        "requests_left",
        "returning_led",
        "returning_time",
        "right_command",
        "right_output",
        "robot_id",
        "said",
        "score",
        "state",
        "touches_robot",
        "touches_wall",
        "visited",
        "visiting_led",
        "wanted",
        "x",
        "y",
    )

    def __init__(
        self,
        *,
        robot_id: int,
        name: str,
        angles: tuple[float, float, float, float],
        start: GridPosition,
        motor_noise: Stream,
        beacons_known: tuple[Beacon, ...] = (),
    ) -> None:
        self.robot_id = robot_id
        self.name = name
        self.angles = angles
        self.beacons_known = beacons_known
        self.x = start.x
        self.y = start.y
        self.heading = start.direction_deg * math.pi / 180.0
        self.wanted = (self.x, self.y, self.heading)
        self.left_command = 0.0
        self.right_command = 0.0
        self.left_output = 0.0
        self.right_output = 0.0
        self.end_led = False
        self.returning_led = False
        self.visiting_led = False
        self.touches_wall = False
        self.touches_robot = False
        self.collided_before = False
        self.collisions = 0
        self.state = RobotState.STOPPED
        self.remembered_state = RobotState.RUNNING
        self.removal_requested = False
        self.request_names: frozenset[str] = frozenset()
        self.motor_noise = motor_noise
        self.requests: set[str] = set()
        self.requests_left = 0
        self.said: str | None = None
        self.received: set[str] = set()
        self.score = 0
        self.arrival_time = 0
        self.returning_time = 0
        self.visited: set[int] = set()

    @property
    def heading_degrees(self) -> float:
        """True heading as views receive it."""
        return self.heading * 180.0 / math.pi

    @property
    def collides(self) -> bool:
        """Return whether anything stopped it in the last running cycle."""
        return self.touches_wall or self.touches_robot

    def visited_mask(self, targets: int) -> str:
        """Return one digit a target, 1 where it was visited."""
        if not self.visited:
            return "0" * targets
        return "".join("1" if number in self.visited else "0" for number in range(targets))

    def status(self, time: int, targets: int) -> RobotStatus:
        """Return what views are sent of it.

        Parameters
        ----------
        time : int
            Simulated cycles so far.
        targets : int
            Number of targets in the lab.
        """
        return RobotStatus(
            name=self.name,
            robot_id=self.robot_id,
            time=time,
            score=self.score,
            arrival_time=self.arrival_time,
            returning_time=self.returning_time,
            collisions=self.collisions,
            collision=self.collides,
            visited_mask=self.visited_mask(targets),
            state=self.state.value,
            x=self.x,
            y=self.y,
            direction_deg=self.heading_degrees,
        )

    def begin_cycle(self, request_limit: int) -> None:
        """Reset what lasts one cycle only."""
        self.requests.clear()
        self.requests_left = request_limit
        self.said = None
        self.received.clear()

    def apply(self, actions: Actions) -> None:
        """Apply one message of the robot; what it does not mention stays as it is."""
        left, right = actions.left_motor, actions.right_motor
        if left is not None:
            self.left_command = left if -MAX_POWER <= left <= MAX_POWER else _usable(left)
            self.received.add("left_motor")
        if right is not None:
            self.right_command = right if -MAX_POWER <= right <= MAX_POWER else _usable(right)
            self.received.add("right_motor")
        if actions.end_led is not None:
            self.end_led = actions.end_led
            self.received.add("end_led")
        if actions.returning_led is not None:
            self.returning_led = actions.returning_led
            self.received.add("returning_led")
        if actions.visiting_led is not None:
            self.visiting_led = actions.visiting_led
            self.received.add("visiting_led")
        for name in actions.requests:
            # Asking for what is sent anyway uses up a request; asking for what does not exist does not.
            if self.requests_left and name in self.request_names:
                self.requests_left -= 1
                self.requests.add(name)
        # An empty text, like one that is too long, leaves what was said before in the same cycle.
        if actions.say and len(actions.say) <= SAY_LIMIT:
            self.said = actions.say


def _usable(power: float) -> float:
    if math.isnan(power):
        raise ValueError("a motor command must be a number, not NaN")
    return clamp_power(power)
