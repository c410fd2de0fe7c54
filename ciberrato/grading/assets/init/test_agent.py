"""Runs the agent as the course does, and by itself: `python -m pytest`.

The fixtures `ciberrato_run` and `ciberrato_check` come with ciberrato; log and picture of failures are kept.
"""

import csv
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent
AGENT = tomllib.loads((HERE / "course.toml").read_text(encoding="utf-8"))["agent"][0]
OPTIONS = {"folder": str(HERE / AGENT["folder"]), "build": AGENT.get("build")}


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


@pytest.mark.ciberrato(lab="maze", seeds=[1, 2], settings={"SimTime": 200})
def test_it_leaves_its_place(ciberrato_run: Callable[..., Any]) -> None:
    """Test that it drives: further tests of what it is to do in a lab go here."""
    run = ciberrato_run(AGENT["command"], **OPTIONS)
    assert run.status in ("finished", "time over")
    assert abs(run.truth.x - run.truth.x[0]).max() + abs(run.truth.y - run.truth.y[0]).max() > 1.0


@pytest.mark.parametrize("row", ["answers", "unasked", "lost", "doubled", "late"])
def test_it_keeps_to_the_protocol(ciberrato_check: Callable[..., Any], row: str) -> None:
    """Test that it copes with what networks do; `ciberrato-grade check --list` has all rows."""
    ciberrato_check(AGENT["command"], row, **OPTIONS)
