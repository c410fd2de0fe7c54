"""Many simulations at once: a robot in each world, with a lab, parameters, a seed and a start of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.arrays import Booleans, Floats, Integers
from ciberrato.errors import UsageError
from ciberrato.protocol import DEFAULT_SENSOR_ANGLES
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from simulator_stub.batch import arrays, scalar
from simulator_stub.batch.arguments import (
    angles_of,
    for_each,
    led_states,
    motor_powers,
    numbers_of_worlds,
    poses_of,
    seeds_of,
    things_of,
    threads_of,
)
from simulator_stub.batch.other_sensors import beacons, gps
from simulator_stub.batch.plan import SENSORS, BatchPlan, LabPlan
from simulator_stub.batch.readings import BatchReadings
from simulator_stub.batch.scores import BatchScores, CircuitScores, TargetScores
from simulator_stub.batch.state import BatchState
from simulator_stub.batch.streams import BatchNoise
from simulator_stub.sensors.line import SIDEWAYS
from simulator_stub.world.noise import NoiseRoot

FEW = 32
"""Worlds below which they are stepped one by one, if not in machine code."""
_SCORES: dict[int, Callable[[BatchPlan], BatchScores]] = {0: TargetScores.empty, 1: CircuitScores.empty}
Group = tuple[LabPlan, Integers]
"""A lab and the worlds in it."""


@dataclass(frozen=True, slots=True)
class BatchSnapshot:
    """A moment of a batch, to go back to; made by `BatchSimulation.snapshot`."""

    owner: BatchPlan
    state: BatchState
    scores: BatchScores | None
    noise: BatchNoise
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
    seeds : sequence of int or numpy.random.Generator
        One for each world; of a generator, four numbers are drawn at once and none later.
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
        Readings of the last cycle; at first of time 0.

    Raises
    ------
    TypeError
        Something is of another kind: a name instead of a `Lab`, words instead of numbers.
    ValueError
        Shapes do not fit, a start is not finite or far away, parameters do not go together, the scoring mode
        is neither 0 nor 1, a seed is below 0, or there is to be less than one thread.
    UsageError
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
        seeds: Sequence[int | np.random.Generator],
        sensor_angles: tuple[float, float, float, float] = DEFAULT_SENSOR_ANGLES,
        line_sensor: bool = True,
        scoring: int | None = None,
        compiled: bool = False,
        threads: int | None = None,
        labs_to_come: Sequence[Lab] = (),
    ) -> None:
        roots = seeds_of(seeds)
        worlds = len(roots)
        poses_of(starts, worlds)
        labs = for_each(lab, Lab, worlds, "labs")
        rules = for_each(Parameters() if parameters is None else parameters, Parameters, worlds, "parameters")
        if scoring is not None and scoring not in tuple(_SCORES):
            raise ValueError(f"a batch counts scores of modes 0 and 1 only, not of {scoring!r:.60}")
        self._plan = BatchPlan.build(
            [*labs, *things_of(labs_to_come, Lab, "labs_to_come")],
            rules[0] if rules else Parameters(),
            worlds=worlds,
            angles=angles_of(sensor_angles),
            line_sensor=line_sensor,
        )
        self._kernels: Any = scalar if worlds < FEW else arrays
        if not isinstance(compiled, bool):
            raise TypeError(f"compiled: {compiled!r:.60} is neither True nor False")
        if compiled:
            self._kernels = _compiled_kernels(threads_of(threads))
        self._state = BatchState.empty(self._plan)
        self._scores = None if scoring is None else _SCORES[scoring](self._plan)
        self._noise = BatchNoise(self._plan)
        self._everything = np.arange(worlds)
        self.readings = BatchReadings.empty(self._plan, scored=scoring is not None)
        self._reset(self._everything, roots, starts, labs, rules)

    @property
    def worlds(self) -> int:
        """Return how many worlds there are."""
        return self._plan.worlds

    @property
    def time(self) -> Integers:
        """Return the simulated cycles so far in each world, shape (worlds,)."""
        return self._state.time.copy()

    @property
    def collisions(self) -> Integers:
        """Return how many collisions have begun in each world, shape (worlds,)."""
        return self._state.collisions.copy()

    @property
    def is_over(self) -> Booleans:
        """Return where SimTime has been reached, shape (worlds,): robots stand still, sensors go on."""
        return self._state.over

    @property
    def scores(self) -> BatchScores | None:
        """Return states and scores of the robots, to look at only; None if the batch counts none."""
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
        seeds: Sequence[int | np.random.Generator] | None = None,
        starts: ArrayLike | None = None,
        labs: Lab | Sequence[Lab] | None = None,
        parameters: Parameters | Sequence[Parameters] | None = None,
    ) -> BatchReadings:
        """Reset some worlds; the others are not affected.

        Parameters
        ----------
        worlds : array_like of bool, shape (worlds,), or of int; optional
            Mask or indices of n worlds; default: all.
        seeds : sequence of int or numpy.random.Generator, optional
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
        TypeError
            Something is of another kind.
        ValueError
            Shapes do not fit, a start is not finite or far away, a lab is not known, parameters do not go
            together, or there is no such world. Nothing is changed then.
        """
        which = self._everything if worlds is None else numbers_of_worlds(worlds, self.worlds)
        self._reset(which, None if seeds is None else seeds_of(seeds, which.size), starts, labs, parameters)
        return self.readings

    def _reset(
        self,
        which: Integers,
        roots: Sequence[NoiseRoot] | None,
        starts: ArrayLike | None,
        labs: Lab | Sequence[Lab] | None,
        parameters: Parameters | Sequence[Parameters] | None,
    ) -> None:
        count = which.size
        poses = self._state.start[which] if starts is None else poses_of(starts, count)
        chosen = (
            None
            if labs is None
            else [self._plan.number_of(lab) for lab in for_each(labs, Lab, count, "labs")]
        )
        rules = None if parameters is None else for_each(parameters, Parameters, count, "parameters")
        for one in dict.fromkeys(rules or ()):
            self._plan.check(one)
        if count:
            if chosen is not None:
                self._state.lab[which] = chosen
            if rules is not None:
                self._state.set_rules(which, rules)
            self._begin(which, poses, roots)

    def _begin(self, which: Integers, poses: Floats, roots: Sequence[NoiseRoot] | None) -> None:
        state = self._state
        state.begin(which, poses)
        self._noise.renew(which.tolist(), roots, state)
        if self._scores is not None:
            self._scores.begin(self._plan, state, which)
        # A run begins with two cycles in which time stands still: see `Simulation.launch`.
        self._measure(which)
        self.readings = self.readings.with_worlds(which, self._measure(which))

    # --- a cycle ------------------------------------------------------------------------------------------

    def step(self, commands: ArrayLike | None = None, leds: ArrayLike | None = None) -> BatchReadings:
        """Run one cycle in all worlds.

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
            lit = led_states(leds, self.worlds, scores is not None)
            if scores is not None:
                scores.leds[:] = lit
        if commands is not None:
            powers = motor_powers(commands, self.worlds)
            state.left_command, state.right_command = np.ascontiguousarray(powers.T)
        idle = state.over
        running = None if idle.any() else self._everything
        if running is None:
            running = np.flatnonzero(~idle)
            state.collision_begins[idle] = False
        state.time[running] += 1
        noise = self._noise.take("motors", running)
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
        noises = self._noise.take("infrared", running, idle), self._noise.take("compass", running, idle)
        for lab, some in groups:
            kernels.sense(lab, some, state, noises, (infrared, compass, ground))
        line = places = bearings = None
        if plan.line_sensor:
            line = np.empty((worlds, len(SIDEWAYS)), np.bool_)
            noise = self._noise.take("line", running, idle)
            for lab, some in groups:
                kernels.line(lab, some, state, noise, line)
        if plan.shared.gps:
            places = np.empty((worlds, 2))
            gps(robots, state, self._noise.take("gps", running, idle), places)
        if plan.shared.beacon_sensor:
            bearings = np.empty((worlds, plan.beacons))
            noise = self._noise.take("beacons", running, idle) if plan.beacons else None
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

    # --- going back ---------------------------------------------------------------------------------------

    def snapshot(self) -> BatchSnapshot:
        """Return a snapshot of everything, including the random numbers to come; cheap."""
        return BatchSnapshot(
            self._plan,
            self._state.copy(),
            None if self._scores is None else self._scores.copy(),
            self._noise.copy(),
            self.readings,
        )

    def restore(self, snapshot: BatchSnapshot) -> None:
        """Restore a snapshot of this batch; any number of times.

        Parameters
        ----------
        snapshot : BatchSnapshot

        Raises
        ------
        ValueError
            It is of another batch.
        """
        if getattr(snapshot, "owner", None) is not self._plan:
            raise ValueError("this is no snapshot of this batch")
        self._state = snapshot.state.copy()
        self._scores = None if snapshot.scores is None else snapshot.scores.copy()
        self._noise = snapshot.noise.copy()
        self.readings = snapshot.readings


def _compiled_kernels(threads: int) -> Any:
    try:
        from simulator_stub.batch.compiled import CompiledKernels
    except ImportError:
        raise UsageError("compiled=True needs numba: pip install 'ciberrato[fast]'") from None
    return CompiledKernels(threads)
