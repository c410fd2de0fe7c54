"""Runs the agent as the course does, and looks at what came of it: `python -m pytest`."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent


@pytest.fixture(scope="session")
def runs() -> list[dict[str, str]]:
    """Return the rows of the results, one per lab and seed; runs with unchanged files are not repeated."""
    report = HERE / "report"
    words = ["ciberrato.grading", str(HERE / "course.toml"), "--output", str(report), "--quiet"]
    subprocess.run([sys.executable, "-m", *words], check=True, timeout=1200)
    with (report / "results.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_it_lives_through_every_run(runs: list[dict[str, str]]) -> None:
    """Test that it neither crashes, nor falls silent, nor is stopped by a limit."""
    bad = [run for run in runs if run["status"] not in ("finished", "time over")]
    assert not bad, "\n".join(
        f"{run['lab']}, seed {run['seed']}: {run['status']} {run['detail']}" for run in bad
    )


def test_it_answers_every_cycle(runs: list[dict[str, str]]) -> None:
    """Test that it answers every cycle: without an answer the last command stays in force."""
    assert {
        f"{run['lab']}, seed {run['seed']}": run["unanswered"] for run in runs if run["unanswered"] != "0"
    } == {}


def test_it_makes_points(runs: list[dict[str, str]]) -> None:
    """Test that it makes points in at least one run."""
    assert max(float(run["points"]) for run in runs) > 0.0
