"""A course: agents, labs, seeds, limits and points, read from a TOML file."""

from __future__ import annotations

import os
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

from ciberrato import labs as shipped
from ciberrato.errors import CiberratoError, LabError, UsageError
from ciberrato.files.lab import read_lab
from ciberrato.files.parameters import parse_parameters_with_warnings
from ciberrato.files.start_grid import default_grid, read_grid
from ciberrato.files.xml import read_file
from ciberrato.grading.agents import Agent as Agent
from ciberrato.grading.agents import read_agent
from ciberrato.grading.expressions import Formula
from ciberrato.grading.fields import Fields
from ciberrato.grading.random_labs import random_files
from ciberrato.grading.tournament.settings import DEFAULT, TournamentSettings, read_settings
from ciberrato.labs import find_grid, find_lab, find_parameters
from ciberrato.reprs import short_repr

QUANTITIES = frozenset(
    {
        *(
            "merit",
            "score",
            "visited",
            "targets",
            "arrival_time",
            "returning_time",
            "collisions",
            "time",
            "sim_time",
        ),
        *("answered", "unanswered", "late", "finished", "crashed", "silent", "registered"),
        *("mapping", "planning"),
    }
)
"""Names that a formula of points may use; docs/grading.md says what they are."""


@dataclass(frozen=True, slots=True)
class GradedLab:
    """A lab, and how runs in it count.

    Attributes
    ----------
    name : str
    lab, grid : Path
    parameters : Path or None
    settings : tuple of (str, str)
        Attributes of the parameter file that are set otherwise.
    scoring : int
        Mode.
    weight : float
        Weight of the lab's points in the total.
    position : int
        Position in the start grid, from 1.
    secret : bool
        Whether published reports leave it out.
    """

    __repr__ = short_repr

    name: str
    lab: Path
    grid: Path | None = None
    parameters: Path | None = None
    settings: tuple[tuple[str, str], ...] = ()
    scoring: int = 0
    weight: float = 1.0
    position: int = 1
    secret: bool = False


MOST = 10**9
"""Of each limit, in its unit; the system counts them in bytes and 64 bits."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of an agent in a run.

    Attributes
    ----------
    time : float
        Seconds from its start, by the clock on the wall.
    registration : float
        Seconds until it has registered.
    build : float
        Seconds for its build command.
    memory : int
        MB in memory, all its processes together.
    processes : int
        Processes and threads at a time.
    output : int
        KB on standard output and error.
    files : int
        Open files a process.
    disk : int
        MB of the largest file that it may write, of its /tmp, and of what it adds to its folder.
    silence : float
        Seconds without an answer, by the simulation's clock, after which the run ends.
    """

    __repr__ = short_repr

    time: float = 300.0
    registration: float = 20.0
    build: float = 300.0
    memory: int = 1024
    processes: int = 64
    output: int = 1024
    files: int = 256
    disk: int = 64
    silence: float = 2.0


@dataclass(frozen=True, slots=True)
class Points:
    """Conversion of runs to points.

    Attributes
    ----------
    formula : Formula
        Points of a run.
    maximum : float or None
        A run's points are cut to 0 and this; None = as they are.
    passing : float or None
        Points from which a run passes, for JUnit; None = whatever does not fail.
    """

    __repr__ = short_repr

    formula: Formula
    maximum: float | None = None
    passing: float | None = None


@dataclass(frozen=True, slots=True)
class Course:
    """A course.

    Attributes
    ----------
    title : str
    agents, labs, seeds : tuple
        Every agent runs in every lab with every seed.
    lockstep : bool
    speed : float
        Times real time, if not in lockstep.
    answer_limit : float or None
        Seconds that lockstep waits for an answer; None = as the simulator does by default.
    limits : Limits
    points : Points
    readable : tuple of Path
        Files and folders that a sandbox shows besides the system and Python.
    tournament : TournamentSettings
    image : str or None
        Image of containers, with ciberrato and what agents need.
    secret_seeds : frozenset of int
        Those of the seeds that published reports leave out.
    """

    __repr__ = short_repr

    title: str
    agents: tuple[Agent, ...]
    labs: tuple[GradedLab, ...]
    seeds: tuple[int, ...]
    lockstep: bool
    speed: float
    answer_limit: float | None
    limits: Limits
    points: Points
    readable: tuple[Path, ...] = ()
    tournament: TournamentSettings = DEFAULT
    image: str | None = None
    secret_seeds: frozenset[int] = frozenset()

    def hides(self, lab: GradedLab, seed: int) -> bool:
        """Return whether published reports leave a run out."""
        return lab.secret or seed in self.secret_seeds


class CourseError(UsageError):
    """A course file cannot be used.

    Attributes
    ----------
    faults : list of str
        A line each.
    """

    def __init__(self, faults: list[str]) -> None:
        super().__init__("\n".join(faults))
        self.faults = faults


def read_course(path: Path) -> Course:
    """Read a course.

    Parameters
    ----------
    path : Path
        Files named in it are looked for from its folder.

    Returns
    -------
    Course

    Raises
    ------
    CourseError
        With all faults found, a line each.
    """
    faults: list[str] = []
    course = _course(Fields(read_toml(path), str(path), faults), path.parent)
    if faults:
        raise CourseError(faults)
    return course


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file; what is wrong with it is a `CourseError` of one line."""
    try:
        return tomllib.loads(read_file(path).decode("utf-8"))
    except (UsageError, LabError) as error:
        raise CourseError([str(error)]) from None
    except UnicodeDecodeError:
        raise CourseError([f"{path}: not UTF-8 text"]) from None
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise CourseError([f"{path}: not TOML: {error}"]) from None


def _course(top: Fields, folder: Path) -> Course:
    title = top.text("title", "CiberRato")
    seeds = top.seeds("seeds")
    lockstep = top.choice("pace", ("lockstep", "realtime"), "lockstep") == "lockstep"
    speed = top.number("speed", 1.0, least=0.01)
    answer_limit = top.number("answer_limit", None, least=0.001)
    readable = tuple(folder / name for name in top.texts("readable"))
    for missing in (place for place in readable if not os.path.exists(place)):
        top.fault(f"readable: there is no {missing}")
    image = top.text("image", None)
    limits = _limits(top.table("limits"))
    points = _points(top.table("points"))
    tournament = read_settings(top.table("tournament"))
    labs = tuple(read_graded_lab(table, folder) for table in top.tables("lab"))
    agents = tuple(read_agent(table, folder) for table in top.tables("agent"))
    for kind, names in (("lab", [lab.name for lab in labs]), ("agent", [agent.name for agent in agents])):
        for name in sorted({name for name in names if names.count(name) > 1}):
            top.fault(f"{kind}: the name {name!r} occurs more than once")
    if labs and sum(lab.weight for lab in labs) <= 0.0:
        top.fault("lab: no weight is greater than 0")
    top.end()
    return Course(
        title,
        agents,
        labs,
        seeds,
        lockstep,
        speed or 1.0,
        answer_limit,
        limits,
        points,
        readable,
        tournament,
        image,
    )


def grid_of(lab: str, grid: str | Path | None) -> Path | None:
    """Find the start grid that goes with a lab.

    Parameters
    ----------
    lab : str
        As the user names it.
    grid : str or Path or None
        As the user names it; None = the one that ships under the lab's name, if one does.

    Returns
    -------
    Path or None
        Absolute; None = the simulator's own.

    Raises
    ------
    UsageError
        If there is no such grid.
    """
    if grid is None and lab not in shipped.names("grid"):
        return None
    return find_grid(lab if grid is None else grid).absolute()


def read_graded_lab(table: Fields, folder: Path) -> GradedLab:
    """Read a lab of a course; what is wrong is noted in the table's faults."""
    name = table.name()
    position = int(table.number("position", 1, least=1, most=255, whole=True) or 1)

    def found(key: str, find: object, default: str | None) -> Path | None:
        given = table.text(key, default)
        if given is None:
            return None
        try:
            beside = folder / given
            return find(beside if os.path.isfile(beside) else given).resolve()  # type: ignore[operator, no-any-return]
        except CiberratoError as error:
            table.fault(f"{key}: {error}")
            return None

    lab: Path | None
    grid: Path | None
    if table.has("random"):
        for other in ("lab", "grid"):
            if table.has(other):
                table.fault(f"{other}: random makes one")
        lab, grid = random_files(table.table("random"), position) or (None, None)
    else:
        lab, grid = found("lab", find_lab, name), found("grid", find_grid, None)
    parameters = found("parameters", find_parameters, None)
    settings = table.settings("set")
    try:
        if lab is not None:
            read_lab(lab)
        places = len((default_grid() if grid is None else read_grid(grid)).positions)
        if position > places:
            table.fault(f"position: the start grid has places 1 to {places}, not {position}")
        read, warnings = parse_parameters_with_warnings(parameters_document(parameters, settings), "set")
        if settings:
            for warning in warnings:
                table.fault(warning)
            if not read.sim_time and not warnings:
                table.fault("set: SimTime: a run of a course has to end, 0 is without end")
    except CiberratoError as error:
        table.fault(str(error))
    scoring = int(table.number("scoring", 0, least=0, most=7, whole=True) or 0)
    weight = table.number("weight", 1.0, least=0.0)
    table.end()
    return GradedLab(
        name, lab or folder, grid, parameters, settings, scoring, 1.0 if weight is None else weight, position
    )


def parameters_document(path: Path | None, settings: tuple[tuple[str, str], ...]) -> bytes:
    """Write a parameter file: that of a lab, with its settings on top.

    Parameters
    ----------
    path : Path or None
        None = the simulator's own parameters.
    settings : tuple of (str, str)

    Returns
    -------
    bytes
        XML.

    Raises
    ------
    CiberratoError
        If the file cannot be read.
    """
    data = b"<Parameters/>" if path is None else read_file(path)
    if not settings:
        return data
    from ciberrato.files.xml_document import parse_elements

    elements = parse_elements(data, str(path), "a parameter")
    attributes: dict[str, str] = {}
    for element in elements:
        if element.name == "Parameters":
            attributes |= element.attributes
    written = " ".join(f"{name}={quoteattr(value)}" for name, value in (attributes | dict(settings)).items())
    return f"<Parameters {written}/>\n".encode()


def _limits(table: Fields) -> Limits:
    default = Limits()
    values = {}
    for key in Limits.__slots__:
        usual = getattr(default, key)
        values[key] = table.number(
            key, usual, least=1 if isinstance(usual, int) else 0.1, most=MOST, whole=isinstance(usual, int)
        )
    table.end()
    return Limits(**values)  # type: ignore[arg-type]


def _points(table: Fields) -> Points:
    text = table.text("formula", "merit") or "merit"
    formula = Formula("0", frozenset())
    try:
        formula = Formula(text, QUANTITIES)
    except UsageError as error:
        table.fault(f"formula: {error}")
    maximum = table.number("maximum", None, least=0.001)
    passing = table.number("passing", None)
    table.end()
    return Points(formula, maximum, passing)
