"""Outcome of a run: in numbers, and in a few words."""

from __future__ import annotations

import os
import signal
import stat
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ciberrato.files.map_scores import mapping_score, planning_score
from ciberrato.reprs import short_repr

MOST_MAP = 1 << 20

GOOD = ("finished", "time over")


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """A run, as seed and agent decide it; no clock has a say in it.

    Attributes
    ----------
    status : str
        ``finished``, ``time over``, ``crashed at N``, ``left at N``, ``silent since N``, ``stopped at N``,
        ``never registered`` or ``not built``.
    detail : str
        More of it, as the exit status.
    score, visited, targets, arrival_time, returning_time, collisions : int
        As the simulator counts them.
    time, sim_time, cycle_time : int
        Cycles run, and at most; milliseconds of a cycle.
    answered, unanswered, late : int
        Cycles, and answers that came after their cycle.
    last_answer : int or None
    mapping, planning : float or None
        Points of the agent's mapping.out and planning.out by the courses' rules; None where the scoring mode
        asks for none.
    """

    __repr__ = short_repr

    status: str
    detail: str = ""
    registered: bool = False
    score: int = 0
    visited: int = 0
    targets: int = 0
    arrival_time: int = 0
    returning_time: int = 0
    collisions: int = 0
    time: int = 0
    sim_time: int = 0
    cycle_time: int = 0
    answered: int = 0
    unanswered: int = 0
    late: int = 0
    last_answer: int | None = None
    mapping: float | None = None
    planning: float | None = None

    @property
    def good(self) -> bool:
        """Return whether the agent lived through the run."""
        return self.status in GOOD

    def quantities(self) -> dict[str, float]:
        """Return what a formula of points may use."""
        values = {
            name: float(value or 0.0) for name, value in asdict(self).items() if not isinstance(value, str)
        }
        values.pop("last_answer")
        return values | {
            "finished": float(self.status == "finished"),
            "crashed": float(self.status.startswith(("crashed", "stopped"))),
            "silent": float(self.status.startswith("silent")),
        }


def judge(
    document: Mapping[str, Any], *, targets: int, cycle_time: int, folder: Path, reference: Path, scoring: int
) -> Outcome:
    """Return what came of a run.

    Parameters
    ----------
    document : mapping
        As `ciberrato.grading.supervisor` writes it.
    targets : int
        Targets of the lab.
    cycle_time : int
        Milliseconds.
    folder : Path
        Working folder of the agent.
    reference : Path
        Folder of the simulator's mapping.out and planning.out.
    scoring : int
        Mode.

    Returns
    -------
    Outcome
    """
    run = document["run"]
    if not document["registered"] or not run or not run["robots"]:
        detail = document["note"] or document["stopped"] or exit_words(document) or "the run did not start"
        return Outcome(status="never registered", detail=detail, targets=targets)
    robot = run["robots"][0]
    lockstep = robot.get("lockstep", {})
    status, detail = _status(document, run, robot)
    mapping, planning = judge_maps(folder, reference, scoring)
    return Outcome(
        status=status,
        detail=detail,
        registered=True,
        score=robot["score"],
        visited=len(robot["visited"]),
        targets=targets,
        arrival_time=robot["arrival_time"],
        returning_time=robot["returning_time"],
        collisions=robot["collisions"],
        time=run["time"],
        sim_time=run["sim_time"],
        cycle_time=cycle_time,
        answered=robot["answered"],
        unanswered=robot["unanswered"],
        late=lockstep.get("late", 0) + robot["caught_up"],
        last_answer=robot["last_answer"],
        mapping=mapping,
        planning=planning,
    )


def _status(document: Mapping[str, Any], run: Mapping[str, Any], robot: Mapping[str, Any]) -> tuple[str, str]:
    silent = robot["silent_since"]
    at = run["time"] if silent is None else silent
    if document["stopped"]:
        return f"stopped at {at}", document["stopped"]
    if robot["state"] == "Finished":
        return "finished", ""
    if silent is None:
        return ("time over", "") if run["state"] == "Finished" else (f"left at {at}", exit_words(document))
    if document["signal"] or document["exit"]:
        return f"crashed at {at}", exit_words(document)
    if document["exit"] == 0:
        return f"left at {at}", exit_words(document)
    return f"silent since {at}", ""


def exit_words(document: Mapping[str, Any]) -> str:
    """Return how a process ended: by which signal, with which status; nothing if it did not by itself."""
    if document["signal"]:
        try:
            return f"signal {signal.Signals(document['signal']).name}"
        except ValueError:
            return f"signal {document['signal']}"
    return "" if document["exit"] is None else f"exit status {document['exit']}"


def judge_maps(folder: Path, reference: Path, scoring: int) -> tuple[float | None, float | None]:
    """Judge an agent's mapping.out and planning.out.

    Parameters
    ----------
    folder, reference : Path
        Folders of the agent's files and the simulator's.
    scoring : int
        Mode: 2 and 5 ask for a map, 3 and 6 for a map and a tour.

    Returns
    -------
    mapping, planning : float or None
        Points; 0 for a file that is not there; None for what the mode does not ask for.
    """
    name = {2: "mapping.out", 5: "mapping.out", 3: "planning.out", 6: "planning.out"}.get(scoring)
    if name is None:
        return None, None
    wanted = _text(reference / name) or ""
    drawn = _text(folder / "mapping.out")
    mapping = 0.0 if drawn is None else round(mapping_score(wanted, drawn), 6)
    if name == "mapping.out":
        return mapping, None
    tour = _text(folder / "planning.out")
    try:
        return mapping, 0.0 if tour is None else round(planning_score(wanted, tour), 6)
    except (ValueError, IndexError, ZeroDivisionError):
        return mapping, 0.0


def _text(path: Path) -> str | None:
    """Read a file that an agent has written: no link, no pipe, not without end."""
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    except OSError:
        return None
    with os.fdopen(descriptor, "rb") as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            return None
        return file.read(MOST_MAP).decode("utf-8", "replace")
