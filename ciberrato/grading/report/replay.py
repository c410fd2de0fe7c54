"""The command lines that do a run again, without the grading: for those who want to look into it."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from ciberrato.errors import CiberratoError
from ciberrato.grading.course import parameters_document
from ciberrato.grading.task import file_part
from ciberrato.grading.telling import shown
from ciberrato.labs import find_grid, find_lab

if TYPE_CHECKING:
    from collections.abc import Callable

    from ciberrato.grading.course import Agent, Course, GradedLab
    from ciberrato.grading.runner import Graded

_HOST, _PORT = "127.0.0.1", "6000"


def parameter_files(course: Course) -> dict[str, str]:
    """Return the parameter files of labs that have settings of their own, by name in the report's folder."""
    return {
        _parameters(lab): parameters_document(lab.parameters, lab.settings).decode("utf-8", "replace")
        for lab in course.labs
        if not lab.secret and (lab.parameters or lab.settings)
    }


def replay(run: Graded, course: Course) -> str:
    """Write the commands that do a run again.

    Parameters
    ----------
    run : Graded
    course : Course

    Returns
    -------
    str
        Lines for a shell: the simulator with a viewer, then each agent, in its own folder. Files are named
        without their folders, those of the report (parameters) from its folder.
    """
    lab = run.task.lab
    words = ["ciberrato-simulator", "--lab", _named(lab.lab, find_lab, "_lab.xml")]
    if lab.grid is not None:
        words += ["--grid", _named(lab.grid, find_grid, "_grid.xml")]
    if lab.parameters or lab.settings:
        words += ["--param", _parameters(lab)]
    match = getattr(run, "match", None)
    agents: list[Agent] = [run.task.agent] if match is None else list(match.agents)
    words += ["--scoring", str(lab.scoring), "--seed", str(run.task.seed)]
    words += ["--lockstep"] if course.lockstep else ["--speed", f"{course.speed:g}"]
    words += ["--autostart", str(len(agents)), "--exit-at-end", "--view"]
    lines = [shlex.join(words)]
    for number, agent in enumerate(agents, 1):
        values = {
            "{host}": _HOST,
            "{port}": _PORT,
            "{pos}": str(lab.position if match is None else number),
            "{lab}": lab.name,
            "{name}": agent.name,
            "{seed}": str(run.task.seed),
        }
        command = list(agent.command)
        for name, value in values.items():
            command = [word.replace(name, value) for word in command]
        lines.append(shlex.join(command))
    return "\n".join(shown(line) for line in lines)


def _named(path: Path, find: Callable[[str], Path], ending: str) -> str:
    """Name a file: by its short name if it ships, else without its folder."""
    short = path.name.removesuffix(ending)
    try:
        return short if find(short).resolve() == path else path.name
    except CiberratoError:
        return path.name


def _parameters(lab: GradedLab) -> str:
    return f"parameters/{file_part(lab.name)}.xml"
