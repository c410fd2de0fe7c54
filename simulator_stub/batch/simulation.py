"""Many simulations at once: the same lab, a robot in each world, other seeds and starts."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ciberrato.arrays import Floats
from ciberrato.physics.kinematics import MAX_POWER
from ciberrato.protocol import DEFAULT_SENSOR_ANGLES
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from simulator_stub.batch import arrays
from simulator_stub.batch.noise import BatchStream
from simulator_stub.batch.plan import BatchPlan
from simulator_stub.batch.readings import BatchReadings
from simulator_stub.batch.state import BatchState
from simulator_stub.sensors.ground import NOWHERE
from simulator_stub.sensors.infrared import SENSORS
from simulator_stub.sensors.line import SIDEWAYS
from simulator_stub.world.noise import NoiseRoot


@dataclass(frozen=True, slots=True)
class BatchSnapshot:
    """A moment of a batch, to go back to; made by `BatchSimulation.snapshot`."""

    state: BatchState
    streams: dict[tuple[str, bool], BatchStream]
    readings: BatchReadings


class BatchSimulation:
    """B independent worlds, each with one robot, stepped in one set of array operations.

    A world gives the same poses and readings, to the last bit, as ``Simulation(lab, grid, parameters, seed)``
    with the start as its only grid position, one robot registered, and `launch` called. What robots would ask
    for is always there; scores, GPS, beacon sensors, messages and LEDs are not simulated.

    Parameters
    ----------
    lab : Lab
    starts : array_like, shape (worlds, 3)
        x, y in units and direction in degrees.
    parameters : Parameters
    seeds : sequence of int
        One for each world.
    sensor_angles : tuple of four float
        Mounting angles of the IR sensors in degrees.
    line_sensor : bool
        Whether the robots have line sensors; without, a cycle takes less time.
    compiled : bool
        Use machine code made by numba, the optional extra ``fast``; the results are the same.

    Attributes
    ----------
    readings : BatchReadings
        Of the last cycle; at first of time 0.

    Raises
    ------
    ValueError
        Shapes do not fit, or a start is not finite.
    ImportError
        numba is asked for and not installed.

    Examples
    --------
    >>> from ciberrato.files.lab import default_lab
    >>> batch = BatchSimulation(default_lab(), [(9.0, 3.0, 0.0)] * 3, seeds=[1, 2, 3])
    >>> readings = batch.step(np.full((3, 2), 0.1))
    >>> readings.time, readings.infrared.shape
    (1, (3, 4))
    """

    def __init__(
        self,
        lab: Lab,
        starts: ArrayLike,
        parameters: Parameters | None = None,
        *,
        seeds: Sequence[int],
        sensor_angles: tuple[float, float, float, float] = DEFAULT_SENSOR_ANGLES,
        line_sensor: bool = True,
        compiled: bool = False,
    ) -> None:
        poses = np.array(starts, np.float64)
        if poses.shape != (len(seeds), 3):
            raise ValueError(
                f"starts must have the shape ({len(seeds)}, 3), one for each seed: {poses.shape}"
            )
        if not np.isfinite(poses).all():
            raise ValueError("starts must be finite")
        parameters = parameters or Parameters()
        self._plan = BatchPlan.build(
            lab, parameters, worlds=len(seeds), sensor_angles=sensor_angles, line_sensor=line_sensor
        )
        self._kernels: Any = arrays
        if compiled:
            from simulator_stub.batch import compiled as kernels

            self._kernels = kernels
        self._state = _initial_state(poses, parameters)
        self._streams = _streams(self._plan, seeds)
        self._measure(running=False)
        self.readings = self._measure(running=False)

    @property
    def worlds(self) -> int:
        """How many worlds there are."""
        return self._plan.worlds

    @property
    def time(self) -> int:
        """Simulated cycles so far, the same in all worlds."""
        return self._state.time

    @property
    def collisions(self) -> NDArray[np.int64]:
        """How many collisions have begun in each world, shape (worlds,)."""
        return self._state.collisions.copy()

    @property
    def is_over(self) -> bool:
        """Return whether SimTime has been reached: robots stand still from then on, their sensors go on."""
        return 0 < self._plan.world.parameters.sim_time <= self._state.time

    def poses(self) -> Floats:
        """Return the true poses.

        Returns
        -------
        array, shape (worlds, 3)
            x, y in units and heading in radians.
        """
        state = self._state
        return np.stack((state.x, state.y, state.heading), axis=-1)

    def step(self, commands: ArrayLike | None = None) -> BatchReadings:
        """Do one cycle in all worlds.

        Parameters
        ----------
        commands : array_like, shape (worlds, 2), or None
            Powers of the left and right motors; clamped. None: those of the cycle before stay.

        Returns
        -------
        BatchReadings

        Raises
        ------
        ValueError
            The shape does not fit, or a command is not a number.
        """
        state = self._state
        if commands is not None:
            powers = np.clip(np.asarray(commands, np.float64), -MAX_POWER, MAX_POWER)
            if powers.shape != (self.worlds, 2):
                raise ValueError(f"commands must have the shape ({self.worlds}, 2): {powers.shape}")
            if np.isnan(powers).any():
                raise ValueError("a motor command must be a number, not NaN")
            state.left_command, state.right_command = np.ascontiguousarray(powers.T)
        running = not self.is_over
        if running:
            state.time += 1
            self._kernels.move(self._plan, state, self._noise("motors", running=True))
        self.readings = self._measure(running=running)
        return self.readings

    def snapshot(self) -> BatchSnapshot:
        """Take down everything, random numbers to come included; cheap."""
        streams = {use: stream.copy() for use, stream in self._streams.items()}
        return BatchSnapshot(self._state.copy(), streams, self.readings)

    def restore(self, snapshot: BatchSnapshot) -> None:
        """Go back to a moment of this batch, as often as wanted.

        Parameters
        ----------
        snapshot : BatchSnapshot
        """
        self._state = snapshot.state.copy()
        self._streams = {use: stream.copy() for use, stream in snapshot.streams.items()}
        self.readings = snapshot.readings

    def _noise(self, use: str, *, running: bool) -> Floats | None:
        stream = self._streams.get((use, running))
        return None if stream is None else stream.take()

    def _measure(self, *, running: bool) -> BatchReadings:
        plan, state, kernels = self._plan, self._state, self._kernels
        infrared = kernels.infrared(plan, state, self._noise("infrared", running=running))
        compass = kernels.compass(plan, state, self._noise("compass", running=running))
        line = None
        if plan.line_sensor:
            line = kernels.line(plan, state, self._noise("line", running=running))
        return BatchReadings(
            time=state.time,
            infrared=state.delay("infrared", infrared),
            compass=state.delay("compass", compass),
            ground=state.delay("ground", kernels.ground(plan, state)),
            collision=state.delay("collision", state.collides.copy()),
            line=line,
        )


def _initial_state(poses: Floats, parameters: Parameters) -> BatchState:
    worlds = len(poses)
    empty: dict[str, tuple[int, NDArray[Any]]] = {
        "infrared": (parameters.obstacle_latency, np.zeros((worlds, SENSORS))),
        "compass": (parameters.compass_latency, np.zeros(worlds)),
        "ground": (parameters.ground_latency, np.full(worlds, NOWHERE, np.int64)),
        "collision": (parameters.collision_latency, np.zeros(worlds, np.bool_)),
    }
    return BatchState(
        time=0,
        x=poses[:, 0].copy(),
        y=poses[:, 1].copy(),
        heading=poses[:, 2] * math.pi / 180.0,
        left_command=np.zeros(worlds),
        right_command=np.zeros(worlds),
        left_output=np.zeros(worlds),
        right_output=np.zeros(worlds),
        collides=np.zeros(worlds, np.bool_),
        collisions=np.zeros(worlds, np.int64),
        delays={
            sensor: deque([reading] * latency) for sensor, (latency, reading) in empty.items() if latency
        },
    )


def _streams(plan: BatchPlan, seeds: Sequence[int]) -> dict[tuple[str, bool], BatchStream]:
    """Make the streams of what has noise; what has none draws nothing, which changes no other stream."""
    roots = [NoiseRoot.from_generator(np.random.default_rng(seed)) for seed in seeds]
    streams = {}
    if plan.motor_deviation > 0.0:
        streams["motors", True] = BatchStream(roots, "motors", 2, running=True)
    for running in (False, True):
        if plan.obstacle_deviation > 0.0:
            streams["infrared", running] = BatchStream(roots, "infrared", SENSORS, running=running)
        if plan.compass_deviation > 0.0:
            streams["compass", running] = BatchStream(roots, "compass", 1, running=running)
        if plan.line_sensor and plan.world.parameters.line_sensor_true_probability < 1.0:
            streams["line", running] = BatchStream(
                roots, "line", len(SIDEWAYS), running=running, normal=False
            )
    return streams
