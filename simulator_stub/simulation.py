"""The simulation itself: no clock, no socket, no thread.

One cycle is ``step(actions)``: it depends on nothing but the simulation's state, the actions, what was
registered and commanded since the last cycle, and the random numbers that follow from the seed. The shells
around it (`simulator_stub.service`) turn datagrams and time into such calls.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ciberrato.protocol import (
    DEFAULT_SENSOR_ANGLES,
    Acceptance,
    Actions,
    Measures,
    RobotBeaconRegistration,
    RobotRegistration,
    RobotStatus,
)
from ciberrato.world.coordinates import SensorAngles
from ciberrato.world.lab import Beacon, Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid
from simulator_stub.compiled_cycle import CompiledCycle
from simulator_stub.robot_transitions import next_state
from simulator_stub.scoring import SCORINGS, Scoring, find_scoring
from simulator_stub.sensors import SENSORS, Equipment, Scene, Sensor, own_sensors
from simulator_stub.world.commands import Wanted, messages_of, robot_of
from simulator_stub.world.motion import move
from simulator_stub.world.noise import NoiseRoot, Stream
from simulator_stub.world.robot import Robot
from simulator_stub.world.robot_state import MOVING, RobotState
from simulator_stub.world.simulator_state import SimulatorEvent, SimulatorState, SimulatorStateMachine
from simulator_stub.world.world import World

NAMELESS = "(null)"
"""Name of a robot that registered without one."""

GPS_OFFSET_RANGE = 1000.0
"""Units: the GPS adds something from 0 to this to x, and to y."""


class Simulation:
    """A lab with robots in it.

    Parameters
    ----------
    lab : Lab
    grid : StartGrid
        Robot n starts on position n, counted from 1.
    parameters : Parameters
    seed : int or numpy.random.Generator
        Everything random follows from it; of a generator, four numbers are drawn at once and none later.
    scoring : int, str or type
        Scoring mode: its number, or one that others wrote, by the name of its entry point
        (``ciberrato.scoring``), by ``module:Class``, or its class.
    sensors : sequence of type or str
        Sensors that others wrote and every robot carries, too: classes, names of entry points
        (``ciberrato.sensors``) or ``module:Class``.
    compiled : bool
        Move and measure in machine code made by numba, the optional extra ``fast``; the results are the same
        to the last bit.

    Attributes
    ----------
    time : int
        Simulated cycles so far.
    gps_offset : (float, float)
        Offset of every GPS in x and y, in units: drawn when a world begins; may be set before the robots
        drive.
    robots : tuple of Robot
        Robots in order of their ids, removed ones too: the live records, not to be changed.
    state : SimulatorState
        State of the simulator in the coming call of `step`.
    worlds : int
        Number of worlds that have begun: at first, and after each `reset` and `restart`.

    Examples
    --------
    >>> from ciberrato.files.start_grid import default_grid
    >>> from ciberrato.files.lab import default_lab
    >>> simulation = Simulation(default_lab(), default_grid(), seed=7)
    >>> robot = simulation.register(RobotRegistration(name="santos"))
    >>> simulation.launch()[robot].time
    0
    >>> measures = simulation.step({robot: Actions(left_motor=0.1, right_motor=0.1)})
    >>> measures[robot].time
    1
    """

    def __init__(
        self,
        lab: Lab,
        grid: StartGrid,
        parameters: Parameters | None = None,
        seed: int | np.random.Generator = 0,
        scoring: int | str | type[Scoring] = 0,
        *,
        sensors: Sequence[type[Sensor] | str] = (),
        compiled: bool = False,
    ) -> None:
        self.world = World.build(lab, grid, parameters, compiled=compiled)
        self.scoring: Scoring = find_scoring(scoring, SCORINGS)(self.world)
        self._kinds = (*SENSORS, *own_sensors(sensors, [sensor.name for sensor in SENSORS]))
        self._noise = NoiseRoot.from_seed(seed)
        self.worlds = 0
        self._compiled = CompiledCycle(self.world) if compiled else None
        self._machine, self.state = SimulatorStateMachine(), SimulatorState.READY
        self._robots: dict[int, Robot] = {}
        self.robots: tuple[Robot, ...] = ()
        self._present: list[Robot] = []
        self._written = False
        self._equipment: dict[int, Equipment] = {}
        self._carried_beacon: Beacon | None = None
        self._begin_world()

    def _begin_world(self) -> None:
        self.time = 0
        self.worlds += 1
        self.restart_requested = False
        self.scoring = type(self.scoring)(self.world)
        draw = self._noise.generator(0, "gps offset").random
        self.gps_offset = (GPS_OFFSET_RANGE * float(draw()), GPS_OFFSET_RANGE * float(draw()))

    # --- what is in it ---------------------------------------------------------------------------

    def poses(self) -> NDArray[np.float64]:
        """Return the true poses.

        Returns
        -------
        array of shape (robots, 3)
            x, y in units and heading in radians; rows in order of the robots' ids.
        """
        return np.array([(robot.x, robot.y, robot.heading) for robot in self.robots]).reshape(-1, 3)

    def acceptance(self) -> Acceptance:
        """Return what clients receive when they register."""
        return Acceptance(parameters=self.world.parameters, n_beacons=len(self.world.lab.beacons))

    def lab_shown(self) -> Lab:
        """Return the lab as views and logs get it: with the beacon that a robot carries, if there is one."""
        return replace(self.world.lab, beacons=self._beacons())

    # --- what others want of it, between cycles -----------------------------------------------------

    def register(self, registration: RobotRegistration | RobotBeaconRegistration) -> int | None:
        """Register a robot on its start position.

        A robot that carries a beacon is taken only where there is no beacon yet. As in the real simulator its
        beacon stays at (0, 0) wherever the robot goes, and only robots that register later have a sensor for
        it.

        Returns
        -------
        int or None
            Its position number, or None if it is refused: there is no such position, it is taken (also by a
            removed robot), the grid is full, or the simulator is running.
        """
        if not self._machine.registrations_open:
            return None
        if isinstance(registration, RobotBeaconRegistration) and self._beacons():
            return None
        wanted = registration.robot_id
        places = range(1, len(self.world.grid.positions) + 1)
        free = [place for place in places if place not in self._robots]
        robot_id = wanted if wanted > 0 else (free[0] if free else 0)
        if robot_id not in free:
            return None
        self._robots[robot_id] = self._make_robot(
            robot_id,
            NAMELESS if registration.name is None else registration.name,
            registration.angles if isinstance(registration, RobotRegistration) else DEFAULT_SENSOR_ANGLES,
            self._beacons(),
        )
        if isinstance(registration, RobotBeaconRegistration):
            self._carried_beacon = Beacon(height=registration.height)
        self._robots = dict(sorted(self._robots.items()))
        self.robots = tuple(self._robots.values())
        self.note_client()
        return robot_id

    def _beacons(self) -> tuple[Beacon, ...]:
        carried = self._carried_beacon
        return self.world.lab.beacons if carried is None else (*self.world.lab.beacons, carried)

    def _make_robot(
        self, robot_id: int, name: str, angles: SensorAngles, beacons: tuple[Beacon, ...]
    ) -> Robot:
        robot = Robot(
            robot_id=robot_id,
            name=name,
            angles=angles,
            start=self.world.grid.positions[robot_id - 1],
            motor_noise=Stream(self._noise, robot_id, "motors", running=True),
            beacons_known=beacons,
        )
        sensors = [sensor(self.world, robot, self._noise) for sensor in self._kinds]
        equipment = self._equipment[robot_id] = Equipment(sensors)
        robot.request_names = equipment.request_names
        return robot

    def note_client(self) -> None:
        """Register that a robot or a view was accepted: the first one makes the simulator leave Ready."""
        self._machine.handle(SimulatorEvent.CLIENT_ACCEPTED)

    def start(self) -> None:
        """Start, or go on: time passes from the next cycle on. Has an effect only while stopped."""
        self._machine.handle(SimulatorEvent.START)

    def stop(self) -> None:
        """Pause after the coming cycle. Counts only while running."""
        self._machine.handle(SimulatorEvent.STOP)

    def remove(self, robot_id: int) -> None:
        """Remove a robot from the world at the end of the coming cycle; unknown ids are ignored."""
        if robot_id in self._robots:
            self._robots[robot_id].removal_requested = True

    def place(self, robot_id: int, x: float, y: float, heading: float) -> None:
        """Move a robot by hand; its wheels go on as they were.

        Parameters
        ----------
        robot_id : int
        x, y, heading : float
            Units and radians.

        Raises
        ------
        UnknownRobotError
            There is no robot of that id. A KeyError, too.
        """
        robot = robot_of(self._robots, robot_id)
        if not all(math.isfinite(value) for value in (x, y, heading)):
            raise ValueError(f"x, y, heading: {(x, y, heading)!r:.60} are not finite numbers")
        robot.x, robot.y, robot.heading = x, y, heading
        robot.wanted = (x, y, heading)

    def reset(self, seed: int | np.random.Generator | None = None) -> None:
        """Reset: forget all robots and begin again, at once.

        Parameters
        ----------
        seed : int or numpy.random.Generator, optional
            As for a new simulation; by default fresh random numbers follow from the seed that it has.
        """
        self._noise = self._noise.next_world() if seed is None else NoiseRoot.from_seed(seed)
        self._machine, self.state = SimulatorStateMachine(), SimulatorState.READY
        self._robots, self.robots = {}, ()
        self._equipment = {}
        self._carried_beacon = None
        self._begin_world()

    def restart(self) -> None:
        """Restart with the present robots, at once; the current cycle is the one that starts.

        The robots are put back on their start positions as if they had just registered, motors and LEDs off;
        those that were removed stay so. Random numbers are fresh ones of the same seed.
        """
        self._noise = self._noise.next_world()
        self._begin_world()
        for robot_id, robot in self._robots.items():
            fresh = self._make_robot(robot_id, robot.name, robot.angles, robot.beacons_known)
            fresh.removal_requested = robot.removal_requested
            if robot.state is RobotState.REMOVED:
                fresh.state = RobotState.REMOVED
            self._robots[robot_id] = fresh
        self.robots = tuple(self._robots.values())
        self._machine, self.state = SimulatorStateMachine(SimulatorState.STOPPED), SimulatorState.STOPPED
        self.start()

    # --- a cycle -----------------------------------------------------------------------------------

    def step(self, actions: Mapping[int, Wanted] | None = None) -> dict[int, Measures]:
        """Run one cycle.

        Parameters
        ----------
        actions : mapping of int to Actions, iterable of Actions or (float, float), optional
            Commands by robot id; several messages of one robot are applied in order. Two numbers are left
            and right motor command in units per cycle.

        Returns
        -------
        dict of int to Measures
            For each robot that is not removed, in order of the ids.

        Raises
        ------
        TypeError, UnknownRobotError
            The actions are none of these; there is no robot of that id. Nothing has changed then.
        """
        if actions is not None and not isinstance(actions, Mapping):
            raise TypeError(f"actions: {actions!r:.60} is not a mapping of robots' ids to what they want")
        messages = {robot_id: messages_of(robot_id, wanted) for robot_id, wanted in (actions or {}).items()}
        for robot_id in messages:
            robot_of(self._robots, robot_id)
        self.begin_cycle()
        for robot_id, wanted in messages.items():
            for message in wanted:
                self.act(robot_id, message)
        if self.restart_requested:
            self.restart()
        measures = self.advance()
        self.end_cycle()
        return measures

    def launch(self) -> dict[int, Measures]:
        """Run the two cycles with which every run begins, once the robots are registered.

        The first leaves Ready, the second reads Start.

        Returns
        -------
        dict of int to Measures
            Of the second cycle: time 0, the Start button on. The next `step` is a running one.
        """
        self.step()
        self.start()
        return self.step()

    # The four parts of a cycle, for those who have something to do between them.

    def begin_cycle(self) -> None:
        """Reset what lasts one cycle only."""
        self.restart_requested = False
        limit = self.world.parameters.requests_per_cycle
        for robot in self.robots:
            robot.begin_cycle(limit)

    def act(self, robot_id: int, actions: Actions) -> None:
        """Apply one message of a robot.

        If it asks for the world to begin again, that is left to the caller (`restart`) when all messages of
        the cycle are applied; see `restart_requested`. `step` does it.
        """
        robot_of(self._robots, robot_id).apply(actions)
        self.restart_requested |= actions.reset

    def advance(self) -> dict[int, Measures]:
        """Advance the time if the simulator is running; measure in any case."""
        self._run()
        buttons, equipment = self._machine.buttons, self._equipment
        return {
            one.robot_id: equipment[one.robot_id].measures(one, self.time, buttons) for one in self._present
        }

    def advance_encoded(self) -> dict[int, bytes]:
        """Do the same as `advance`, and return the messages as they are sent."""
        self._run()
        if self._written and self._compiled is not None:
            return self._compiled.datagrams()
        buttons, equipment = self._machine.buttons, self._equipment
        return {
            one.robot_id: equipment[one.robot_id].encoded(one, self.time, buttons) for one in self._present
        }

    def _run(self) -> None:
        present = self._present = [robot for robot in self.robots if robot.state is not RobotState.REMOVED]
        speakers = [robot for robot in self.robots if robot.said is not None]
        running = self.state is SimulatorState.RUNNING
        self.time += running
        compiled = self._compiled if running else None
        self._written = compiled is not None and compiled.run(
            present, self._equipment, speakers, self.time, self._machine.buttons
        )
        if not self._written:
            scene = Scene(present, self.time, running, speakers, self.gps_offset)
            if running:
                move(self.world, present)
            for robot in present:
                for update in self._equipment[robot.robot_id].updates:
                    update(robot, scene)
        if running:
            for robot in present:
                if robot.state in MOVING:
                    self.scoring.update(robot, self.time, present)

    def statuses(self) -> tuple[RobotStatus, ...]:
        """Return what views receive; between `advance` and `end_cycle`, as states change only then."""
        targets = len(self.world.lab.targets)
        return tuple(robot.status(self.time, targets) for robot in self.robots)

    def end_cycle(self) -> None:
        """Change states: first the simulator's, then the robots'."""
        limit = self.world.parameters.sim_time
        if 0 < limit <= self.time:
            self._machine.handle(SimulatorEvent.TIME_UP)
        self._machine.close_cycle()
        state = self.state = self._machine.current
        for robot in self.robots:
            before = robot.state
            after = next_state(robot, state, self.scoring)
            if after is before:
                continue
            robot.state = after
            if after is RobotState.STOPPED:
                robot.remembered_state = before
            if before is RobotState.STOPPED and after is RobotState.RUNNING and self.time == 0:
                self.scoring.begin(robot)

    def readings(self, robot: Robot, *, over: bool = False) -> Measures:
        """Return what the log holds: the last readings, requested or not, and the LEDs.

        Parameters
        ----------
        robot : Robot
        over : bool
            Whether the time is over, so that both buttons are off.
        """
        measures = self._equipment[robot.robot_id].readings(robot, self.time, self._machine.buttons)
        return replace(measures, start=False, stop=False) if over else measures
