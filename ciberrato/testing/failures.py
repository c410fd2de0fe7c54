"""Files kept of a test that has failed, and its report."""

from __future__ import annotations

import hashlib
import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from ciberrato.labs import find_grid, find_lab, names
from ciberrato.plaintext import plain
from ciberrato.testing.picture import picture_command
from ciberrato.testing.runs import AgentRun, result_of
from ciberrato.testing.simulators import RunningSimulator

_MOST_KEPT = 10
"""Runs of one test of which all is kept."""

_MOST_NAMES = 20
_LAST_LINES = 12


def folder_of(test: str) -> str:
    """Name the folder of a test.

    Parameters
    ----------
    test : str
        Its node id; different ones get different folders.

    Returns
    -------
    str
    """
    digest = hashlib.sha256(test.encode()).hexdigest()[:6]
    return f"{re.sub(r'[^A-Za-z0-9_.]+', '-', test).strip('-.')[:80]}-{digest}"


def keep(runs: Sequence[AgentRun | RunningSimulator], folder: Path, *, test: str, start: Path) -> list[str]:
    """Keep the files of runs, and report where.

    Parameters
    ----------
    runs : sequence of AgentRun or RunningSimulator
        The latter are stopped.
    folder : Path
        Made anew.
    test : str
        Node id, for the command that runs it again.
    start : Path
        Paths are reported relative to this folder.

    Returns
    -------
    list of str
        Lines for people.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder.parent / ".gitignore").write_text(
        "*\n", encoding="utf-8", newline="\n"
    )  # it is not for the repository
    lines: list[str] = []
    for number, run in enumerate(runs[:_MOST_KEPT], 1):
        place = folder / f"run-{number}"
        if isinstance(run, RunningSimulator):
            run.stop()
        shutil.copytree(run.folder, place, symlinks=True)
        shown = Path(os.path.relpath(place, start))
        head, outcome, output = _words(run)
        picture = _picture(run, place, outcome)
        lines += [f"run {number}: {plain(head)}", f"  outcome   {plain(outcome)}"]
        said = [f"| {plain(line)}" for line in output.strip().splitlines()[-_LAST_LINES:]]
        lines += _labelled("it said", said or ["nothing"])
        lines += _labelled("picture", [picture if picture.startswith("none") else str(shown / picture)])
        lines += _labelled("kept in", [f"{shown}{os.sep}", ", ".join(_listed(place))])
        lines += _labelled(
            "watch it", [shlex.join(["ciberrato-viewer", "--open", "--run", str(shown / "log.xml")])]
        )
        lines += _labelled("by hand", _by_hand(run, shown))
    if len(runs) > _MOST_KEPT:
        lines.append(f"{len(runs) - _MOST_KEPT} more runs of this test are not kept")
    lines.append(f"the test again: {shlex.join(['python', '-m', 'pytest', test])}")
    return lines


def _labelled(label: str, texts: Sequence[str]) -> list[str]:
    """Add a label before the first of several lines."""
    return [f"  {label if number == 0 else '':9s} {text}" for number, text in enumerate(texts)]


def _listed(place: Path) -> list[str]:
    """List what is in a folder; what the agent wrote by name."""
    found = sorted(path.relative_to(place).as_posix() for path in place.rglob("*") if path.is_file())
    return found[:_MOST_NAMES] + ["..."] * (len(found) > _MOST_NAMES)


def _words(run: AgentRun | RunningSimulator) -> tuple[str, str, str]:
    """Return what was run, what came of it, and the last that was said."""
    if isinstance(run, AgentRun):
        head = f"{shlex.join(run.command)} in {run.lab}, seed {run.seed}"
        outcome = repr(run).partition(": ")[2].rstrip(">")
        return head, outcome, run.output
    result = result_of(run.folder)
    head = f"a simulator of {run._world.name}, seed {run.seed}"
    if result is None:
        return head, "no cycle was run", run.messages
    robots = [
        f"robot {robot['id']}: score {robot['score']}, {robot['collisions']} collisions"
        for robot in result["robots"]
    ]
    return head, "; ".join([f"{result['time']} cycles", *robots]), run.messages


def _picture(run: AgentRun | RunningSimulator, place: Path, outcome: str) -> str:
    """Draw the track; return the picture's name, or why there is none."""
    truth = place / "truth.csv"
    if not truth.is_file() or truth.read_bytes().count(b"\n") < 2:
        return "none: no robot was there"
    title = f"{run._world.name}, seed {run.seed}: {outcome}"[:110]
    words = picture_command(run._world.lab, truth, place / "track.png", title)
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
    except subprocess.TimeoutExpired:
        return "none: drawing it took too long"
    if done.returncode:
        return f"none: {done.stderr.strip().rpartition(chr(10))[2]}"
    return "track.png"


def _short(path: Path, kind: str) -> str:
    """Return the name of what ships, the path of all else."""
    name = path.name.removesuffix(f"_{kind}.xml")
    find = find_lab if kind == "lab" else find_grid
    return (
        name
        if name in names(kind) and not Path(name).exists() and find(name).absolute() == path
        else str(path)
    )


def _by_hand(run: AgentRun | RunningSimulator, shown: Path) -> list[str]:
    """Return command lines that do the run again, in two terminals."""
    world = run._world
    simulator = [
        *("ciberrato-simulator", "--lab", _short(world.lab, "lab")),
        *(("--grid", _short(world.grid, "grid")) if world.grid is not None else ()),
        *("--param", str(shown / "parameters.xml")),
        *(("--scoring", str(world.scoring)) if world.scoring else ()),
        *("--seed", str(run.seed), "--autostart", "1", *(("--lockstep",) if run._lockstep else ())),
    ]
    lines = [shlex.join(simulator)]
    if isinstance(run, AgentRun):
        values = {"{host}": "127.0.0.1", "{port}": "6000", "{pos}": str(world.position), "{lab}": world.name}
        values |= {"{name}": "robot", "{seed}": str(run.seed)}
        words = []
        for word in run.command:
            for name, value in values.items():
                word = word.replace(name, value)
            words.append(word)
        lines.append(f"{shlex.join(words)}    (in a second terminal)")
    return lines
