"""A run to be done: which agent, which lab, which seed, and what all of it depends on."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

from ciberrato.files.xml import read_file
from ciberrato.grading.course import Agent, Course, GradedLab, parameters_document
from ciberrato.grading.workspace import digest_folder
from ciberrato.reprs import short_repr
from ciberrato.version import __version__

FORMAT = 2


@dataclass(frozen=True, slots=True)
class Task:
    """A run.

    Attributes
    ----------
    agent, lab, seed
    key : str
        Digest of everything that decides what comes of it.
    file : str
        Name of its recording, without the suffix.
    """

    __repr__ = short_repr

    agent: Agent
    lab: GradedLab
    seed: int
    key: str
    file: str


def tasks_of(course: Course) -> list[Task]:
    """List the runs of a course: by agent, lab and seed, in the course's order.

    Parameters
    ----------
    course : Course

    Returns
    -------
    list of Task

    Raises
    ------
    UsageError
        If an agent's files cannot be read.
    """
    common = of_course(course)
    tasks = []
    for number, agent in enumerate(course.agents, 1):
        program = of_agent(agent)
        for lab in course.labs:
            world = of_lab(lab)
            for seed in course.seeds:
                key = digest_of([common, program, world, seed])
                file = f"{number:03d}-{file_part(agent.name)}-{file_part(lab.name)}-{seed}-{key[:8]}"
                tasks.append(Task(agent, lab, seed, key, file))
    return tasks


def of_course(course: Course) -> dict[str, Any]:
    """Return what of a course all its runs depend on."""
    return {
        "format": FORMAT,
        "version": __version__,
        "lockstep": course.lockstep,
        "speed": course.speed,
        "answer_limit": course.answer_limit,
        "limits": asdict(course.limits),
        **({} if course.image is None else {"image": course.image}),
    }


def of_agent(agent: Agent) -> dict[str, Any]:
    """Return what an agent's runs depend on: command, build, environment, and all of its files."""
    program: dict[str, Any] = {
        "name": agent.name,
        "command": agent.command,
        "build": agent.build,
        "environment": agent.environment,
        "files": None if agent.folder is None else digest_folder(agent.folder),
    }
    return program if agent.commit is None else program | {"commit": agent.commit}


def of_lab(lab: GradedLab) -> dict[str, Any]:
    """Return what the runs in a lab depend on."""
    return {
        "name": lab.name,
        "lab": _digest(lab.lab),
        "grid": None if lab.grid is None else _digest(lab.grid),
        "parameters": parameters_document(lab.parameters, lab.settings).decode("latin-1"),
        "scoring": lab.scoring,
        "position": lab.position,
    }


def digest_of(parts: Sequence[Any]) -> str:
    """Compute the key of a run from what it depends on."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:32]


@cache
def _digest(path: Path) -> str:
    return hashlib.sha256(read_file(path)).hexdigest()


def file_part(name: str, most: int = 30) -> str:
    """Convert any name into part of a file's name, of at most so many characters."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:most] or "x"
