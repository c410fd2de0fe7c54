"""Filters and drives that others wrote, in evaluations: beside the built-in ones, on the same runs."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from ciberrato.errors import LabError, UsageError
from ciberrato.evaluation import read_results
from ciberrato.evaluation.cli import main
from ciberrato.evaluation.episode import run_task
from ciberrato.evaluation.report import WIDTH, aligned
from ciberrato.evaluation.results import COLUMNS, columns_of
from ciberrato.evaluation.runner import read_evaluation
from ciberrato.evaluation.settings import sweep, with_settings
from ciberrato.evaluation.task import Task
from ciberrato.world.parameters import Parameters

ROOT = Path(__file__).parents[2]
BIN = Path(sys.executable).parent
SMALL = """<Lab Name="small" Height="6" Width="8">
  <Wall Height="4">
    <Corner X="1.9" Y="2"/><Corner X="2.1" Y="2"/><Corner X="2.1" Y="6"/><Corner X="1.9" Y="6"/>
  </Wall>
</Lab>"""
# Claims to be in the lab's middle; keeps what it was told for a look from outside.
OWN = """
from types import SimpleNamespace
made = []
class Middle:
    def __init__(self, setup):
        self.setup, self.seen = setup, []
        made.append(self)
    def observe(self, measures, command):
        self.seen.append((measures.time, measures.infrared, command))
    def estimate(self):
        return SimpleNamespace(x=4.0, y=3.0, heading=0.0, probability=0.996)
def silent(setup):
    return SimpleNamespace(observe=lambda measures, command: None, estimate=lambda: None)
def boasting(setup):
    return SimpleNamespace(
        observe=lambda m, c: None, estimate=lambda: SimpleNamespace(x=0, y=0, heading=0, probability=2))
def raising(setup):
    return SimpleNamespace(observe=lambda measures, command: 1 / 0, estimate=None or (lambda: None))
def nothing(setup):
    return None
class Still:
    def __init__(self, setup):
        self.text = setup.argument
    def decide(self, measures, pose_filter):
        return (0.1, -0.1) if self.text == "turn" else (0.0, 0.0)
number = 7
"""


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def work(tmp_path, monkeypatch, tables):
    """A folder with a lab and a module, which is the working folder and, at last, on the path."""
    (tmp_path / "small_lab.xml").write_text(SMALL)
    (tmp_path / "own_filter.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CIBERRATO_CACHE", str(tables))
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield tmp_path
    sys.modules.pop("own_filter", None)


def task(**fields):
    common = {"lab": "small_lab.xml", "start": "free", "seed": 3, "cycles": 30, "resolution": 0.5}
    return Task(**(common | {"staged": False} | fields))


WORDS = ("--lab", "small_lab.xml", "--resolution", "0.5", "--quiet", "--jobs", "1", "--cycles", "12")


def test_every_filter_sees_the_same_run(work):
    import importlib

    one = run_task(task(filter="own_filter:Middle"))
    two = run_task(task())
    own = importlib.import_module("own_filter")
    (middle,) = own.made
    assert one.start == two.start
    assert one.collisions == two.collisions
    assert one.room == two.room
    assert [time for time, _, _ in middle.seen] == list(range(31))
    assert middle.seen[0][2] is None
    assert middle.setup.start == "anywhere"
    assert (one.claimed, one.wrongly, one.first_claim) == (31, 31, 0)
    assert one.first_claim_wrong
    assert one.truth == []  # it does not say how probable it holds the true pose
    assert two.truth


def test_filters_and_drives_are_evaluated_beside_the_built_in_ones(work, capsys):
    more = ["--filter", "built-in", "own_filter:Middle", "--drive", "explore", "own_filter:Still:turn"]
    assert main([*WORDS, *more, "--seeds", "2", "--output", "e.jsonl", "--table", "e.csv"]) == 0
    shown = capsys.readouterr().out
    lines = shown.splitlines()
    assert lines[0] == "all groups: centres default compass"
    for group in ("explore built-in", "explore own_filter:Middle", "own_filter:Still:turn built-in"):
        assert any(line.startswith(group) for line in lines)
    assert all(len(line) <= WIDTH for line in lines)
    tasks = [result.task for result in read_evaluation(work / "e.jsonl").results]
    assert len(tasks) == 8
    assert {bool(one.code) for one in tasks if one.filter == "built-in" and one.drive == "explore"} == {False}
    assert all(one.code for one in tasks if ":" in one.filter + one.drive)


def test_a_filter_that_was_changed_is_run_again(work, capsys):
    words = [*WORDS, "--filter", "own_filter:Middle", "--seeds", "1", "--output", "e.jsonl"]
    assert main(words) == 0
    assert main(words) == 0
    assert len(read_evaluation(work / "e.jsonl").results) == 1
    (work / "own_filter.py").write_text(OWN.replace("0.996", "0.5"))
    del sys.modules["own_filter"]
    assert main(words) == 0
    assert len(read_evaluation(work / "e.jsonl").results) == 2
    capsys.readouterr()
    assert main(["--report", "--output", "e.jsonl"]) == 0
    shown = capsys.readouterr().out
    assert shown.count("code ") == 2 * shown.count("group ")  # two lines in each block of columns


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ["--filter", "own_filter:number"],
            "filter own_filter:number: 7 is not a function that makes a filter",
        ),
        (["--filter", "own_filter:Midle"], "own_filter has no 'Midle'; did you mean 'Middle'?"),
        (
            ["--filter", "no_such_module:make"],
            "cannot be loaded: ModuleNotFoundError: No module named 'no_such",
        ),
        (["--filter", "reckoner"], "no filter 'reckoner'; there are built-in, and any module:object"),
        (["--drive", "own_filter:number"], "drive own_filter:number: 7 is not a DriveKind, or a function"),
        (["--drive", "goto:3,3"], "write goto; the place is drawn at random"),
        (["--set", "MotorsNoise"], "'MotorsNoise' is not NAME=VALUE,VALUE..."),
        (["--set", "MotorNoise=1"], "did you mean MotorsNoise?"),
        (["--set", "MotorsNoise=a"], "is not a number and counts as 0"),
        (["--set", "MotorsNoise=-1"], "is below 0: write a standard deviation"),
        (["--set", "MotorsNoise=1", "--set", "MotorsNoise=2"], "a parameter is set twice"),
        (["--table", "x.txt"], "its name ends in .csv or .parquet"),
        (["--table", "no/x.csv"], "no folder no; create it"),
    ],
)
def test_what_cannot_be_used_is_one_line_before_anything_is_run(work, capsys, words, said):
    assert main([*WORDS, "--output", "e.jsonl", *words]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (work / "e.jsonl").exists()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("silent", "its estimate is None; not x, y, heading and probability"),
        ("boasting", "2 is not a probability"),
        ("raising", "ZeroDivisionError: division by zero (own_filter.py:"),
        ("nothing", "what it makes is None, which has no method observe"),
    ],
)
def test_a_filter_that_fails_is_a_failure_that_names_it(work, capsys, name, said):
    words = [*WORDS, "--filter", f"own_filter:{name}", "built-in", "--seeds", "1", "--output", "e.jsonl"]
    assert main(words) == 1
    error = capsys.readouterr().err
    assert f"filter own_filter:{name}: " in error or f"filter own_filter:{name} " in error
    assert said in error
    assert len(read_evaluation(work / "e.jsonl").results) == 1


def test_without_a_lab_it_says_what_it_would_do(work, capsys, monkeypatch):
    monkeypatch.delenv("CIBERRATO_LABS", raising=False)
    assert main(["--set", "MotorsNoise=0,1.5,5", "--drive", "explore", "right", "--seeds", "3"]) == 2
    error = capsys.readouterr().err
    assert (
        "this would do 18 runs of 800 cycles (start centres; parameters default; set MotorsNoise=0,1.5,5"
        in error
    )
    assert "--lab maze" in error
    assert "https://github.com/" in error
    assert error.count("\n") == 1


def test_a_sweep_sets_parameters(work, capsys):
    assert sweep([]) == [""]
    assert sweep(["MotorsNoise=0,5", "GPS=On"]) == ["MotorsNoise=0,GPS=On", "MotorsNoise=5,GPS=On"]
    assert with_settings(Parameters(), "MotorsNoise=5,GPS=On") == Parameters(motors_noise=5.0, gps=True)
    words = [*WORDS, "--seeds", "1", "--output", "e.jsonl", "--set", "MotorsNoise=0,5", "--drive", "right"]
    assert main(words) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()[2:4]] == [
        "MotorsNoise=0",
        "MotorsNoise=5",
    ]
    errors = [r.outcome.final_place_error for r in read_evaluation(work / "e.jsonl").results]
    assert len(set(errors)) == 2


def test_labs_of_a_folder_are_found_by_name_or_all(work, capsys):
    for folder, width in (("A", "8"), ("B", "9"), ("B/deep", "9")):
        (work / "labs" / folder).mkdir(parents=True, exist_ok=True)
        (work / "labs" / folder / "lab.xml").write_text(SMALL.replace('Width="8"', f'Width="{width}"'))
    (work / "labs" / "B" / "grid.xml").write_text('<Grid><Position X="1" Y="1" Dir="0"/></Grid>')
    words = ["--labs", "labs", *WORDS[2:], "--seeds", "1", "--output", "e.jsonl"]
    assert main(words) == 0  # two: the third has the walls of the second
    labs = [Path(result.task.lab) for result in read_evaluation(work / "e.jsonl").results]
    assert labs == [Path("labs/A/lab.xml"), Path("labs/B/lab.xml")]
    assert main([*words, "--lab", "B/lab", "--start", "grid", "--output", "f.jsonl"]) == 0
    (only,) = read_evaluation(work / "f.jsonl").results
    assert only.task.grid == os.path.join("labs", "B", "grid.xml")


# --- tables -----------------------------------------------------------------------------------------------


@pytest.fixture
def outcomes(work):
    assert (
        main([*WORDS, "--seeds", "2", "--output", "e.jsonl", "--filter", "built-in", "own_filter:silent"])
        == 1
    )
    return work / "e.jsonl"


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_table_has_a_row_a_run_and_is_read_back_alike(outcomes, ending, capsys):
    pandas = pytest.importorskip("pandas")
    if ending == "parquet":
        pytest.importorskip("pyarrow")
    assert main(["--report", "--output", str(outcomes), "--table", f"t.{ending}"]) == 1  # of failed runs
    direct, table = read_results(str(outcomes)), read_results(f"t.{ending}")
    assert len(COLUMNS) <= 100
    assert tuple(table.columns) == COLUMNS
    assert len(table) == 4
    pandas.testing.assert_frame_equal(direct, table)
    assert table["error"].str.contains("its estimate is None").sum() == 2
    assert set(table["filter"]) == {"built-in", "own_filter:silent"}
    first = read_evaluation(outcomes).results[0].outcome
    assert table["start_heading_deg"][0] == first.start[2]
    claims = [table[f"claims_{tenth}_{tenth + 10}"][0] for tenth in range(0, 100, 10)]
    assert sum(claims) == first.cycles + 1


def test_without_pandas_it_is_a_dict_of_arrays(outcomes, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    table = read_results(outcomes)
    assert tuple(table) == COLUMNS
    assert all(isinstance(column, np.ndarray) and column.shape == (4,) for column in table.values())
    assert table["seed"].tolist() == [0.0, 1.0, 0.0, 1.0]


def test_what_is_no_table_is_told(work):
    (work / "x.csv").write_text("a,b\n1,2\n")
    with pytest.raises(LabError, match="not a table of outcomes"):
        read_results("x.csv")
    with pytest.raises(UsageError, match="no such file; check the path"):
        read_results("y.csv")
    with pytest.raises(TypeError, match="path: 7 is not"):
        read_results(7)
    assert columns_of([])["lab"].shape == (0,)


def test_wide_tables_are_folded(capsys):
    rows = [["group", *(f"column {n}" for n in range(30))], ["one", *map(str, range(30))]]
    lines = aligned(rows).splitlines()
    assert all(len(line) <= WIDTH for line in lines)
    cells = [cell for line in lines if line.startswith("one") for cell in line.split()[1:]]
    assert cells == [str(n) for n in range(30)]
    assert aligned([row[:5] for row in rows]).count("\n") == 1


# --- processes ----------------------------------------------------------------------------------------------


def test_workers_find_the_users_module_and_not_ours_in_the_folder(work):
    (work / "agent.py").write_text("raise RuntimeError('a file of the user, not ours')")
    words = [str(BIN / "ciberrato-evaluate"), *WORDS[:5], "--jobs", "2", "--cycles", "5", "--seeds", "2"]
    words += ["--filter", "own_filter:Middle", "--drive", "own_filter:Still", "--output", "e.jsonl"]
    done = subprocess.run(words, cwd=work, capture_output=True, text=True, timeout=240, check=False)
    assert done.returncode == 0, done.stderr
    assert len(read_evaluation(work / "e.jsonl").results) == 2


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="looks for children in /proc")
def test_sigterm_leaves_neither_processes_nor_files(work):
    words = [str(BIN / "ciberrato-evaluate"), "--lab", "small_lab.xml", "--seeds", "5000", "--jobs", "2"]
    words += ["--resolution", "0.5", "--cycles", "20", "--output", "e.jsonl", "--quiet"]
    process = subprocess.Popen(words, cwd=work, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        output = work / "e.jsonl"
        while process.poll() is None and not (output.exists() and output.stat().st_size):
            time.sleep(0.01)  # until the first outcome is there
        children = descendants(process.pid)
        assert len(children) >= 2
        process.send_signal(signal.SIGTERM)
        _, error = process.communicate(timeout=120)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 143
    assert "terminated; the same command continues from here" in error
    assert "Traceback" not in error
    until = time.monotonic() + 60.0
    while any(Path(f"/proc/{child}").exists() for child in children) and time.monotonic() < until:
        time.sleep(0.01)
    assert not [child for child in children if Path(f"/proc/{child}").exists()]
    cache = Path(os.environ["CIBERRATO_CACHE"])
    assert not [path for path in [*work.rglob("*"), *cache.rglob("*")] if "tmp.npz" in path.name]
    for line in output.read_bytes().splitlines():
        json.loads(line)


def descendants(parent):
    """Ids of a process's children and theirs."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == parent:
            found += [int(entry.name), *descendants(int(entry.name))]
    return found


def test_the_particle_filter_of_the_examples_knows_where_it_is(work):
    outcome = run_task(task(filter="examples.particle_filter:make", cycles=120, start="free"))
    assert outcome.first_right is not None
    assert outcome.final_claim
    assert outcome.final_place_error < 0.2
    assert outcome.truth[-1] > 0.5
