from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ciberrato.evaluation.cli import main
from ciberrato.evaluation.replay import Moment, Replay, read_recording, replay_table, verdict

RUNS = Path(__file__).parents[1] / "data/golden/seed_runs"


def test_what_a_block_says_is_judged_by_its_most_probable_cells():
    sure = np.array([[0.1, 0.7], [0.1, 0.1]])
    torn = np.array([[0.4, 0.4], [0.1, 0.1]])
    assert verdict(sure, (0, 1)) == "right"
    assert verdict(sure, (1, 0)) == "wrong"
    assert verdict(torn, (0, 0)) == "undecided"
    assert verdict(np.full((2, 2), np.nan), (0, 0)) == "nan"
    assert verdict(None, (0, 0)) == "nothing"


def test_lines_that_say_the_same_are_one():
    sure, nothing = np.array([[0.0, 1.0]]), np.full((1, 2), np.nan)
    moments = [
        Moment(0, (0, 1), (0.5, 1.0, 2.0), sure, sure),
        *(Moment(time, (0, 1), (0.99, 0.1, 0.2), sure, nothing) for time in (20, 40, 60)),
    ]
    found = Replay("x", np.zeros((2, 2)), 1, tuple(moments), (2, 5), 3, 0)
    lines = replay_table(found).splitlines()
    assert "1 right, 3 not a number" in lines[1]
    assert "4 right" in lines[2]
    assert lines[5].startswith("0 ")
    assert lines[6].startswith("20-60")
    # Folded, as all tables are, where a line would be longer than 100 characters.
    assert lines[8].split() == ["time", "off", "by"]
    assert lines[10].startswith("20-60")
    assert len(lines) == 12


def test_a_recording_of_the_original_is_told_from_ours(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("CIBERRATO_CACHE", str(tmp_path / "cache"))
    run, figures = RUNS / "noise_free_pos5", tmp_path / "figures"
    assert len(read_recording(run).inputs) > 400
    # Coarse tables for both stages: this is about the comparison, not about the filter.
    monkeypatch.setattr("ciberrato.evaluation.replay.FINE", 0.5)
    monkeypatch.setattr("ciberrato.evaluation.replay.COARSE", 0.5)
    assert main(["--replay", str(run), "--lab", "standard", "--figures", str(figures)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "in 3 cells" in lines[0]
    # The original's file for this run: the start cell and the next are wrong, the third is right.
    assert lines[1] == "The original wrote 4 blocks: 1 right, 2 wrong."
    assert lines[3].endswith("was wrong in 0.")
    assert [line.split()[0] for line in lines[5:8]] == ["0", "21", "41"]
    assert (figures / "noise_free_pos5.png").stat().st_size > 10_000


def test_what_is_no_recording_is_a_line(tmp_path, capsys):
    assert main(["--replay", str(tmp_path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("name", ["noise_free_pos1", "default_noise_pos1"])
def test_the_times_of_the_originals_blocks_are_found(name):
    from ciberrato.evaluation.replay import _reading_times
    from ciberrato.files.beliefs import read_beliefs

    run = RUNS / name
    times = _reading_times(read_recording(run))
    assert len(times) == len(read_beliefs(run / "localization.out")[0].beliefs) - 1
    assert times[:4] == [0, 21, 41, 61]
