"""Many simulations at once: a robot in each world, with a lab, parameters, a seed and a start of its own."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.arrays import Booleans, Floats, Integers
from ciberrato.physics.kinematics import MAX_POWER
from ciberrato.protocol import DEFAULT_SENSOR_ANGLES
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from simulator_stub.batch import arrays, scalar
from simulator_stub.batch.noise import BatchStream, IdleStream
from simulator_stub.batch.other_sensors import beacons, gps
from simulator_stub.batch.plan import SENSORS, BatchPlan, LabPlan
from simulator_stub.batch.readings import BatchReadings
from simulator_stub.batch.scores import BatchScores, CircuitScores, TargetScores
from simulator_stub.batch.state import BatchState
from simulator_stub.sensors.line import SIDEWAYS
from simulator_stub.simulation import GPS_OFFSET_RANGE
from simulator_stub.world.noise import NoiseRoot

FEW = 32
"""Worlds below which they are stepped one by one, if not in machine code."""
_SCORES: dict[int, Callable[[BatchPlan], BatchScores]] = {0: TargetScores.empty, 1: CircuitScores.empty}
_DEVIATIONS = {
    "motors": "motor_deviation",
    "infrared": "obstacle_deviation",
    "compass": "compass_deviation",
    "gps": "gps_deviation",
    "beacons": "beacon_deviation",
}
Group = tuple[LabPlan, Integers]
"""A lab and the worlds in it."""
Thing = TypeVar("Thing")


@dataclass(frozen=True, slots=True)
class BatchSnapshot:
    """A moment of a batch, to go back to; made by `BatchSimulation.snapshot`."""

    state: BatchState
    scores: BatchScores | None
    streams: dict[str, BatchStream]
    idle: dict[str, IdleStream]
    roots: tuple[NoiseRoot, ...]
    readings: BatchReadings


class BatchSimulation:
    """B independent worlds, each with one robot, stepped in one set of array operations.

    A world gives the same poses, readings and scores, to the last bit, as ``Simulation(lab, grid, parameters,
    seed, scoring)`` with the start as its only grid position, one robot registered, and `launch` called. What
    robots would ask for is always there; messages between robots and requests are not simulated.

    Parameters
    ----------
    lab : Lab or sequence of Lab
        One for all worlds, or one for each.
    starts : array_like, shape (worlds, 3)
        x, y in units and direction in degrees.
    parameters : Parameters or sequence of Parameters
        One for all worlds, or one for each; latencies, GPS and beacon sensors must be the same in all.
    seeds : sequence of int
        One for each world.
    sensor_angles : tuple of four float
        Mounting angles of the IR sensors in degrees.
    line_sensor : bool
        Whether the robots have line sensors; without, a cycle takes less time.
    scoring : int or None
        Scoring mode, 0 or 1; None: no scores, and no LEDs.
    compiled : bool
        Use machine code made by numba, the optional extra ``fast``; the results are the same.
    threads : int, optional
        At most so many work at a time, with `compiled`; default: one for each core. The results do not
        depend on it.
    labs_to_come : sequence of Lab
        Others that `reset` may put worlds into.

    Attributes
    ----------
    readings : BatchReadings
        Of the last cycle; at first of time 0.

    Raises
    ------
    ValueError
        Shapes do not fit, a start is not finite, parameters do not go together, or the scoring mode is
        neither 0 nor 1.
    ImportError
        numba is asked for and not installed.

    Examples
    --------
    >>> from ciberrato.files.lab import default_lab
    >>> batch = BatchSimulation(default_lab(), [(9.0, 3.0, 0.0)] * 3, seeds=[1, 2, 3])
    >>> readings = batch.step(np.full((3, 2), 0.1))
    >>> readings.time, readings.infrared.shape
    (array([1, 1, 1]), (3, 4))
    """

    def __init__(
        self,
        lab: Lab | Sequence[Lab],
        starts: ArrayLike,
        parameters: Parameters | Sequence[Parameters] | None = None,
        *,
        seeds: Sequence[int],
        sensor_angles: tuple[float, float, float, float] = DEFAULT_SENSOR_ANGLES,
        line_sensor: bool = True,
        scoring: int | None = None,
        compiled: bool = False,
        threads: int | None = None,
        labs_to_come: Sequence[Lab] = (),
    ) -> None:
        worlds = len(seeds)
        labs = _for_each(lab, Lab, worlds, "labs")
        rules = _for_each(parameters or Parameters(), Parameters, worlds, "parameters")
        if scoring is not None and scoring not in _SCORES:
            raise ValueError(f"a batch counts scores of modes 0 and 1 only, not of {scoring}")
        self._plan = BatchPlan.build(
            [*labs, *labs_to_come],
            rules[0] if rules else Parameters(),
            worlds=worlds,
            sensor_angles=sensor_angles,
            line_sensor=line_sensor,
        )
        self._kernels: Any = scalar if worlds < FEW else arrays
        if compiled:
            from simulator_stub.batch.compiled import CompiledKernels

            self._kernels = CompiledKernels(threads or os.cpu_count() or 1)
        self._state = BatchState.empty(self._plan)
        self._scores = None if scoring is None else _SCORES[scoring](self._plan)
        self._roots: list[NoiseRoot] = [NoiseRoot(())] * worlds
        self._streams: dict[str, BatchStream] = {}
        self._idle = {
            use: IdleStream(worlds, use, count, normal=normal) for use, count, normal in self._plan.uses()
        }
        self._everything = np.arange(worlds)
        self.readings = self._blank()
        self.reset(seeds=seeds, starts=starts, labs=labs, parameters=rules)

    @property
    def worlds(self) -> int:
        """How many worlds there are."""
        return self._plan.worlds

    @property
    def time(self) -> Integers:
        """Simulated cycles so far in each world, shape (worlds,)."""
        return self._state.time.copy()

    @property
    def collisions(self) -> Integers:
        """How many collisions have begun in each world, shape (worlds,)."""
        return self._state.collisions.copy()

    @property
    def is_over(self) -> Booleans:
        """Where SimTime has been reached, shape (worlds,): robots stand still, their sensors go on."""
        return self._state.over

    @property
    def scores(self) -> BatchScores | None:
        """States and scores of the robots, to look at only; None if the batch counts none."""
        return self._scores

    def poses(self) -> Floats:
        """Return the true poses.

        Returns
        -------
        array, shape (worlds, 3)
            x, y in units and heading in radians.
        """
        state = self._state
        return np.stack((state.x, state.y, state.heading), axis=-1)

    # --- beginning ---------------------------------------------------------------------------------------

    def reset(
        self,
        worlds: ArrayLike | None = None,
        *,
        seeds: Sequence[int] | None = None,
        starts: ArrayLike | None = None,
        labs: Lab | Sequence[Lab] | None = None,
        parameters: Parameters | Sequence[Parameters] | None = None,
    ) -> BatchReadings:
        """Let worlds begin anew; the others do not notice.

        Parameters
        ----------
        worlds : array_like of bool, shape (worlds,), or of int; optional
            Which ones, n of them; default: all.
        seeds : sequence of int, optional
            One for each of these; by default fresh random numbers follow from the seed that a world has.
        starts : array_like, shape (n, 3), optional
            x, y in units and direction in degrees; default: those they had.
        labs : Lab or sequence of Lab, optional
            One, or one for each; default: those they are in.
        parameters : Parameters or sequence of Parameters, optional
            One, or one for each; default: those they have.

        Returns
        -------
        BatchReadings
            Of all worlds; those that begin are at time 0.

        Raises
        ------
        ValueError
            Shapes do not fit, a start is not finite, a lab is not known, parameters do not go together, or
            there is no such world. Nothing is changed then.
        """
        which = self._which(worlds)
        count = which.size
        if seeds is not None and len(seeds) != count:
            raise ValueError(f"there must be {count} seeds, one for each world: {len(seeds)}")
        poses = self._state.start[which] if starts is None else np.array(starts, np.float64)
        if poses.shape != (count, 3):
            raise ValueError(f"starts must have the shape ({count}, 3), one for each seed: {poses.shape}")
        if not np.isfinite(poses).all():
            raise ValueError("starts must be finite")
        chosen = (
            None
            if labs is None
            else [self._plan.number_of(lab) for lab in _for_each(labs, Lab, count, "labs")]
        )
        rules = None if parameters is None else _for_each(parameters, Parameters, count, "parameters")
        for one in dict.fromkeys(rules or ()):
            self._plan.check(one)
        if count:
            if chosen is not None:
                self._state.lab[which] = chosen
            if rules is not None:
                self._set_rules(which, rules)
            self._begin(which, poses, seeds)
        return self.readings

    def _which(self, worlds: ArrayLike | None) -> Integers:
        if worlds is None:
            return self._everything
        chosen = np.asarray(worlds)
        if chosen.dtype == np.bool_:
            if chosen.shape != (self.worlds,):
                raise ValueError(f"a mask of worlds must have the shape ({self.worlds},): {chosen.shape}")
            return np.flatnonzero(chosen)
        numbers = chosen.reshape(-1).astype(np.int64)
        if ((numbers < 0) | (numbers >= self.worlds)).any() or np.unique(numbers).size < numbers.size:
            raise ValueError(f"worlds must be different numbers from 0 to {self.worlds - 1}")
        return numbers

    def _set_rules(self, which: Integers, rules: Sequence[Parameters]) -> None:
        state = self._state
        table = {
            "motor_deviation": [one.motors_noise / 100.0 for one in rules],
            "compass_deviation": [one.compass_noise * math.pi / 180.0 for one in rules],
            "obstacle_deviation": [one.obstacle_noise for one in rules],
            "gps_deviation": [one.gps_linear_noise for one in rules],
            "beacon_deviation": [one.beacon_noise * math.pi / 180.0 for one in rules],
            "beacon_aperture": [one.beacon_aperture for one in rules],
            "line_probability": [one.line_sensor_true_probability for one in rules],
            "sim_time": [one.sim_time for one in rules],
            "wall_penalty": [one.collision_wall_penalty for one in rules],
        }
        for name, values in table.items():
            getattr(state, name)[which] = values

    def _begin(self, which: Integers, poses: Floats, seeds: Sequence[int] | None) -> None:
        state, worlds = self._state, which.tolist()
        for place, world in enumerate(worlds):
            self._roots[world] = (
                self._roots[world].next_world()
                if seeds is None
                else NoiseRoot.from_generator(np.random.default_rng(seeds[place]))
            )
        state.start[which] = poses
        state.x[which], state.y[which] = poses[:, 0], poses[:, 1]
        state.heading[which] = poses[:, 2] * math.pi / 180.0
        for array in (state.left_command, state.right_command, state.left_output, state.right_output):
            array[which] = 0.0
        state.time[which] = state.collisions[which] = 0
        state.collides[which] = state.collision_begins[which] = False
        state.moves[which] = True
        state.forget_late_readings(which)
        self._renew_noise(worlds)
        if self._scores is not None:
            self._scores.begin(self._plan, state, which)
        # A run begins with two cycles in which time stands still: see `Simulation.launch`.
        self._measure(which)
        self._take_over(self._measure(which), which)

    def _renew_noise(self, worlds: list[int]) -> None:
        roots = [self._roots[world] for world in worlds]
        for use, count, normal in self._plan.uses():
            counts = self._counts(use, count)
            renewed = [counts[world] for world in worlds]
            self._idle[use].renew(worlds, roots, renewed)
            if use in self._streams:
                self._streams[use].renew(worlds, roots, renewed)
            elif self._has_noise(use):
                self._streams[use] = BatchStream(self._roots, use, count, normal=normal, counts=counts)
        if self._plan.shared.gps:
            for world, root in zip(worlds, roots, strict=True):
                draw = root.generator(0, "gps offset").random
                offset = (GPS_OFFSET_RANGE * float(draw()), GPS_OFFSET_RANGE * float(draw()))
                self._state.gps_offset[world] = offset

    def _counts(self, use: str, count: int) -> list[int]:
        """How many numbers a cycle each world draws; only beacons are not the same number everywhere."""
        if use != "beacons":
            return [count] * self.worlds
        there = [len(lab.world.lab.beacons) for lab in self._plan.labs]
        return [there[lab] for lab in self._state.lab.tolist()]

    def _has_noise(self, use: str) -> bool:
        """Whether anything is to be drawn; what draws nothing changes no other stream."""
        if use == "line":
            return bool((self._state.line_probability < 1.0).any())
        return bool((getattr(self._state, _DEVIATIONS[use]) > 0.0).any())

    # --- a cycle ------------------------------------------------------------------------------------------

    def step(self, commands: ArrayLike | None = None, leds: ArrayLike | None = None) -> BatchReadings:
        """Do one cycle in all worlds.

        Parameters
        ----------
        commands : array_like, shape (worlds, 2), or None
            Powers of the left and right motors; clamped. None: those of the cycle before stay.
        leds : array_like of bool, shape (worlds, 3), or None
            EndLed, ReturningLed and VisitingLed; None: they stay as they are.

        Returns
        -------
        BatchReadings

        Raises
        ------
        ValueError
            A shape does not fit, a command is not a number, or LEDs are told to a batch without scores.
        """
        state, scores = self._state, self._scores
        if leds is not None:
            lit = np.asarray(leds, np.bool_)
            if scores is None:
                raise ValueError("LEDs have no meaning without scores: BatchSimulation(..., scoring=0)")
            if lit.shape != (self.worlds, 3):
                raise ValueError(f"leds must have the shape ({self.worlds}, 3): {lit.shape}")
            scores.leds[:] = lit
        if commands is not None:
            powers = np.clip(np.asarray(commands, np.float64), -MAX_POWER, MAX_POWER)
            if powers.shape != (self.worlds, 2):
                raise ValueError(f"commands must have the shape ({self.worlds}, 2): {powers.shape}")
            if np.isnan(powers).any():
                raise ValueError("a motor command must be a number, not NaN")
            state.left_command, state.right_command = np.ascontiguousarray(powers.T)
        idle = state.over
        running = None if idle.any() else self._everything
        if running is None:
            running = np.flatnonzero(~idle)
            state.collision_begins[idle] = False
        state.time[running] += 1
        noise = self._noise("motors", running, None)
        for lab, robots in self._groups(running):
            self._kernels.move(lab, robots, state, noise)
        readings = self._measure(None, running)
        if scores is not None:
            scores.count(self._plan, state, ~idle, leds is not None)
            scores.change_states(self._plan, state)
            state.moves = ~scores.finished
            readings = replace(readings, score=scores.score.copy())
        self.readings = readings
        return readings

    def _groups(self, robots: Integers) -> Iterable[Group]:
        """Sort worlds by their labs."""
        if len(self._plan.labs) == 1:
            return [(self._plan.labs[0], robots)] if robots.size else []
        labs = self._state.lab[robots]
        groups = ((lab, robots[labs == number]) for number, lab in enumerate(self._plan.labs))
        return [(lab, some) for lab, some in groups if some.size]

    def _noise(self, use: str, running: Integers, idle: Integers | None) -> Floats | None:
        """Draw the numbers of a cycle, shape (worlds, numbers); None where none are needed."""
        stream = self._streams.get(use)
        if stream is None:
            return None
        if idle is None or not idle.size:
            return stream.take()
        numbers = stream.take().copy() if running.size else self._empty_noise(use)
        numbers[idle] = self._idle[use].take(idle)
        return numbers

    def _empty_noise(self, use: str) -> Floats:
        return np.zeros((self.worlds, {name: count for name, count, _ in self._plan.uses()}[use]))

    def _measure(self, only: Integers | None, running: Integers | None = None) -> BatchReadings:
        """Read all sensors, of all worlds or of some in which time stands still."""
        plan, state, kernels = self._plan, self._state, self._kernels
        robots = self._everything if only is None else only
        running = self._everything[:0] if running is None else running
        idle = only
        if only is None:
            idle = np.setdiff1d(robots, running) if running.size < self.worlds else None
        groups = list(self._groups(robots))
        worlds = self.worlds
        infrared, compass = np.empty((worlds, SENSORS)), np.empty(worlds)
        ground = np.empty(worlds, np.int64)
        noises = self._noise("infrared", running, idle), self._noise("compass", running, idle)
        for lab, some in groups:
            kernels.sense(lab, some, state, noises, (infrared, compass, ground))
        line = places = bearings = None
        if plan.line_sensor:
            line = np.empty((worlds, len(SIDEWAYS)), np.bool_)
            noise = self._noise("line", running, idle)
            for lab, some in groups:
                kernels.line(lab, some, state, noise, line)
        if plan.shared.gps:
            places = np.empty((worlds, 2))
            gps(robots, state, self._noise("gps", running, idle), places)
        if plan.shared.beacon_sensor:
            bearings = np.empty((worlds, plan.beacons))
            noise = self._noise("beacons", running, idle) if plan.beacons else None
            for lab, some in groups:
                beacons(lab, some, state, noise, bearings)
            bearings = state.delay("beacons", bearings, only)
        return BatchReadings(
            time=state.time.copy(),
            over=state.over,
            infrared=state.delay("infrared", infrared, only),
            compass=state.delay("compass", compass, only),
            ground=state.delay("ground", ground, only),
            collision=state.delay("collision", state.collides.copy(), only),
            line=line,
            gps=places,
            beacons=bearings,
            score=None if self._scores is None else self._scores.score.copy(),
        )

    def _blank(self) -> BatchReadings:
        worlds, plan = self.worlds, self._plan
        return BatchReadings(
            time=np.zeros(worlds, np.int64),
            over=np.zeros(worlds, np.bool_),
            infrared=np.zeros((worlds, SENSORS)),
            compass=np.zeros(worlds),
            ground=np.zeros(worlds, np.int64),
            collision=np.zeros(worlds, np.bool_),
            line=np.zeros((worlds, len(SIDEWAYS)), np.bool_) if plan.line_sensor else None,
            gps=np.zeros((worlds, 2)) if plan.shared.gps else None,
            beacons=np.zeros((worlds, plan.beacons)) if plan.shared.beacon_sensor else None,
            score=None if self._scores is None else np.zeros(worlds, np.int64),
        )

    def _take_over(self, fresh: BatchReadings, which: Integers) -> None:
        """Put readings of some worlds beside those that the others have."""
        changed: dict[str, Any] = {}
        for name in BatchReadings.__slots__:
            old, new = getattr(self.readings, name), getattr(fresh, name)
            if old is not None:
                changed[name] = old.copy()
                changed[name][which] = new[which]
        self.readings = replace(self.readings, **changed)

    # --- going back ---------------------------------------------------------------------------------------

    def snapshot(self) -> BatchSnapshot:
        """Take down everything, random numbers to come included; cheap."""
        return BatchSnapshot(
            self._state.copy(),
            None if self._scores is None else self._scores.copy(),
            {use: stream.copy() for use, stream in self._streams.items()},
            {use: stream.copy() for use, stream in self._idle.items()},
            tuple(self._roots),
            self.readings,
        )

    def restore(self, snapshot: BatchSnapshot) -> None:
        """Go back to a moment of this batch, as often as wanted.

        Parameters
        ----------
        snapshot : BatchSnapshot
        """
        self._state = snapshot.state.copy()
        self._scores = None if snapshot.scores is None else snapshot.scores.copy()
        self._streams = {use: stream.copy() for use, stream in snapshot.streams.items()}
        self._idle = {use: stream.copy() for use, stream in snapshot.idle.items()}
        self._roots = list(snapshot.roots)
        self.readings = snapshot.readings


def _for_each(things: Any, kind: type[Thing], count: int, what: str) -> list[Thing]:
    """Repeat one thing, or check that there are as many as worlds."""
    if isinstance(things, kind):
        return [things] * count
    listed = list(things)
    if len(listed) != count:
        raise ValueError(f"{what}: {len(listed)} for {count} worlds; give one, or one for each")
    return listed
