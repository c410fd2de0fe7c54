from __future__ import annotations

import dataclasses
import io
import json
import math

import pytest

from ciberrato.labfile import read_lab
from evaluation.cli import main
from evaluation.episode import run_task
from evaluation.labs import judged_labs, public_labs, tuning_labs
from evaluation.report import group_by, kidnapping_line, summary, table
from evaluation.runner import Result, read_results, run_tasks
from evaluation.task import Outcome, Task

SMALL = """<Lab Name="small" Height="6" Width="8">
  <Wall Height="4">
    <Corner X="1.9" Y="2"/><Corner X="2.1" Y="2"/><Corner X="2.1" Y="6"/><Corner X="1.9" Y="6"/>
  </Wall>
  <Wall Height="4">
    <Corner X="5" Y="3.4"/><Corner X="6.1" Y="3.4"/><Corner X="6.1" Y="4.2"/><Corner X="5" Y="4.2"/>
  </Wall>
</Lab>"""


@pytest.fixture(scope="module")
def lab_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("labs") / "small_lab.xml"
    path.write_text(SMALL)
    return path


@pytest.fixture(autouse=True, scope="module")
def cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CIBERRATO_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


def outcome(**fields) -> Outcome:
    known = {
        "cycles": 100,
        "start": [1.0, 1.0, 0.0],
        "room": 50.0,
        "first_right": 30,
        "first_claim": 30,
        "first_claim_wrong": False,
        "claimed": 70,
        "wrongly": 0,
        "final_claim": True,
        "final_place_error": 0.05,
        "final_turn_error": 1.0,
        "collisions": 0,
        "colliding": 0,
        "restarts": [],
        "filter_ms": [1.0, 10.0, 20.0],
        "drive_ms": [1.0, 2.0, 3.0],
    }
    return Outcome(**(known | fields))


def test_the_same_task_has_the_same_outcome_and_knows_the_truth(lab_file):
    task = Task(lab=str(lab_file), start="free", seed=3, cycles=120, resolution=0.2, staged=False)
    first, second = run_task(task), run_task(task)
    same = ("filter_ms", "drive_ms")
    assert {k: v for k, v in first.to_json().items() if k not in same} == {
        k: v for k, v in second.to_json().items() if k not in same
    }
    assert first.first_right is not None
    assert first.truth[-1] > 0.95
    assert first.final_place_error < 0.2
    assert sum(count for count, _ in first.calibration) == 121
    assert all(right <= count for count, right in first.calibration)


def test_a_kidnapping_is_noticed_and_the_run_ends_when_the_robot_is_found(lab_file):
    task = Task(lab=str(lab_file), start="free", seed=4, cycles=400, resolution=0.2, staged=False, kidnap=90)
    result = run_task(task)
    assert result.kidnapped == 90
    assert result.noticed is not None
    assert result.found is not None
    assert result.noticed <= result.found == result.cycles - 90
    assert "found 1, " in str(kidnapping_line([Result(task, result)]))


def test_what_was_run_is_not_run_again_and_torn_lines_are(lab_file, tmp_path):
    tasks = [Task(lab=str(lab_file), seed=seed, cycles=5, resolution=0.5, staged=False) for seed in range(3)]
    path = tmp_path / "out.jsonl"
    bar = io.StringIO()
    first = run_tasks(tasks[:2], path, jobs=1, progress=bar)
    assert "2/2 runs" in bar.getvalue()
    path.write_bytes(path.read_bytes() + b'{"task": {"lab"')
    bar = io.StringIO()
    again = run_tasks(tasks, path, jobs=1, progress=bar)
    assert "1/1 runs" in bar.getvalue()
    assert again[:2] == first
    assert [result.task for result in read_results(path)] == tasks


def test_processes_give_the_results_of_one(lab_file, tmp_path):
    tasks = [Task(lab=str(lab_file), seed=seed, cycles=20, resolution=0.5, staged=False) for seed in range(2)]
    alone = run_tasks(tasks, tmp_path / "a.jsonl", jobs=1, progress=None)
    together = run_tasks(tasks, tmp_path / "b.jsonl", jobs=2, progress=None)
    for one, other in zip(alone, together, strict=True):
        assert one.task == other.task
        assert one.outcome.truth == other.outcome.truth
        assert one.outcome.final_place_error == other.outcome.final_place_error


def test_the_summary_counts_as_it_says():
    task = Task(lab="a")
    never = {"first_right": None, "first_claim": None, "claimed": 0, "final_claim": False, "room": 4.0}
    results = [
        Result(task, outcome(first_right=10)),
        Result(task, outcome(first_right=20, first_claim=12, first_claim_wrong=True, wrongly=7)),
        Result(task, outcome(first_right=40, final_place_error=0.15, collisions=3)),
        Result(task, outcome(**never)),
    ]
    figures = summary(results)
    assert figures["half"] == 40  # two of four is half, and a quantile is not to flatter
    assert math.isinf(figures["90%"])
    assert figures["never%"] == figures["shut%"] == 25.0
    assert figures["wrong 1st%"] == pytest.approx(100 / 3)
    assert figures["wrong time%"] == pytest.approx(100 * 7 / 210)
    assert figures["place med"] == 0.05
    assert figures["place 95%"] == 0.15
    assert figures["coll/1000"] == pytest.approx(7.5)
    lines = table(group_by(results, "lab", "compass")).splitlines()
    assert lines[1].split()[:3] == ["a", "compass", "4"]
    assert "never" in lines[1]


def test_the_command_runs_reports_and_draws(lab_file, tmp_path, capsys):
    path = tmp_path / "out.jsonl"
    common = ["--lab", str(lab_file), "--resolution", "0.5", "--output", str(path), "--quiet"]
    assert main([*common, "--seeds", "2", "--cycles", "30", "--compass", "on", "off", "--jobs", "1"]) == 0
    shown = capsys.readouterr().out
    assert len(shown.splitlines()) == 3
    assert main(["--report", "--output", str(path), "--figures", str(tmp_path / "figures")]) == 0
    assert capsys.readouterr().out.startswith(shown)
    assert len(list((tmp_path / "figures").glob("*.png"))) == 4


@pytest.mark.parametrize(
    "arguments",
    [
        ["--lab", "nowhere"],
        ["--drive", "backwards"],
        ["--report", "--output", "does-not-exist.jsonl"],
        ["--lab", "judged", "--labs", "does-not-exist"],
    ],
)
def test_what_the_user_got_wrong_is_one_line(arguments, capsys):
    assert main(arguments) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_file_of_something_else_is_an_error_with_its_line(tmp_path, capsys):
    path = tmp_path / "x.jsonl"
    path.write_text(json.dumps({"task": dataclasses.asdict(Task(lab="a"))}) + "\n")
    assert main(["--report", "--output", str(path)]) == 2
    assert ":1:" in capsys.readouterr().err


def test_labs_are_chosen_by_the_rule(tmp_path):
    row = '<Lab Width="4" Height="4"><Row Pos="0" Pattern="  |   "/></Lab>'
    line = '<Lab Width="4" Height="4"><Row Pos="0" Pattern="--+   "/></Lab>'
    for event, files in {
        "A": {"b-lab.xml": SMALL, "c-lab.xml": row},
        "B": {"a-lab.xml": line, "b-lab.xml": SMALL.replace("5", "4.5")},
        "C": {"a-lab.xml": SMALL, "z-lab.xml": SMALL.replace("6.1", "6.3")},
        "D": {"a-lab.xml": row},
    }.items():
        (tmp_path / event).mkdir()
        for name, text in files.items():
            (tmp_path / event / name).write_text(text)
    assert [lab.name for lab in public_labs(tmp_path)] == ["A/b-lab", "B/b-lab", "C/z-lab", "D/a-lab"]
    assert [lab.name for lab in judged_labs(tmp_path)] == ["D/a-lab", "B/b-lab"]
    assert [lab.name for lab in tuning_labs(tmp_path)] == ["A/b-lab"]
    assert read_lab(tmp_path / "D" / "a-lab.xml").walls
