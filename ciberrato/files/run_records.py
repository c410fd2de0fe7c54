"""The records of a run: what is known when it begins, its cycles, and the steps that the filter uses.

`ciberrato.files.run_log` writes and reads them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ciberrato.protocol.messages import Measures
from ciberrato.reprs import html_repr, short_repr
from ciberrato.world.lab import CELL_SIZE
from ciberrato.world.parameters import Parameters

FORMAT_VERSION = 1

Preset = Literal["calibrated", "seed"]
DistanceModel = Literal["sensor", "cone"]
Readings = tuple[float | None, float | None, float | None, float | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunHeader:
    """Facts that are known when the run begins.

    Attributes
    ----------
    format_version : int
        Version of this document; readers refuse any other.
    lab_name : str
        File name of the lab, without its folder; empty if the program did not know its lab.
    lab_sha256 : str
        SHA-256 of the lab file's bytes, in hexadecimal.
    parameters : Parameters
        As the simulator announced them.
    n_beacons : int
        As announced.
    sensor_angles : tuple of float
        Mounting angles of the four IR sensors in degrees, counter-clockwise from the front.
    preset : str
        Filter preset asked for, ``seed`` or ``calibrated``.
    distance_model : str
        Quantity that a sensor is taken to measure, ``sensor`` or ``cone``; see
        `ciberrato.infrared.model.cell_readings`.
    seed : int or None
        Seed of the simulation if the caller gave it; the agent draws no random numbers.
    robot_name : str
    robot_position : int
        Position asked for, 0 = any free one.
    cruise : float
        Motor command for driving straight on, in units per cycle.
    precision : int
        Decimals of the probabilities in the output file.
    """

    __repr__ = short_repr

    format_version: int = FORMAT_VERSION
    lab_name: str
    lab_sha256: str
    parameters: Parameters
    n_beacons: int = 0
    sensor_angles: tuple[float, float, float, float]
    preset: Preset = "calibrated"
    distance_model: DistanceModel = "sensor"
    seed: int | None = None
    robot_name: str = ""
    robot_position: int = 0
    cruise: float = 0.1
    precision: int = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Cycle:
    """One Measures message and what the agent made of it.

    Attributes
    ----------
    time : int
        Simulated cycles so far.
    start, stop : bool
        The buttons.
    collision : bool or None
    compass : float or None
        Degrees.
    ground : int or None
    infrared : tuple of four (float or None)
        IR readings of this message, sensors 0 to 3.
    leds : tuple of bool
        EndLed, ReturningLed, VisitingLed.
    command : (float, float) or None
        Left and right motor in effect after this message was dealt with; None before the first command.
    answered : bool
        Whether a command was sent in answer (of several waiting messages only the newest is answered).
    displacement : float or None
        Way driven to the right since the first cell's centre, in units, as the dead reckoning of the drive to
        the right has it; None, as the next three, where another drive decides.
    lateral : float or None
        Distance to the left of the row's middle line, in units, likewise.
    heading : float or None
        Heading in degrees, likewise.
    spread : tuple of float, or None
        Standard deviations of the last three, in their units.
    phase : str
        Activity of the agent, in its own words.
    step : int or None
        Number of the step that was recorded at this message: 0 = start cell, k = k-th cell entered.
    estimate : (float, float, float, float) or None
        Estimate of the live pose filter: x, y in units, heading in degrees, and the probability of that pose.
    entropy : float or None
        Entropy of the live filter's belief, in bits.
    cells : tuple of (int, int, float), or None
        Row (from the bottom), column and probability of the cells that the live filter takes for possible;
        where that has changed since the last such entry, at most every few cycles.
    modes : tuple of (float, float, float, float), or None
        x, y, degrees and probability of the poses that it may be, every few cycles while they are several.
    readings : tuple of four (float or None), or None
        The readings of that step. They are those in `infrared` unless the simulator sends sensors on request
        only; then each is the newest there is.
    """

    __repr__ = short_repr

    time: int
    start: bool = False
    stop: bool = False
    collision: bool | None = None
    compass: float | None = None
    ground: int | None = None
    infrared: Readings = (None, None, None, None)
    leds: tuple[bool, bool, bool] = (False, False, False)
    command: tuple[float, float] | None = None
    answered: bool = False
    displacement: float | None = None
    lateral: float | None = None
    heading: float | None = None
    spread: tuple[float, float, float] | None = None
    phase: str = ""
    step: int | None = None
    readings: Readings | None = None
    estimate: tuple[float, float, float, float] | None = None
    entropy: float | None = None
    cells: tuple[tuple[int, int, float], ...] | None = None
    modes: tuple[tuple[float, float, float, float], ...] | None = None

    @property
    def measures(self) -> Measures:
        """Return the message, without what the log does not keep: beacons, GPS, line, what was heard."""
        end_led, returning_led, visiting_led = self.leds
        return Measures(
            time=self.time,
            start=self.start,
            stop=self.stop,
            end_led=end_led,
            returning_led=returning_led,
            visiting_led=visiting_led,
            collision=self.collision,
            compass=self.compass,
            ground=self.ground,
            infrared=self.infrared,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One reading that the filter uses: at the start cell, or at the centre of a cell entered.

    Attributes
    ----------
    index : int
        0 = start cell, k = k-th cell entered.
    time : int
        Simulated cycles at the reading.
    readings : tuple of four (float or None)
        IR readings; None where the simulator sent none.
    along, lateral : float
        Estimated place of the robot relative to the cell's centre, in units: ahead, to the left.
    heading : float
        Estimated heading in degrees.
    spread : tuple of float
        Standard deviations of the last three, in their units.
    """

    __repr__ = short_repr

    index: int
    time: int
    readings: Readings
    along: float = 0.0
    lateral: float = 0.0
    heading: float = 0.0
    spread: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class RecordedRun:
    """A run as logged.

    Attributes
    ----------
    header : RunHeader
    cycles : tuple of Cycle
        In the order of the messages.
    """

    __repr__ = short_repr
    _repr_html_ = html_repr

    header: RunHeader
    cycles: tuple[Cycle, ...] = ()

    @property
    def drives_right(self) -> bool:
        """Return whether the steps are cells of a row with heading right, as the published method needs.

        Other drives log no dead reckoning, and only the live pose filter knows where their readings were
        taken.
        """
        return bool(self.cycles) and self.cycles[-1].displacement is not None

    @property
    def inputs(self) -> tuple[tuple[Measures, tuple[float, float] | None], ...]:
        """Return every message with the motor command in effect before it, as a filter wants them."""
        commands = (None, *(cycle.command for cycle in self.cycles[:-1]))
        return tuple((cycle.measures, command) for cycle, command in zip(self.cycles, commands, strict=False))

    @property
    def steps(self) -> tuple[Step, ...]:
        """The readings for the filter, in order; where no dead reckoning is logged, of cells' centres."""
        return tuple(
            Step(
                index=cycle.step,
                time=cycle.time,
                readings=cycle.readings if cycle.readings is not None else cycle.infrared,
                along=0.0 if cycle.displacement is None else cycle.displacement - CELL_SIZE * cycle.step,
                lateral=cycle.lateral or 0.0,
                heading=cycle.heading or 0.0,
                spread=cycle.spread or (0.0, 0.0, 0.0),
            )
            for cycle in self.cycles
            if cycle.step is not None
        )
