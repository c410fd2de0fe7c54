from __future__ import annotations

import dataclasses
import io
import json
import math

import pytest

from ciberrato.evaluation.attempt import Result
from ciberrato.evaluation.cli import main
from ciberrato.evaluation.comparison import compare
from ciberrato.evaluation.episode import run_task
from ciberrato.evaluation.labs import judged_labs, public_labs, tuning_labs
from ciberrato.evaluation.published import Compared, LabTask, Step
from ciberrato.evaluation.report import group_by, kidnapping_line, said_table, summary, table, wilson_interval
from ciberrato.evaluation.runner import read_evaluation, run_tasks
from ciberrato.evaluation.task import SAID, Outcome, Task
from ciberrato.files.lab import read_lab

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


def timeless(one: Outcome) -> dict[str, object]:
    return {k: v for k, v in one.to_json().items() if k not in ("filter_ms", "drive_ms", "ms_counts")}


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
        "final_turn_error_deg": 1.0,
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
    assert timeless(first) == timeless(second)
    assert sum(first.ms_counts) == 121
    assert first.first_right is not None
    assert first.truth[-1] > 0.95
    assert first.final_place_error < 0.2
    assert sum(count for count, _ in first.calibration) == 121
    assert all(right <= count for count, right in first.calibration)


def test_a_kidnapping_is_noticed_and_the_run_ends_when_the_robot_is_found(lab_file):
    runs = [
        Task(lab=str(lab_file), start="free", seed=seed, cycles=400, resolution=0.2, staged=False, kidnap=90)
        for seed in (2, 3, 5)
    ]
    results = [Result(task, run_task(task)) for task in runs]
    assert all(result.outcome.kidnapped == 90 for result in results)
    found = [result.outcome for result in results if result.outcome.found is not None]
    assert len(found) >= 2  # without a challenger, not every one need be
    for one in found:
        assert one.noticed is not None
        assert one.noticed <= one.found == one.cycles - 90
    assert f"found {len(found)}, " in str(kidnapping_line(results))


def test_what_was_run_is_not_run_again_and_torn_lines_are(lab_file, tmp_path):
    tasks = [Task(lab=str(lab_file), seed=seed, cycles=5, resolution=0.5, staged=False) for seed in range(3)]
    path = tmp_path / "out.jsonl"
    bar = io.StringIO()
    first = run_tasks(tasks[:2], path, jobs=1, progress=bar).results
    assert "2/2 runs" in bar.getvalue()
    path.write_bytes(path.read_bytes() + b'{"task": {"lab"')
    bar = io.StringIO()
    again = run_tasks(tasks, path, jobs=1, progress=bar).results
    assert "1/1 runs" in bar.getvalue()
    assert again[:2] == first
    assert read_evaluation(path).results == again


def test_processes_give_the_results_of_one(lab_file, tmp_path):
    tasks = [Task(lab=str(lab_file), seed=seed, cycles=20, resolution=0.5, staged=False) for seed in range(2)]
    alone = run_tasks(tasks, tmp_path / "a.jsonl", jobs=1, progress=None)
    together = run_tasks(tasks, tmp_path / "b.jsonl", jobs=2, progress=None)
    assert len(alone.results) == 2
    for one, other in zip(alone.results, together.results, strict=True):
        assert one.task == other.task
        assert timeless(one.outcome) == timeless(other.outcome)


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_task_that_fails_does_not_lose_the_others_and_is_tried_again(lab_file, tmp_path, jobs, capsys):
    grid = tmp_path / "grid.xml"
    grid.write_text('<Grid><Position X="2" Y="4" Dir="0"/></Grid>')  # in a wall
    common = {"lab": str(lab_file), "cycles": 5, "resolution": 0.5, "staged": False}
    bad = Task(**common, start="grid", grid=str(grid))
    good = Task(**common)
    path = tmp_path / "out.jsonl"
    first = run_tasks([bad, good], path, jobs=jobs, progress=None)
    assert [result.task for result in first.results] == [good]
    assert [failure.task for failure in first.failures] == [bad]
    assert main(["--report", "--output", str(path)]) == 1
    shown = capsys.readouterr()
    assert {len(block.splitlines()) for block in shown.out.split("\n\n")} == {2}  # blocks of columns
    assert shown.err.count("\n") == 1
    assert "1 of 2 runs failed" in shown.err
    assert "start grid" in shown.err
    grid.write_text('<Grid><Position X="4" Y="1" Dir="0"/></Grid>')
    again = run_tasks([bad, good], path, jobs=jobs, progress=None)
    assert not again.failures
    assert [result.task for result in again.results] == [bad, good]
    assert read_evaluation(path).failures == []


def test_what_a_task_raises_is_told_with_its_place(lab_file, tmp_path, monkeypatch):
    def broken(task):
        return 1 / 0

    monkeypatch.setattr("ciberrato.evaluation.episode.run_task", broken)
    result = run_tasks([Task(lab=str(lab_file))], tmp_path / "x.jsonl", jobs=1, progress=None)
    assert result.failures[0].error.startswith("ZeroDivisionError: division by zero (test_evaluation.py:")


def test_a_robot_that_stands_for_good_is_counted_to_the_end(monkeypatch):
    task = Task(lab="maze", drive="right", start="centres", seed=1, cycles=300, resolution=0.5, staged=False)
    short = run_task(task)
    assert short.rested is not None
    assert short.rested < 200
    monkeypatch.setattr("ciberrato.evaluation.episode._AT_REST", 1000)
    whole = run_task(task)
    assert whole.rested is None
    expected, found = timeless(whole), timeless(short)
    differing = {name for name in expected if expected[name] != found[name]}
    assert differing <= {"rested", "given_up"}


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
    assert figures["open never%"] == 0.0
    assert figures["wrong 1st%"] == pytest.approx(100 / 3)
    assert figures["wrong time%"] == pytest.approx(100 * 7 / 210)
    assert figures["place med"] == 0.05
    assert figures["place 95%"] == 0.15
    assert figures["coll/1000"] == pytest.approx(7.5)
    low, high = figures["95% interval"]
    assert low < 100 / 3 < high
    lines = table(group_by(results, "lab", "compass")).splitlines()
    assert lines[1].split()[:3] == ["a", "compass", "4"]
    assert "never" in lines[1]


def test_intervals_are_those_of_wilson_score():
    # Newcombe (1998), Statistics in Medicine 17, table I: 81/263, 15/148, 0/20, 1/29.
    for hits, cases, low, high in (
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
    ):
        assert wilson_interval(hits, cases) == pytest.approx((100 * low, 100 * high), abs=0.005)
    assert all(math.isnan(end) for end in wilson_interval(0, 0))


def test_drives_are_compared_by_group_and_slow_groups_once_more_by_the_other_half():
    def runs(lab, drive, times):
        return [
            Result(Task(lab=lab, drive=drive, seed=seed), outcome(first_right=time))
            for seed, time in enumerate(times)
        ]

    results = [
        *runs("quick", "explore", [10, 20, 30, 40]),
        *runs("quick", "active", [20, 20, 30, 40]),
        *runs("slow", "explore", [100, 90, 120, 110]),
        *runs("slow", "active", [50, 60, 40, None]),
        # Slow by its runs with even seeds only, which must not count again.
        *runs("chance", "explore", [200, 10, 200, 10]),
        *runs("chance", "active", [10, 12, 10, 12]),
        *runs("alone", "explore", [10]),
    ]
    lines = compare(results, "explore", "active", ["lab"]).splitlines()
    cells = {line.split()[0]: line.split()[1:] for line in lines[1:4]}
    assert cells["quick"] == ["4/4", "30", "30", "40", "40", "1.00", "1.00"]
    assert cells["slow"] == ["4/4", "110", "60", "120", "never", "0.55", "never", "slow"]
    assert "alone" not in cells
    halves = lines[-1]
    assert "2 groups" in halves
    assert "half 90 / 60 cycles" in halves
    assert "90% 110 / never cycles" in halves
    assert compare(results, "explore", "right", ["lab"]) == "no group has runs of both explore and right"


def test_the_command_runs_reports_and_draws(lab_file, tmp_path, capsys):
    path = tmp_path / "out.jsonl"
    common = ["--lab", str(lab_file), "--resolution", "0.5", "--output", str(path), "--quiet"]
    assert main([*common, "--seeds", "2", "--cycles", "30", "--compass", "on", "off", "--jobs", "1"]) == 0
    shown = capsys.readouterr().out
    assert [line.split()[0] for line in shown.splitlines()[1:4]] == ["group", "compass", "no"]
    assert main(["--report", "--output", str(path), "--figures", str(tmp_path / "figures")]) == 0
    assert capsys.readouterr().out.startswith(shown)
    assert len(list((tmp_path / "figures").glob("*.png"))) == 5


def test_axes_make_tasks_once(lab_file, tmp_path, capsys):
    path = tmp_path / "out.jsonl"
    common = ["--lab", str(lab_file), "--resolution", "0.5", "--output", str(path), "--quiet", "--jobs", "1"]
    axes = ["--prior", "told", "anywhere", "--gps", "on", "off", "--start", "centres", "free"]
    assert main([*common, *axes, "--seeds", "1", "--cycles", "3"]) == 0
    tasks = [result.task for result in read_evaluation(path).results]
    # From anywhere there is nothing to tell.
    assert sorted((t.start, t.prior, t.gps) for t in tasks) == [
        ("centres", "anywhere", "off"),
        ("centres", "anywhere", "on"),
        ("centres", "centres", "off"),
        ("centres", "centres", "on"),
        ("free", "anywhere", "off"),
        ("free", "anywhere", "on"),
    ]
    assert "told centres GPS on" in capsys.readouterr().out


def test_outcomes_of_older_versions_are_read(tmp_path, capsys):
    path = tmp_path / "old.jsonl"
    task, result = dataclasses.asdict(Task(lab="a")), outcome().to_json()
    del task["gps"], result["rested"], result["ms_counts"]
    path.write_text(json.dumps({"task": task, "outcome": result}) + "\n")
    assert main(["--report", "--output", str(path)]) == 0
    assert capsys.readouterr().out.splitlines()[-1].endswith("12.00")


@pytest.mark.parametrize(
    "arguments",
    [
        ["--lab", "nowhere"],
        ["--drive", "backwards"],
        ["--report", "--output", "does-not-exist.jsonl"],
        ["--lab", "judged", "--labs", "does-not-exist"],
        ["--lab", "judged", "--labs", "."],
        ["--lab", "judged"],
    ],
)
def test_what_the_user_got_wrong_is_one_line(arguments, capsys, tmp_path, monkeypatch):
    monkeypatch.delenv("CIBERRATO_LABS", raising=False)
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_files_with_mistakes_are_told_and_refused_if_asked(tmp_path, capsys):
    lab, parameters = tmp_path / "odd.xml", tmp_path / "p.xml"
    lab.write_text('<Lab Width="8" Heigth="4"/>')
    parameters.write_text('<Parameters MotorsNoise="1,5"/>')
    output = tmp_path / "o.jsonl"
    words = ["--lab", str(lab), "--parameters", str(parameters), "--output", str(output), "--strict"]
    assert main(words) == 2
    errors = capsys.readouterr().err
    assert f"{lab}:1: Lab Heigth=" in errors
    assert f'{parameters}:1: Parameters MotorsNoise="1,5" is not a number and counts as 0' in errors
    assert errors.endswith("--strict: 2 warnings about the files; correct them, or leave it out\n")
    assert not output.exists()


def test_a_file_of_something_else_is_an_error_with_its_line(tmp_path, capsys):
    path = tmp_path / "x.jsonl"
    path.write_text(json.dumps({"task": dataclasses.asdict(Task(lab="a"))}) + "\n")
    assert main(["--report", "--output", str(path)]) == 2
    assert ":1:" in capsys.readouterr().err


def test_public_labs_come_by_option_or_variable(tmp_path, monkeypatch):
    for folder in ("named", "told"):
        for number, event in enumerate(("A", "B")):
            (tmp_path / folder / event).mkdir(parents=True)
            (tmp_path / folder / event / "lab.xml").write_text(SMALL.replace("6.1", f"6.{number + 2}"))
    monkeypatch.setenv("CIBERRATO_LABS", str(tmp_path / "named"))
    common = [
        "--lab",
        "judged",
        "--seeds",
        "1",
        "--cycles",
        "1",
        "--resolution",
        "0.5",
        "--jobs",
        "1",
        "--quiet",
    ]
    for folder, more in (("named", []), ("told", ["--labs", str(tmp_path / "told")])):
        path = tmp_path / f"{folder}.jsonl"
        assert main([*common, *more, "--output", str(path)]) == 0
        labs = {result.task.lab for result in read_evaluation(path).results}
        assert labs == {str(lab.path) for lab in judged_labs(tmp_path / folder)} != set()


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


def test_the_filter_is_held_against_the_published_method(lab_file, capsys):
    assert main(["--published", "--lab", str(lab_file), "--resolution", "0.5", "--seeds", "3"]) == 0
    lines = capsys.readouterr().out.splitlines()
    cells = lines[1].split()
    assert cells[0].endswith("/small_lab")
    assert int(cells[2]) >= int(cells[1]) == 3
    assert all(0.0 < float(cell) <= 1.0 for cell in cells[3:9])
    assert lines[-1].startswith("The pose filter is worse in ")


def test_a_strip_beside_the_cells_belongs_to_the_last_ones(tmp_path, capsys):
    path = tmp_path / "odd.xml"
    path.write_text('<Lab Name="odd" Width="7.5" Height="2"><Beacon X="1" Y="1" Height="4"/></Lab>')
    assert main(["--published", "--lab", str(path), "--resolution", "0.5", "--seeds", "3"]) == 0
    assert len(capsys.readouterr().out.splitlines()) > 1


def test_worse_is_said_where_it_is_so():
    def compared(published, ours):
        return Compared(LabTask("a", 0.1, 1), ((Step(0, published, ours),),))

    assert not compared((0.5, 1.0), (0.5, 1.0)).worse
    assert not compared((0.5, 0.5), (0.9, 1.0)).worse
    assert compared((0.5, 1.0), (0.4, 1.0)).worse
    assert compared((0.5, 1.0), (0.9, 0.0)).worse
    # The last steps count by themselves.
    good, bad = Step(0, (0.1, 0.0), (0.9, 1.0)), Step(1, (0.9, 1.0), (0.5, 1.0))
    assert Compared(LabTask("a", 0.1, 1), ((good, bad),)).worse


def test_a_pose_that_is_right_up_to_the_symmetry_is_counted_apart(tmp_path):
    path = tmp_path / "box.xml"
    path.write_text('<Lab Name="box" Height="4" Width="4"/>')
    common = {"lab": str(path), "start": "free", "seed": 1, "cycles": 90, "resolution": 0.2, "staged": False}
    lost, told = (run_task(Task(**common, compass=compass)) for compass in (False, True))
    assert (lost.equals, lost.first_right) == (3, None)
    assert lost.alike is not None
    assert (told.equals, told.alike) == (0, None)
    assert told.first_right is not None
    taken = [
        Result(Task(**common), outcome(kidnapped=50, equals=3, found=None, alike=at)) for at in (9, None)
    ]
    assert "of 2 in places with equal ones found 0, found up to the equal ones 1" in str(
        kidnapping_line(taken)
    )
    figures = summary([Result(Task(**common), one) for one in (lost, told)])
    assert figures["equal%"] == 50.0


def test_first_estimates_of_a_class_are_compared_with_what_they_said():
    def said(probability, right):
        return outcome(said=[None] * 5 + [[probability, right]] + [None] * 5)

    results = [Result(Task(lab="a"), said(0.6 + 0.001 * (n % 49), n < 40)) for n in range(50)]
    (line,) = [line for line in said_table(results).splitlines() if line.startswith("0.6-")]
    low, high = wilson_interval(40, 50)
    assert line.split() == ["0.6-0.7", "50", "62.4", "80.0", f"{low:.1f}-{high:.1f}", "too", "shy"]
    assert "too" not in said_table([*results, *(Result(Task(lab="a"), said(0.6, False)) for _ in range(14))])


def test_first_estimates_are_those_of_the_run(lab_file):
    one = run_task(Task(lab=str(lab_file), start="free", seed=3, cycles=60, resolution=0.2, staged=False))
    entries = [(low, entry) for low, entry in zip(SAID, one.said, strict=True) if entry is not None]
    assert len(entries) >= 3
    assert all(low <= probability <= 1.0 for low, (probability, _) in entries)
    assert one.said[-1][1] is True
