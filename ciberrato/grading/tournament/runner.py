"""Does the runs of a tournament side by side, and keeps each as soon as it is done: a line of JSON a run."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

from ciberrato.grading.course import Course
from ciberrato.grading.launch import RunError
from ciberrato.grading.leftovers import temporary_folder
from ciberrato.grading.outcome import Outcome
from ciberrato.grading.runner import add_run, open_runs, outcome_of, read_kept, side_by_side
from ciberrato.grading.tournament.launch import MatchLauncher
from ciberrato.grading.tournament.matches import Match
from ciberrato.progress import ProgressBar

Parts = list[tuple[Outcome, dict[str, Any]]]


def read_matches(path: Path) -> dict[str, Parts]:
    """Read what was done.

    Parameters
    ----------
    path : Path
        A file that is not there holds nothing.

    Returns
    -------
    dict
        By the match's key outcome and measurements of each agent, in order of the start places.

    Raises
    ------
    LabError
        If a line other than the last is no run.
    """
    return read_kept(path, lambda document: [outcome_of(part) for part in document["agents"]])


def play(
    course: Course,
    matches: Sequence[Match],
    folder: Path,
    *,
    sandbox: str,
    jobs: int,
    progress: TextIO | None,
) -> list[str]:
    """Execute the missing runs; parameters, result and errors as in `ciberrato.grading.runner.grade`."""
    path, recordings = folder / "runs.jsonl", folder / "recordings"
    file = open_runs(path, recordings)
    done = read_matches(path)
    missing = [match for match in matches if match.key not in done]
    faults: list[str] = []
    bar = ProgressBar(len(missing), progress)
    with file, temporary_folder() as temporary:
        launcher = MatchLauncher(course, sandbox, recordings, temporary)

        def keep(match: Match, future: Future[Parts]) -> None:
            names = [agent.name for agent in match.agents]
            try:
                parts = future.result()
            except RunError as error:
                faults.append(f"{' against '.join(names)}, {match.lab.name}, seed {match.seed}: {error}")
                return
            document = {
                "key": match.key,
                "lab": match.lab.name,
                "seed": match.seed,
                "round": match.meeting.round,
                "group": match.meeting.group,
                "turn": match.meeting.turn,
                "agents": [
                    {"agent": agent, "outcome": asdict(outcome), "measured": measured}
                    for agent, (outcome, measured) in zip(names, parts, strict=True)
                ],
            }
            add_run(file, document)
            bar.step()

        side_by_side(missing, launcher.play, launcher.end, jobs, keep)
    bar.close()
    return faults
