"""Options of a run, in a marker or in a call: checked, and translated for the grading."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from ciberrato.errors import UsageError, did_you_mean

WORLD: Final[dict[str, Any]] = {
    "lab": "maze",
    "grid": None,
    "parameters": None,
    "settings": {},
    "scoring": 0,
    "lockstep": True,
    "speed": 1.0,
    "answer_limit": None,
}
"""The world, and its default: of runs, simulators, and checks."""

LIMITS: Final[dict[str, float]] = {
    "time": 60.0,
    "registration": 20.0,
    "build_time": 300.0,
    "memory": 1024,
    "processes": 64,
    "output": 1024,
    "files": 256,
    "disk": 64,
    "silence": 2.0,
}
"""Limits of a run, and their defaults, as in a course."""

AGENT: Final[dict[str, Any]] = {
    "position": 1,
    "name": "robot",
    "folder": None,
    "build": None,
    "environment": {},
    "sandbox": "none",
}

RUN: Final = {**WORLD, **AGENT, **LIMITS}
MARKER: Final = {**RUN, "seeds": None, "seed": 1, "patience": 2.0}


def merged(known: Mapping[str, Any], *given: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Merge options, later ones first.

    Parameters
    ----------
    known : mapping
        All there are, with their defaults.
    *given : mapping
    where : str
        Name of the place in a fault.

    Returns
    -------
    dict

    Raises
    ------
    UsageError
        If there is no such option.
    """
    options = dict(known)
    for one in given:
        for name in one:
            if name not in known:
                listed = ", ".join(known)
                raise UsageError(
                    f"{where}: unknown option {name!r}{did_you_mean(name, known)}; the options are: {listed}"
                )
        options |= one
    return options


def seeds_of(value: object) -> list[int]:
    """Read seeds: whole numbers, or how many, counted from 1.

    Raises
    ------
    UsageError
        If it is neither.
    """
    seeds = list(range(1, value + 1)) if _whole(value) and isinstance(value, int) else value
    if not isinstance(seeds, Iterable) or isinstance(seeds, str):
        seeds = []
    seeds = list(seeds)
    if not seeds or not all(_whole(seed) for seed in seeds) or len(set(seeds)) < len(seeds):
        raise UsageError(
            f"seeds={value!r}: different whole numbers from 0 were expected, as in [1, 2, 3], or how many"
        )
    return seeds


def _whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def command_words(command: str | Sequence[str]) -> tuple[str, ...]:
    """Split a command line into words, as a shell does; a list of words stays as it is.

    Raises
    ------
    UsageError
        If it is none, or has a placeholder that nothing can be filled in for.
    """
    from ciberrato.grading.agents import command_faults

    try:
        words = shlex.split(command) if isinstance(command, str) else [str(word) for word in command]
    except ValueError as error:
        raise UsageError(f"command {command!r}: {error}") from None
    if not words:
        raise UsageError("the command line is empty")
    for fault in command_faults(words):
        raise UsageError(f"command: {fault}")
    return tuple(words)


def found(name: str | Path, folders: Sequence[Path]) -> str:
    """Find a file beside the tests, or where they were started; else return its name as it is."""
    for folder in folders:
        if (folder / name).is_file():
            return str((folder / name).absolute())
    return str(name)


def lab_of(options: Mapping[str, Any], folders: Sequence[Path]) -> Any:
    """Create the world that options describe.

    Parameters
    ----------
    options : mapping
        All of `WORLD`, and ``position`` if the lab is for a run.
    folders : sequence of Path
        Folders in which files are looked for.

    Returns
    -------
    ciberrato.grading.course.GradedLab

    Raises
    ------
    CiberratoError
        If a file is not there, or cannot be used.
    """
    from ciberrato.files.lab import read_lab
    from ciberrato.files.parameters import parse_parameters_with_warnings
    from ciberrato.grading.course import GradedLab, grid_of, parameters_document
    from ciberrato.labs import find_lab, find_parameters
    from simulator_stub.options import SCORING_MODES

    lab, grid, parameters = (
        None if options[name] is None else found(options[name], folders)
        for name in ("lab", "grid", "parameters")
    )
    if lab is None:
        raise UsageError("lab=None: a lab is needed, a file or the name of one that ships")
    numbers = {name: number for number, name in SCORING_MODES.items()} | {
        number: number for number in SCORING_MODES
    }
    scoring = options["scoring"]
    if scoring not in numbers:
        listed = ", ".join(f"{number} {name}" for number, name in SCORING_MODES.items())
        raise UsageError(f"scoring={scoring!r}: no such mode; choose one of {listed}")
    settings = tuple((name, str(value)) for name, value in sorted(options["settings"].items()))
    path = None if parameters is None else find_parameters(parameters).absolute()
    _, warnings = parse_parameters_with_warnings(parameters_document(path, settings), "settings")
    if settings and warnings:
        raise UsageError(warnings[0])
    place = find_lab(lab).absolute()
    read_lab(place)
    return GradedLab(
        Path(lab).stem if place == Path(lab) else str(options["lab"]),
        place,
        grid_of(str(options["lab"]), grid),
        path,
        settings,
        numbers[scoring],
        position=options.get("position", 1),
    )


def limits_of(options: Mapping[str, Any]) -> Any:
    """Create the limits that options describe; returns `ciberrato.grading.course.Limits`."""
    from ciberrato.grading.course import Limits

    values = {name: options[name] for name in LIMITS}
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < 1e9:
            raise UsageError(f"{name}={value!r}: a number greater than 0 was expected")
    values["build"] = values.pop("build_time")
    return Limits(**values)


def agent_of(options: Mapping[str, Any], command: tuple[str, ...], folder: Path) -> Any:
    """Create the agent that options describe; returns `ciberrato.grading.course.Agent`."""
    from ciberrato.grading.course import Agent

    build = None if options["build"] is None else command_words(options["build"])
    environment = tuple((str(name), str(value)) for name, value in sorted(options["environment"].items()))
    return Agent(str(options["name"]), command, folder, build, environment)
