"""A run to be done: which agent, which lab, which seed, and what all of it depends on."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

from ciberrato.grading.course import Agent, Course, GradedLab, parameters_document
from ciberrato.grading.workspace import digest_folder
from ciberrato.version import __version__

FORMAT = 1


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
    common = {
        "format": FORMAT,
        "version": __version__,
        "lockstep": course.lockstep,
        "speed": course.speed,
        "answer_limit": course.answer_limit,
        "limits": asdict(course.limits),
    }
    tasks = []
    for number, agent in enumerate(course.agents, 1):
        program = {
            "name": agent.name,
            "command": agent.command,
            "build": agent.build,
            "environment": agent.environment,
            "files": None if agent.folder is None else digest_folder(agent.folder),
        }
        if agent.commit is not None:
            program["commit"] = agent.commit
        for lab in course.labs:
            world = {
                "name": lab.name,
                "lab": _digest(lab.lab),
                "grid": None if lab.grid is None else _digest(lab.grid),
                "parameters": parameters_document(lab.parameters, lab.settings).decode("latin-1"),
                "scoring": lab.scoring,
                "position": lab.position,
            }
            for seed in course.seeds:
                text = json.dumps([common, program, world, seed], sort_keys=True)
                key = hashlib.sha256(text.encode()).hexdigest()[:32]
                file = f"{number:03d}-{_plain(agent.name)}-{_plain(lab.name)}-{seed}-{key[:8]}"
                tasks.append(Task(agent, lab, seed, key, file))
    return tasks


@cache
def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _plain(name: str) -> str:
    """Turn a name into part of a file's, whatever is in it."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:30] or "x"
