"""Every page whose code could be run is run by a test; here are those that no other test has."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest

from ciberrato import find_grid, find_lab, read_grid, read_lab
from ciberrato.client import Robot
from ciberrato.world.parameters import Parameters
from simulator_stub.recording.log import LogFile
from simulator_stub.simulation import Simulation

ROOT = Path(__file__).parents[2]
PAGES = sorted([*(ROOT / "docs").rglob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"])
BLOCK = re.compile(r"^```(?:python|\{code-cell\}.*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(name):
    return BLOCK.findall((ROOT / name).read_text())


@cache
def all_tests():
    return "".join(path.read_text() for path in (ROOT / "tests").rglob("test_*.py"))


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)], ids=lambda page: page.name)
def test_a_page_with_code_is_run_by_a_test(page):
    assert f'"{page.name}"' in all_tests() or f"/{page.name}" in all_tests()


def test_a_simulators_log_is_read_as_the_page_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    lab, grid = read_lab(find_lab("maze")), read_grid(find_grid("maze"))
    simulation = Simulation(lab, grid, Parameters(sim_time=5), seed=1)
    file = LogFile(tmp_path / "run.log", "then")
    with Robot("r", simulation=simulation) as robot:
        for _ in robot:
            file.actions_read(simulation)
            robot.drive(0.1, 0.1)
    file.world_ended(simulation)
    file.close()
    (program,) = blocks("docs/" + "log.md")
    names = {}
    exec(compile(program, "docs/log.md", "exec"), names)
    first, *lines = capsys.readouterr().out.splitlines()
    assert first == f"{lab.name} 5 (1,) True"
    assert [int(line.split()[0]) for line in lines] == [0, 1, 2, 3, 4]  # what the robots did in cycles 0 to 4
    assert len(list(names["stream"])) == 5


def test_outcomes_are_read_as_the_page_says(tmp_path, monkeypatch, capsys):
    pytest.importorskip("pandas", reason="the extra tables is not installed")
    monkeypatch.chdir(tmp_path)
    from ciberrato.evaluation.cli import main

    words = "--lab maze --start grid --drive right --compass on --cycles 20 --seeds 1 --output judged.jsonl"
    assert main([*words.split(), "--quiet"]) == 0
    capsys.readouterr()
    (program,) = blocks("docs/" + "pose-localization.md")
    exec(compile(program, "docs/pose-localization.md", "exec"), {})
    assert "maze" in capsys.readouterr().out
