"""The full-pose filter, which tells where in the lab the robot is and where it looks.

Grid localization (Thrun, Burgard, Fox, *Probabilistic Robotics*, section 8.2) over (x, y, heading), run
in every cycle: the belief is moved by what the wheels do and multiplied by the likelihood of what the
sensors say.

What makes the result trustworthy on a lattice is said where it is done: the likelihood is that of a square,
not of its node (`ciberrato.localization.tables.reading_codes`); motion does not blur
(`ciberrato.localization.belief.pose_belief`); and likelihoods are tempered, as the error made by taking one
distance for a whole square is the same in the next cycle if the robot is still in the same square. The
exponent is therefore proportional to how many squares and bins the robot has moved on in the cycle, up to a
limit.
"""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ciberrato.localization.belief.estimate import PoseEstimate, estimate
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.belief.reweight import Factor, multiply
from ciberrato.localization.evidence.beacons import BeaconSense
from ciberrato.localization.evidence.gps import GpsSense
from ciberrato.localization.evidence.other_sensors import (
    GroundSensor,
    compass_log_likelihood,
    weigh_collision,
)
from ciberrato.localization.evidence.start_prior import StartPrior, begin_with, parse_start
from ciberrato.localization.evidence.symmetry import SymmetryCheck
from ciberrato.localization.records import FilterSettings, FilterStep, Motion
from ciberrato.localization.tables.pose_tables import BINS, PoseTables
from ciberrato.localization.tables.reading_codes import ReadingCodes
from ciberrato.physics.kinematics import advance, clamp_power, filter_power, wrap_angle
from ciberrato.protocol.messages import BeaconReading, Measures
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters

Floats = NDArray[np.float64]
Command = tuple[float, float]

_DEGREE = math.pi / 180.0
_EXCLUDED = 50.0  # evidence beyond any doubt
_LONG_REST = 20  # messages after which a robot at rest is told nothing new


class _Tick(NamedTuple):
    """One message: what the wheels did before it, and what the sensors said."""

    commands: tuple[Command, ...]
    infrared: tuple[float | None, ...]
    compass: float | None
    collision: bool | None
    ground: int | None
    beacons: tuple[BeaconReading, ...]
    gps: tuple[float, float] | None


class PoseFilter:
    """Follows the pose of a robot from message to message.

    Parameters
    ----------
    lab : Lab
    tables : PoseTables
    parameters : Parameters
        As announced.
    settings : FilterSettings, optional
    start : StartPrior or str
        What is possible at the start: "anywhere", "centres" (of all cells, with a heading of 0, 90, 180 or
        270 degrees) or what else `ciberrato.localization.evidence.start_prior.parse_start` reads.
    """

    def __init__(
        self,
        lab: Lab,
        tables: PoseTables,
        parameters: Parameters,
        settings: FilterSettings | None = None,
        *,
        start: str | StartPrior = "anywhere",
    ) -> None:
        self.lab = lab
        self.tables = tables
        self.parameters = parameters
        self.settings = settings or FilterSettings()
        self._prepare()
        self._start = parse_start(start) if isinstance(start, str) else start
        begin_with(self.belief, self._start)
        self._lag = max(
            parameters.obstacle_latency,
            parameters.compass_latency,
            parameters.beacon_latency if parameters.beacon_sensor else 0,
        )
        self._ticks: deque[_Tick] = deque(maxlen=self._lag + 1)
        self._messages = 0
        self._time: int | None = None
        self._wheels = (0.0, 0.0)
        self._variances = [0.0, 0.0, 0.0]  # x, y and heading, gathered and not yet applied
        self._next_axis = 2
        self._since_diffusion = 0
        self._rested = 0
        self._on_node = False
        self._estimate: PoseEstimate | None = None
        self._beacons: BeaconSense | None = None
        if parameters.beacon_sensor and lab.beacons:
            self._beacons = BeaconSense(lab, parameters.beacon_noise, parameters.beacon_aperture)
        self._symmetry = SymmetryCheck(
            lab,
            tables.symmetries(lab),
            tables.angles,
            parameters.obstacle_noise,
            parameters.compass_noise,
            self._beacons,
        )
        self._compared = False
        self.gps = GpsSense(parameters.gps_linear_noise, parameters.motors_noise) if parameters.gps else None
        """What a GPS has told; None without one."""
        self.last_step: FilterStep | None = None
        """The step taken in last."""
        self.alarm_level = 0.0
        """Evidence gathered that the robot is not where the belief is."""
        self.restarts: list[int] = []
        """Times at which the filter found that the robot must be elsewhere and started anew."""

    def _prepare(self, *, uniform: bool = True) -> None:
        """Make what depends on the tables."""
        self.belief = PoseBelief(self.tables.lattice, BINS, prune=self.settings.prune, uniform=uniform)
        self._prepare_sensors()

    def _prepare_sensors(self) -> None:
        resolution = self.tables.lattice.resolution
        self._codes = ReadingCodes(
            noise=self.parameters.obstacle_noise,
            place=self.settings.place_spread * resolution,
            turn=self.settings.turn_spread * self.belief.bin_width,
            outlier=self.settings.outlier,
        )
        self._exact_codes = ReadingCodes(
            noise=self.parameters.obstacle_noise, place=0.0, turn=0.0, outlier=self.settings.outlier
        )
        self._ground = GroundSensor(self.lab, self.belief)

    @property
    def planning_tables(self) -> PoseTables:
        """Tables whose lattice stays the same for the whole run."""
        return self.tables

    # --- what is known --------------------------------------------------------------------------------

    @property
    def wheels(self) -> Command:
        """What the wheels gave in the last cycle taken in, as far as the commands say."""
        return self._wheels

    def estimate(self) -> PoseEstimate:
        """Give the pose at the last message, with its probability."""
        if self._estimate is None:
            found = self._refined(estimate(self.belief))
            if self._symmetry.turns:
                found = self._share_with_images(found)
            self._estimate = self._dead_reckoned(found)
        return self._estimate

    def _follow(self, step: FilterStep) -> None:
        """Let what refines the estimate take in a step."""

    def _refined(self, found: PoseEstimate) -> PoseEstimate:
        """Give an estimate as exactly as it can be told; here, as it is."""
        return found

    def _share_with_images(self, found: PoseEstimate) -> PoseEstimate:
        """Take into account that the lab may look the same turned round."""
        step = self.last_step
        if step is not None and found.probability > 0.3 and not self._compared:
            self._compared = True
            way = sum((motion.left + motion.right) / 2.0 for motion in step.motions)
            pose = (found.x, found.y, found.heading)
            self._symmetry.observe(pose, way, step.infrared, step.compass, step.ground, step.beacons)
        share = self._symmetry.share(self._against_images(found.heading))
        return dataclasses.replace(found, probability=found.probability * share)

    def _against_images(self, heading: float) -> Floats:
        """Say what the start and the GPS tell of the turned images, as natural logarithms."""
        turns = self._symmetry.turns
        known = 0.0 if self.restarts else _EXCLUDED
        against = np.array([known * self._start.excludes(turn) for turn in turns])
        if self.gps is not None:
            headings = heading + np.array([0.0, *(turn.angle for turn in turns)])
            tracker = self.gps.tracker
            weights = np.log(tracker.at(tracker.weights(), headings) + 1e-9)
            against += weights[0] - weights[1:]
        return against

    def _dead_reckoned(self, found: PoseEstimate) -> PoseEstimate:
        """Add the motion since the newest readings, where they come late."""
        if self._lag == 0 or not self._ticks:
            return found
        pose, wheels = (found.x, found.y, found.heading), self._wheels
        for tick in list(self._ticks)[1:]:
            for command in tick.commands:
                wheels = _filtered(command, wheels)
                pose = advance(*pose, *wheels)
        x, y, heading = pose
        return found.moved_to(x, y, wrap_angle(heading))

    def take_over_odometry(self, wheels: Command, time: int | None) -> None:
        """Begin in the middle of a run, with what the wheels gave and the time of the last message."""
        self._wheels, self._time = wheels, time

    # --- what happens -----------------------------------------------------------------------------------

    def observe(self, measures: Measures, command_in_effect: Command | None) -> None:
        """Take in one message.

        Parameters
        ----------
        measures : Measures
            Not older than the one before.
        command_in_effect : (float, float) or None
            Left and right motor command in effect since the message before; None if none was sent yet.
        """
        cycles = 0 if self._time is None else max(measures.time - self._time, 0)
        self._time = measures.time
        self._messages += 1
        self._ticks.append(
            _Tick(
                commands=(command_in_effect or (0.0, 0.0),) * cycles,
                infrared=measures.infrared,
                compass=measures.compass,
                collision=measures.collision,
                ground=measures.ground,
                beacons=measures.beacons,
                gps=measures.gps,
            )
        )
        if self._messages > self._lag:
            self._process(measures.time)
        self._estimate = None
        self._compared = False
        if self.gps is not None and measures.gps is not None and self.belief.dense is None:
            found = self.estimate()
            if found.certain:
                self.gps.offset.learn(measures.gps, found.x, found.y)

    def _process(self, time: int) -> None:
        oldest, parameters = self._ticks[0], self.parameters
        # Of these two sensors, whose readings matter less, nothing waits for what is later than the others.
        blocked = self._late(parameters.collision_latency)
        floor = self._late(parameters.ground_latency)
        motions = []
        for number, command in enumerate(oldest.commands):
            # Of cycles whose messages never came nobody knows whether a wall was in the way.
            last = number == len(oldest.commands) - 1
            collision = blocked.collision if last and blocked is not None else None
            self._wheels = left, right = _filtered(command, self._wheels)
            if left != 0.0 or right != 0.0:
                motions.append(Motion(left, right, collision))
        moved = sum(abs(motion.left + motion.right) / 2.0 for motion in motions)
        turned = sum(abs(motion.right - motion.left) for motion in motions)
        # Of a robot known to stand on a node the first reading is the node's, and repeats no error.
        self._on_node = self.last_step is None and self._start.on_nodes and not motions
        exponent = self._exponent(moved, turned)
        self.last_step = FilterStep(
            motions=tuple(motions),
            infrared=self._ticks[parameters.obstacle_latency].infrared,
            compass=self._ticks[parameters.compass_latency].compass,
            ground=floor.ground if floor is not None and (moved > 0.0 or self._messages < 3) else None,
            exponent=1.0 if self._on_node else exponent,
            time=time,
            beacons=self._ticks[parameters.beacon_latency].beacons if self._beacons is not None else (),
        )
        for motion in motions:
            self.predict(motion)
            if self.gps is not None:
                self.gps.tracker.move(motion)
        if self.gps is not None and oldest.gps is not None:
            self._take_gps(self.gps, oldest.gps, time)
        self.update(self.last_step)
        self._on_node = False
        self._follow(self.last_step)

    def _late(self, latency: int) -> _Tick | None:
        """Give the message with the readings made at the time of the oldest, if it has come."""
        return self._ticks[latency] if latency < len(self._ticks) else None

    def _take_gps(self, gps: GpsSense, reading: tuple[float, float], time: int) -> None:
        told = gps.weigh(self.belief, reading)
        if told is None:
            self.restart(time)
        else:
            self._judge(*told, time)

    def _judge(self, evidence: float, elsewhere: float, time: int) -> bool:
        """Compare the evidence for the belief with that for a pose anywhere; say whether it may stay."""
        ratio = math.log(max(evidence, 1e-30)) - elsewhere
        self.alarm_level = max(self.alarm_level - ratio + self.settings.alarm_slack, 0.0)
        if evidence == 0.0 or self.alarm_level > self.settings.alarm:
            self.restart(time)
            return False
        return True

    def _exponent(self, moved: float, turned: float) -> float:
        settings = self.settings
        progress = moved / self.tables.lattice.resolution + turned / self.belief.bin_width
        if progress < 1e-3:
            self._rested += 1
            if self._rested > _LONG_REST:
                return 0.0
            return settings.exponent if self._rested == 1 else settings.least_exponent / self._rested
        self._rested = 0 if progress > 0.1 else self._rested
        return settings.exponent * min(max(progress, settings.least_exponent), 1.0)

    def predict(self, motion: Motion, *, backwards: bool = False) -> None:
        """Move the belief by one cycle.

        Parameters
        ----------
        motion : Motion
        backwards : bool
            Whether to undo the motion: to say where the robot was before it, not where it is after it.
        """
        left, right, collision = motion
        way, angle = (left + right) / 2.0, right - left
        if backwards:
            self.belief.turn(-angle)
            if not collision:
                self.belief.drive(-way, stay_if_blocked=collision is None)
        else:
            if collision:
                weigh_collision(self.belief, way, self.settings.exponent)
            else:
                self.belief.drive(way, stay_if_blocked=collision is None)
            self.belief.turn(angle)
        wheel_variance = (2.0 * self.parameters.motors_noise / 100.0) ** 2 * (left**2 + right**2)
        moving = min((abs(left) + abs(right)) / 0.2, 1.0)
        noisy = 1.0 if self.parameters.motors_noise > 0.0 else 0.25
        floor_turn = (self.settings.turn_floor * _DEGREE) ** 2 * moving * noisy
        floor_place = self.settings.place_floor**2 * moving * noisy
        place = wheel_variance / 8.0 + floor_place
        for axis, variance in enumerate((place, place, wheel_variance + floor_turn)):
            self._variances[axis] += variance
        self._since_diffusion += 1
        self._diffuse_if_due()

    def _diffuse_if_due(self) -> None:
        """Spread the belief by the noise gathered since the last time; one axis at a time, in turn."""
        if self._since_diffusion * 3 < self.settings.diffusion_period:
            return
        self._since_diffusion = 0
        axis = self._next_axis
        self._next_axis = (axis + 1) % 3
        variance, self._variances[axis] = self._variances[axis], 0.0
        if axis == 2:
            self.belief.diffuse_heading(variance)
        else:
            self.belief.diffuse_place(variance, vertical=axis == 1)

    def update(self, step: FilterStep) -> None:
        """Take in what the sensors said in a step."""
        if step.exponent > 0.0:
            self._take_readings(step)
        if step.ground is not None:
            self._ground.weigh(self.belief, step.ground, self.settings.exponent)

    def _take_readings(self, step: FilterStep) -> None:
        belief, exponent = self.belief, step.exponent
        codes = self._exact_codes if self._on_node else self._codes
        elsewhere = 0.0
        factors: list[Factor] = []
        for sensor, reading in enumerate(step.infrared[: len(self.tables.sensors)]):
            if reading is None:
                continue
            table = np.exp(exponent * codes.log_likelihood(reading))
            shares = self.tables.code_shares[self.tables.sensors[sensor][0]]
            elsewhere += math.log(float(shares @ table))
            factors.append((self.tables.view(sensor, belief.heading_offset), table.astype(np.float32)))
        by_bin: NDArray[np.float32] | None = None
        if step.compass is not None:
            log_likelihood = compass_log_likelihood(belief, step.compass, self.parameters.compass_noise)
            tempered = np.exp(exponent * log_likelihood)
            elsewhere += math.log(float(tempered.mean()))
            by_bin = tempered.astype(np.float32)
        multiply(belief, factors, by_bin)
        told = None
        if self._beacons is not None:
            told = self._beacons.weigh(belief, step.beacons, exponent)
            elsewhere += told or 0.0
        if not factors and by_bin is None and told is None:
            return
        if self._judge(belief.normalize(), elsewhere, step.time):
            belief.prune()

    def restart(self, time: int) -> None:
        """Forget everything: every free pose is possible."""
        self.restarts.append(time)
        self.alarm_level = 0.0
        self.belief.set_uniform()
        if self.gps is not None:
            self.gps.begin_anew(self.belief)


def _filtered(command: Command, wheels: Command) -> Command:
    left, right = (filter_power(clamp_power(c), w) for c, w in zip(command, wheels, strict=True))
    return left, right
