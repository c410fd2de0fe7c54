"""The comparison with the real simulator's recordings, and the table that shows it."""

from __future__ import annotations

import gzip
import json
import shutil

import pytest

from benchmarks.conformance.__main__ import all_rows, main
from tests.recordings import GOLDEN, LABS, needs

OURS = ("labs", "infrared", "motion")


def test_everything_agrees_with_the_recordings_that_come_with_the_tests(golden, capsys):
    assert main(["--golden", str(golden)]) == 0
    output = capsys.readouterr().out
    assert "DIFFERS" not in output
    assert output.count(" ok ") > 20


@pytest.mark.slow
@needs("CIBERRATO_GOLDEN", "CIBERRATO_LABS")
def test_everything_agrees_with_the_full_set_of_recordings():
    rows = {row.check: row for row in all_rows(GOLDEN, LABS)}
    assert [row for row in rows.values() if not row.passed] == []
    assert rows["labs: walls"].cases >= 72
    assert sum(rows[f"infrared: {file}"].cases for file in ("cell_centres", "random_poses")) >= 157_000
    assert rows["motion: direct"].cases >= 5_000


@pytest.fixture
def copy(golden, tmp_path):
    """A copy of the recordings, to be spoilt."""
    for part in ("ir", "physics", "noise"):
        shutil.copytree(golden / part, tmp_path / part)
    return tmp_path


def _rewrite(path, change):
    with gzip.open(path, "rt", encoding="utf-8") as file:
        text = file.read()
    changed = change(text)
    assert changed != text
    with gzip.open(path, "wt", encoding="utf-8") as file:
        file.write(changed)


def _spoil_text(path, old, new):
    _rewrite(path, lambda text: text.replace(old, new, 1))


def _spoil_column(path, column, value):
    """Put a value into the twentieth row of a table."""

    def change(text):
        lines = text.split("\n")
        fields = lines[20].split(",")
        fields[lines[0].split(",").index(column)] = value
        lines[20] = ",".join(fields)
        return "\n".join(lines)

    _rewrite(path, change)


def _failed(folder, module):
    return [row.check for row in all_rows(folder, None, [module]) if not row.passed]


@pytest.mark.parametrize(
    ("file", "old", "new", "check"),
    [
        ("own_labs", "5.9", "5.900001", "labs: walls"),
        ("lab_quirks", '"n_walls": 1', '"n_walls": 1, "width": 27', "labs: odd input"),
        ("grid_quirks", '"y": 11', '"y": 11.5', "grids: odd input"),
        ("param_quirks", '"line_true_prob": 0.5', '"line_true_prob": 0.6', "parameters: odd input"),
    ],
)
def test_a_document_that_differs_is_found(copy, file, old, new, check):
    _spoil_text(copy / f"ir/{file}.jsonl.gz", old, new)
    assert _failed(copy, "labs") == [check]


@pytest.mark.parametrize(
    ("file", "column", "value", "check"),
    [
        ("ir/own_cell_centres", "distance", "0.123", "infrared: own_cell_centres"),
        ("ir/own_random_poses", "wall_distance", "0.6", "infrared: own_random_poses, to walls"),
        ("ir/other_robots", "ideal_with_other", "0.123", "infrared: other_robots"),
        ("ir/other_robots", "ir_value_noise0", "0.9", "infrared: other_robots"),
        ("physics/direct/05_inplace_rotation", "collide_wall", "1", "motion: direct"),
        ("physics/direct/20_two_headon", "x", "7", "motion: direct"),
        ("physics/direct/20_two_headon", "ir2_ideal", "0.123", "infrared: direct traces"),
        ("physics/network/11_curve_into_wall", "collisions", "7", "motion: network"),
        ("noise/m2_motor_direct_seed12345", "dir_rad", "0.5", "motion: noisy motors"),
    ],
)
def test_a_number_that_differs_is_found(copy, file, column, value, check):
    _spoil_column(copy / f"{file}.csv.gz", column, value)
    assert check in _failed(copy, "infrared" if file.startswith("ir/") else "motion")


def test_exit_status_is_one_on_a_difference(copy, capsys):
    _spoil_text(copy / "ir/own_labs.jsonl.gz", '"width": 28', '"width": 29')
    assert main(["--golden", str(copy), "--only", "labs"]) == 1
    assert "DIFFERS" in capsys.readouterr().out


def test_a_check_that_breaks_is_a_failed_row_and_the_others_go_on(copy):
    (copy / "ir/own_labs.jsonl.gz").write_bytes(b"not gzip")
    rows = list(all_rows(copy, None, OURS))
    assert [row.note[:16] for row in rows if not row.passed] == ["the check broke:"]
    assert any(row.check == "motion: direct" and row.cases for row in rows)


def test_an_empty_folder_is_skipped_row_by_row(tmp_path, capsys):
    assert main(["--golden", str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()[:-1]
    assert lines
    assert all("skipped" in line for line in lines)


@pytest.mark.parametrize("option", ["--golden", "--labs"])
@pytest.mark.parametrize("told", [True, False], ids=["option", "variable"])
def test_a_missing_folder_is_one_line_and_status_two(option, told, tmp_path, capsys, monkeypatch):
    folder = str(tmp_path / "nothing")
    if not told:
        monkeypatch.setenv(f"CIBERRATO_{option[2:].upper()}", folder)
    assert main([option, folder] if told else []) == 2
    assert capsys.readouterr().err == f"{folder}: no such folder; name one that is there\n"


def test_without_being_told_it_takes_what_comes_with_the_tests_and_says_so(capsys, monkeypatch):
    monkeypatch.delenv("CIBERRATO_GOLDEN", raising=False)
    monkeypatch.delenv("CIBERRATO_LABS", raising=False)
    assert main(["--only", "codec"]) == 0
    shown = capsys.readouterr()
    assert shown.out.count(" ok ") > 3
    assert "CIBERRATO_GOLDEN" in shown.err
    assert "CIBERRATO_LABS" in shown.err


def test_labs_that_are_not_here_are_counted(golden, copy):
    scenarios = copy / "physics/scenarios.json"
    content = json.loads(scenarios.read_text(encoding="utf-8"))
    content["01_straight"] = {**content["03_clamped"], "lab": "nowhere/lab.xml"}
    shutil.copy(golden / "physics/direct/03_clamped.csv.gz", copy / "physics/direct/01_straight.csv.gz")
    scenarios.write_text(json.dumps(content), encoding="utf-8")
    (row,) = [row for row in all_rows(copy, None, ["motion"]) if row.check == "motion: direct"]
    assert row.passed
    assert "1 whose labs are not here" in row.note
