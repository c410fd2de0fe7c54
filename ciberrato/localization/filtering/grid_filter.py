"""The full-pose filter, which estimates position and heading of the robot in the lab.

Grid localization (Thrun, Burgard, Fox, *Probabilistic Robotics*, section 8.2) over (x, y, heading), run
in every cycle: the belief is moved by what the wheels do and multiplied by the likelihood of what the
sensors say.

What makes the result trustworthy on a lattice is said where it is done: the likelihood is that of a square,
not of its node (`ciberrato.localization.tables.reading_codes`); motion does not blur
(`ciberrato.localization.belief.pose_belief`); and likelihoods are tempered
(`ciberrato.localization.filtering.tempering`). The filter has its parts: the alignment of messages, the
stage (a belief on one lattice), tempering, diffusion, the alarm, the images in labs that look the same turned
round, the GPS; and, where it is given them, a fine stage, particles and a challenge
(`ciberrato.localization.filtering.staged_filter`).
"""

from __future__ import annotations

from ciberrato.localization.belief.estimate import PoseEstimate, estimate, modes
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.evidence.beacons import BeaconSense
from ciberrato.localization.evidence.gps import GpsSense
from ciberrato.localization.evidence.map_fit import MapFit
from ciberrato.localization.evidence.other_sensors import weigh_collision
from ciberrato.localization.evidence.start_prior import StartPrior, begin_with, parse_start
from ciberrato.localization.evidence.symmetry import SymmetryCheck
from ciberrato.localization.filtering.alarm import Alarm
from ciberrato.localization.filtering.alignment import MessageAlignment, Moment
from ciberrato.localization.filtering.challenge import Challenge
from ciberrato.localization.filtering.diffusion import Diffusion
from ciberrato.localization.filtering.images import TurnedImages
from ciberrato.localization.filtering.interruption import LOST, Interruption
from ciberrato.localization.filtering.stage import FineStage, Stage, common_codes, transfer
from ciberrato.localization.filtering.tempering import Tempering
from ciberrato.localization.records import FilterSettings, FilterStep, Motion
from ciberrato.localization.refinement.refiner import Refinement
from ciberrato.localization.tables.pose_tables import PoseTables
from ciberrato.physics.kinematics import Command
from ciberrato.protocol.messages import Measures
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters


class GridFilter:
    """Follows the pose of a robot from message to message.

    Parameters
    ----------
    lab : Lab
    tables : PoseTables
        Tables of the lattice that it begins on, and goes back to when it begins anew.
    parameters : Parameters
        As announced.
    settings : FilterSettings, optional
    start : StartPrior or str
        Prior of the start: "anywhere", "centres" (of all cells, with a heading of 0, 90, 180 or
        270 degrees) or what else `ciberrato.localization.evidence.start_prior.parse_start` reads.
    fine : FineStage, optional
        The stage after the first.
    refinement : Refinement, optional
        Particles around the pose, while it is known.
    challenge : Challenge, optional
        Doubts about the belief, now and then.
    map_fit : MapFit, optional
        Doubts about the lab.
    """

    def __init__(
        self,
        lab: Lab,
        tables: PoseTables,
        parameters: Parameters,
        settings: FilterSettings | None = None,
        *,
        start: str | StartPrior = "anywhere",
        fine: FineStage | None = None,
        refinement: Refinement | None = None,
        challenge: Challenge | None = None,
        map_fit: MapFit | None = None,
    ) -> None:
        self.lab = lab
        self.parameters = parameters
        self.planning_tables = tables
        """Tables whose lattice stays the same for the whole run: those of the first stage."""
        self._first_settings = settings or FilterSettings()
        self.stage = Stage(lab, tables, parameters, self._first_settings)
        """The belief and its lattice."""
        self.fine = fine
        self.refinement = refinement
        self.challenge = challenge
        self.map_fit = map_fit
        self.alignment = MessageAlignment(parameters)
        self.alarm = Alarm()
        self.gps = GpsSense(parameters.gps_linear_noise, parameters.motors_noise) if parameters.gps else None
        """Knowledge about the GPS; None without one."""
        self.last_step: FilterStep | None = None
        """The step taken in last."""
        self.restarts: list[int] = []
        """Times at which the filter found that the robot must be elsewhere and started anew."""
        self._start = parse_start(start) if isinstance(start, str) else start
        begin_with(self.belief, self._start)
        self._tempering = Tempering()
        self._diffusion = Diffusion(parameters.motors_noise)
        self._beacons = beacon_sense(lab, parameters)
        symmetry = SymmetryCheck(
            lab,
            tables.symmetries(lab),
            tables.angles,
            parameters.obstacle_noise,
            parameters.compass_noise,
            self._beacons,
        )
        self._images = TurnedImages(symmetry, self._start, self.gps)
        self.foretold: float | None = None
        """Log evidence of the last readings under the belief before them, where a challenge asks for it."""
        self._common_codes = common_codes(parameters, self._first_settings)
        self._estimate: PoseEstimate | None = None

    # --- what is known --------------------------------------------------------------------------------

    @property
    def belief(self) -> PoseBelief:
        """Return the belief of the present stage."""
        return self.stage.belief

    @property
    def tables(self) -> PoseTables:
        """Return the tables of the present stage."""
        return self.stage.tables

    @property
    def is_fine(self) -> bool:
        """Return whether the belief is on the fine lattice."""
        return self.stage.tables is not self.planning_tables

    @property
    def wheels(self) -> Command:
        """Motion of the wheels in the last cycle processed, according to the commands."""
        return self.alignment.wheels

    def command_before(self, time: int) -> Command | None:
        """Return the motor command in effect before a message; None if that is not the newest taken in."""
        return self.alignment.command if self.alignment.time == time else None

    def estimate(self) -> PoseEstimate:
        """Return the pose at the last message, with its probability."""
        if self._estimate is None:
            found = estimate(self.belief)
            if self.refinement is not None:
                found = self.refinement.refine(found, self.belief)
            found = self._images.share(found, self.last_step, restarted=bool(self.restarts))
            self._estimate = self.alignment.carry_on(found)
        return self._estimate

    def modes(self) -> list[PoseEstimate]:
        """Return all poses at the last message that the belief is gathered around.

        Returns
        -------
        list of PoseEstimate
            The most probable state's first.
        """
        return [self.alignment.carry_on(mode) for mode in modes(self.belief)]

    def separable(self, most: int = 8, least: float = 0.02) -> list[PoseEstimate]:
        """Return the poses at the last moment that further readings have to tell apart.

        As `modes`, with the images of the first in a lab that looks the same turned round: they are
        possible even where the belief, for the sake of the lattice, prefers one of them.

        Parameters
        ----------
        most : int
        least : float
            Least probability.

        Returns
        -------
        list of PoseEstimate
            The most probable first.
        """
        first, *others = modes(self.belief, most=most, least=least)
        split = self._images.split(first, restarted=bool(self.restarts))
        found = [split[0], *others, *(image for image in split[1:] if image.probability >= least)]
        return sorted(found, key=lambda mode: -mode.probability)[:most]

    # --- what happens -----------------------------------------------------------------------------------

    def begin_at(self, wheels: Command, time: int | None) -> None:
        """Begin in the middle of a run, with the last motion of the wheels and the last message's time."""
        self.alignment.begin_at(wheels, time)

    def doubt_motion(self) -> None:
        """Trust readings as little from now on as if some had been taken in; for commands of unsure time."""
        self._tempering.doubt()
        if self.challenge is not None:
            self.challenge.doubt_motion()

    def observe(self, measures: Measures, command_in_effect: Command | None) -> None:
        """Process one message.

        Parameters
        ----------
        measures : Measures
            Not older than the one before.
        command_in_effect : (float, float) or None
            Left and right motor command in effect since the message before; None if none was sent yet.
        """
        before = self.alignment.wheels, self.alignment.time
        moment = self.alignment.take(measures, command_in_effect)
        if moment is not None:
            self._take_moment(moment)
        self._estimate = None
        self._images.begin_message()
        if self.gps is not None and measures.gps is not None and self.belief.dense is None:
            found = self.estimate()
            if found.likely:
                self.gps.offset.learn(measures.gps, found.x, found.y)
        if self.challenge is not None:
            winner = self.challenge.observe(self, measures, command_in_effect, before)
            if winner is not None:
                self._give_way_to(winner.stage, measures.time)
        if self.fine is not None and not self.is_fine:
            self.stage = self.fine.after(self.stage) or self.stage
        elif self.fine is not None:
            self.fine.look_ahead(self.stage)

    def _take_moment(self, moment: Moment) -> None:
        # Of a robot known to stand on a node the first reading is the node's, and repeats no error.
        on_node = self.last_step is None and self._start.on_nodes and not moment.motions
        exponent = self._tempering.exponent(moment.moved, moment.turned, self.stage)
        self.last_step = step = FilterStep(
            motions=moment.motions,
            infrared=moment.infrared,
            compass=moment.compass,
            ground=moment.ground,
            exponent=1.0 if on_node else exponent,
            time=moment.time,
            beacons=moment.beacons if self._beacons is not None else (),
        )
        self._make_room(moment)
        self._move(moment)
        if self.gps is not None and moment.gps is not None:
            told = self.gps.weigh(self.belief, moment.gps)
            if told is None:
                self.restart(step.time)
            else:
                self._judge(*told, step.time)
        if self.map_fit is not None and step.motions and step.exponent > 0.0:
            misfit = self.stage.misfit(step)
            if misfit is not None:
                self.map_fit.observe(
                    misfit, min(step.exponent / self.stage.settings.exponent, 1.0), step.time
                )
        if self.challenge is None or self.challenge.active:
            self.foretold = self.stage.log_evidence(step, self._common_codes)
        self.update(step, on_node=on_node)
        if self.refinement is not None:
            self.refinement.follow(step, min(step.exponent / self.stage.settings.exponent, 1.0))

    def _make_room(self, moment: Moment) -> None:
        """Return to the first stage if there are no fine tables where the robot may be after a moment."""
        if self.fine is None or not self.is_fine:
            return
        way = max(
            sum(abs(motion.left + motion.right) / 2.0 for motion in motions)
            for motions in (moment.motions, moment.otherwise)
        )
        if self.fine.make_room(self.stage, way, len(moment.motions)):
            return
        fine, self.stage = self.stage, self._first_stage()
        if fine.belief.dense is None:
            transfer(fine.belief, self.belief)
        else:
            self.belief.set_uniform()

    def _first_stage(self) -> Stage:
        return Stage(self.lab, self.planning_tables, self.parameters, self._first_settings, uniform=False)

    def _move(self, moment: Moment) -> None:
        """Move the belief by all cycles before a moment."""
        if moment.doubtful:
            self._move_blindly(moment)
        else:
            for motion in moment.motions:
                self.predict(motion)
        if self.gps is not None:
            for motion in moment.motions:
                self.gps.tracker.move(motion)

    def _move_blindly(self, moment: Moment) -> None:
        """Move the belief by a gap in which the robot may have been stopped at any time."""
        self._tempering.doubt()
        interruption = Interruption(moment.doubtful, collided=any(one.collision for one in moment.motions))
        belief = self.belief
        if moment.otherwise:
            self.stage.belief = belief.copy()
            self._follow(interruption, moment.otherwise, moment.doubtful, LOST)
            self.stage.belief = belief
        self._follow(interruption, moment.motions, moment.doubtful, 1.0 - LOST * bool(moment.otherwise))
        interruption.mix(belief)
        if self.refinement is not None:
            self.refinement.end()

    def _follow(
        self, interruption: Interruption, motions: tuple[Motion, ...], doubtful: int, share: float
    ) -> None:
        interruption.begin(share)
        for number, motion in enumerate(motions, start=1):
            if number > len(motions) - doubtful:
                interruption.keep(self.belief)
            self.predict(motion)
        interruption.end(self.belief)

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
        belief, settings = self.belief, self.stage.settings
        if backwards:
            belief.turn(-angle)
            if not collision:
                belief.drive(-way, stay_if_blocked=collision is None)
        else:
            if collision:
                weigh_collision(belief, way, settings.exponent)
            else:
                belief.drive(way, stay_if_blocked=collision is None)
            belief.turn(angle)
        self._diffusion.spread(belief, left, right, settings)

    def update(self, step: FilterStep, *, on_node: bool = False) -> None:
        """Update the belief with the sensor readings of a step.

        Parameters
        ----------
        step : FilterStep
        on_node : bool
            Whether the robot is known to be on a node of the lattice.
        """
        if step.exponent > 0.0:
            told = self.stage.weigh(step, self._beacons, exact=on_node)
            if told is not None and self._judge(*told, step.time):
                self.belief.prune()
        if step.ground is not None:
            self.stage.ground.weigh(self.belief, step.ground, self.stage.settings.exponent)

    def _judge(self, evidence: float, elsewhere: float, time: int) -> bool:
        """Check the alarm, and restart if it is raised; return whether the belief stays."""
        stays = self.alarm.judge(evidence, elsewhere, self.stage.settings)
        if not stays:
            self.restart(time)
        return stays

    def restart(self, time: int) -> None:
        """Reset the belief: every free pose of the first stage is possible."""
        if self.challenge is not None:
            self.challenge.end()
        if self.refinement is not None:
            self.refinement.end()
        if self.is_fine:
            self.stage = self._first_stage()
        self.restarts.append(time)
        self.alarm.reset()
        self._tempering.begin_anew()
        self.belief.set_uniform()
        if self.gps is not None:
            self.gps.begin_anew(self.belief)

    def _give_way_to(self, stage: Stage, time: int) -> None:
        """Replace the belief by that of another filter, which has turned out to be right."""
        self.restarts.append(time)
        self.alarm.reset()
        self.stage = stage
        if self.refinement is not None:
            self.refinement.end()
        if self.gps is not None:
            self.gps.offset.forget()  # learnt at the wrong pose
        self._estimate = None


def beacon_sense(lab: Lab, parameters: Parameters) -> BeaconSense | None:
    """Return what beacon readings are weighed by; None where there are none."""
    if not (parameters.beacon_sensor and lab.beacons):
        return None
    return BeaconSense(lab, parameters.beacon_noise, parameters.beacon_aperture)
