"""The benchmark runner: its table, its file, and its figures' own consistency."""

from __future__ import annotations

import json

import pytest

from benchmarks import bayes_poses, table
from benchmarks.measure import best_time


def test_one_module_prints_rows_and_writes_them(tmp_path, capsys):
    output = tmp_path / "build" / "bench.json"
    assert table.main(["bandwidth", "--output", str(output)]) == 0
    document = json.loads(output.read_text())
    assert document["machine"]["bytes_per_second"] > 1e8
    (row,) = document["rows"]
    assert row["moved"] / row["seconds"] > 1e8
    assert "memory" in capsys.readouterr().out


def test_an_unknown_module_is_refused(capsys):
    assert table.main(["everything"]) == 2
    assert "bayes_poses" in capsys.readouterr().err


def test_best_time_is_that_of_the_work(monkeypatch):
    """By a clock of its own: every third call is held up by other programs, the first one too."""
    now, calls = 0.0, 0

    def work():
        nonlocal now, calls
        now, calls = now + (0.004 if calls % 3 else 0.9), calls + 1

    monkeypatch.setattr("benchmarks.measure.time.perf_counter", lambda: now)
    assert best_time(work, budget=0.5) == pytest.approx(0.004)


def test_the_loops_and_the_arrays_that_others_are_compared_with_agree():
    belief = bayes_poses.SPACE.point_mass((0.2, 0.1, 0.3))
    start = tuple(int(i) for i in bayes_poses.SPACE.index((0.2, 0.1, 0.3)))
    assert abs(bayes_poses.loops(belief, [start]) - bayes_poses.all_pairs(belief)).max() < 1e-12
