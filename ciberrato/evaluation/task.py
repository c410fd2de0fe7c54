"""Tasks and their outcomes: the two records of an evaluation."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass, field
from typing import Any

from agent.drives.registry import DRIVES as KINDS
from agent.drives.registry import read_place
from ciberrato.reprs import short_repr

STARTS = ("grid", "centres", "free")
DRIVES = tuple(name for name, kind in KINDS.items() if kind.argument in (None, read_place))
"""Drives that take nothing, or a place that is chosen at random."""
BUILT_IN = "built-in"
"""The project's own filter."""
PRIORS = ("told", "anywhere")
GPS = ("announced", "on", "off")
TRUTH_PERIOD = 10
"""Cycles between two entries of `Outcome.truth`."""
SAID = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99)
"""Probabilities at which the classes of `Outcome.said` begin; each ends where the next one does."""
LEAST_MS, MS_RATIO, MS_STEPS = 0.05, 1.25, 48
"""Of `Outcome.ms_counts`: where its ranges begin, how much longer each is than the one before, how many."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """One run.

    Attributes
    ----------
    lab : str
        Name of a lab that ships, or path of a lab file.
    grid : str or None
        Path of a start grid, for starts from the grid; None = the one that ships with the lab.
    start : {"grid", "centres", "free"}
        A pose of the start grid, the centre of a cell with one of four headings, or any free pose.
    prior : {"anywhere", "centres"}
        Prior of the filter at the start.
    parameters : str
        Name or path of a parameter file.
    compass : bool
        Whether the robot has a compass.
    seed : int
    drive : str
        One of `DRIVES`, or what ``--drive`` takes for one that others wrote.
    cycles : int
        Length of the run.
    resolution : float
        Units between the lattice's nodes.
    kidnap : int
        Cycle before which the robot is moved to another free pose; 0 = never.
    staged : bool
        Whether the filter begins on a coarse lattice, as the agent's does.
    settle : int
        Cycles for which a run goes on after the first right claim; 0 = to its end.
    gps : {"announced", "on", "off"}
        Whether the robot has a GPS; announced = as the parameters say.
    settings : str
        Parameters other than those of the file: ``NAME=VALUE``, with commas between them.
    filter : str
        ``built-in``, or the filter that is judged in its place: name of an entry point or ``module:object``.
    code : str
        Digest of the sources of filter and drive, where others wrote them.
    """

    __repr__ = short_repr

    lab: str
    grid: str | None = None
    start: str = "centres"
    prior: str = "anywhere"
    parameters: str = "default"
    compass: bool = True
    seed: int = 0
    drive: str = "explore"
    cycles: int = 800
    resolution: float = 0.1
    kidnap: int = 0
    staged: bool = True
    settle: int = 0
    gps: str = "announced"
    settings: str = ""
    filter: str = BUILT_IN
    code: str = ""

    @property
    def key(self) -> str:
        """Name of the task; tasks with equal names are equal."""
        return json.dumps(dataclasses.asdict(self), sort_keys=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Outcome of a run. Times are cycles since the start; None = never.

    A *claim* is a probability above 0.99 that the pose is within 0.5 units and 10 degrees of the
    estimate; it is wrong if the true pose is not.

    Attributes
    ----------
    cycles : int
        Cycles run, those counted in advance at the end of a robot that stands included.
    start : tuple of float
        True pose at the start: x, y in units, heading in degrees.
    room : float
        Units squared that can be reached from the start: in a small closed room no filter can decide which.
    first_right : int or None
        First right claim.
    first_claim : int or None
    first_claim_wrong : bool
    claimed, wrongly : int
        Cycles with a claim, and with a wrong one.
    final_claim : bool
    final_place_error : float
        Units, of the last estimate.
    final_turn_error_deg : float
        Degrees.
    collisions : int
        Beginnings of collisions.
    colliding : int
        Cycles in collision.
    restarts : list of int
        Times at which the filter started anew.
    kidnapped, noticed, found : int or None
        Cycle in which the robot was moved; cycles from then until the filter began anew or withdrew its
        claim, and until the first right claim.
    arrived : int or None
        Cycle in which a goto drive reported its arrival.
    rested : int or None
        Cycle in which the run was ended as the robot stood for good. Its state counts for all cycles to come.
    truth : list of float
        Probability of the true pose (within the claim's limits), every tenth cycle.
    calibration : list of (int, int)
        For ten equal ranges of probability: cycles in which the estimate had it, and those in which it
        was right.
    said : list of (float, bool) or None
        For each class of `SAID`: the first probability in it that an estimate of the run had, and whether the
        estimate was right; None where there was none. As the time of it is known when it comes, and not
        chosen afterwards, a calibrated filter is right in just that share of the runs.
    equals : int or None
        Other poses that are equal to the true one (`ciberrato.checks.equal_places`), at the start or after
        a kidnapping; None where the lab was not looked at.
    alike : int or None
        Cycles from the start, or from the kidnapping, until the true pose and those equal to it had a
        probability above 0.99 together; None where no pose is equal.
    filter_ms : list of float
        Median, 99 % quantile and maximum of the processor time of the filter in a cycle,
        in milliseconds.
    drive_ms : list of float
        The same for the drive.
    ms_counts : list of int
        Cycles by the time that filter and drive took together: in range k, from ``0.05 * 1.25**k``
        milliseconds to the next, what is beyond the ends included.
    given_up : float
        Weight of the states that the filter gave up as too unlikely.
    """

    __repr__ = short_repr

    cycles: int
    start: list[float]
    room: float
    first_right: int | None
    first_claim: int | None
    first_claim_wrong: bool
    claimed: int
    wrongly: int
    final_claim: bool
    final_place_error: float
    final_turn_error_deg: float
    collisions: int
    colliding: int
    restarts: list[int]
    kidnapped: int | None = None
    noticed: int | None = None
    found: int | None = None
    arrived: int | None = None
    rested: int | None = None
    truth: list[float] = field(default_factory=list)
    calibration: list[list[int]] = field(default_factory=list)
    said: list[list[float] | None] = field(default_factory=list)
    equals: int | None = None
    alike: int | None = None
    filter_ms: list[float] = field(default_factory=list)
    drive_ms: list[float] = field(default_factory=list)
    ms_counts: list[int] = field(default_factory=list)
    given_up: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """Return the fields by name."""
        return dataclasses.asdict(self)
