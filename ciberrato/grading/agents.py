"""The agents of a course."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ciberrato.grading.fields import Fields
from ciberrato.reprs import short_repr

PLACEHOLDERS = ("{host}", "{port}", "{pos}", "{lab}", "{name}", "{seed}")


@dataclass(frozen=True, slots=True)
class Agent:
    """An agent.

    Attributes
    ----------
    name : str
    command : tuple of str
        Words, with placeholders.
    folder : Path or None
        Its files; every run works in a copy of them. None = there are none.
    build : tuple of str or None
        Words; run once, in the copy that the runs' copies are made of.
    environment : tuple of (str, str)
    git, ref, inside : str or None
        Address of a repository with its files; branch, tag or commit (None = its own choice); folder in it.
    commit : str or None
        That they are of, once fetched (`ciberrato.grading.repositories`).
    """

    __repr__ = short_repr

    name: str
    command: tuple[str, ...]
    folder: Path | None = None
    build: tuple[str, ...] | None = None
    environment: tuple[tuple[str, str], ...] = ()
    git: str | None = None
    ref: str | None = None
    inside: str | None = None
    commit: str | None = None


def read_agent(table: Fields, folder: Path) -> Agent:
    """Read an agent of a course; what is wrong is noted in the table's faults."""
    name = table.name()
    given = table.text("folder", None)
    git, ref = table.text("git", None), table.text("ref", None)
    inside = given if git is not None else None
    place = None if given is None or git is not None else (folder / given).resolve()
    if git is not None:
        git = str((folder / git).resolve()) if os.path.isdir(folder / git) else git
        if git.startswith("-"):
            table.fault(f"git: {git!r} is no address")
    elif ref is not None:
        table.fault("ref: needs git, the address that it is of")
    if ref is not None and re.fullmatch(r"[A-Za-z0-9_](?!.*\.{2})[\w./+@-]*", ref) is None:
        table.fault(f"ref: {ref!r} is no branch, tag or commit")
    if inside is not None and (Path(inside).is_absolute() or ".." in Path(inside).parts):
        table.fault(f"folder: {inside!r} leads out of the repository")
    if place is not None and not os.path.isdir(place):
        table.fault(f"folder: there is no folder {place}")
    elif place is not None and folder.resolve().is_relative_to(place):
        table.fault(f"folder: {given} holds the course itself; put the agent into a folder of its own")
    command = table.words("command", needed=True) or ()
    for fault in command_faults(command):
        table.fault(f"command: {fault}")
    build = table.words("build")
    environment = table.settings("environment")
    for variable, value in environment:
        if not variable or "=" in variable or "\0" in variable + value:
            table.fault(f"environment: {variable!r} cannot be set to {value!r}")
    table.end()
    if build is not None and place is None and git is None:
        table.fault("build: needs a folder to build in")
    return Agent(name, command, place, build, environment, git, ref, inside)


def command_faults(command: Sequence[str]) -> list[str]:
    """Return what is wrong with the placeholders of a command line.

    Parameters
    ----------
    command : sequence of str
        Words.

    Returns
    -------
    list of str
        A line each.
    """
    faults = []
    for word in command:
        left = word
        for known in PLACEHOLDERS:
            left = left.replace(known, "")
        if "{" in left and "}" in left[left.index("{") :]:
            faults.append(f"{word!r}: these can be filled in: {' '.join(PLACEHOLDERS)}")
    return faults
