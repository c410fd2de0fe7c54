"""The belief file: what is written, what can be read, and which fault is named where."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ciberrato.errors import LabError, UsageError
from ciberrato.files.atomic import TEMPORARY_SUFFIX
from ciberrato.files.beliefs import format_beliefs, parse_beliefs, read_beliefs, write_beliefs


def uniform(rows=2, columns=3):
    return np.full((rows, columns), 1 / (rows * columns))


def test_the_layout_is_top_row_first_three_decimals_one_blank_line_after_each_step():
    belief = np.array([[0.5, 0.25], [0.125, 0.125]])  # row 0 is the bottom row
    assert format_beliefs(belief[None]) == "0.125 0.125\n0.500 0.250\n\n"


def test_the_standard_lab_gives_seven_lines_of_fourteen_values():
    text = format_beliefs(np.full((2, 7, 14), 1 / 98))
    lines = text.split("\n")
    assert lines[0] == " ".join(["0.010"] * 14)
    assert [len(line.split()) for line in lines] == [14] * 7 + [0] + [14] * 7 + [0, 0]


@given(
    st.integers(1, 5),
    st.integers(2, 4),
    st.integers(2, 4),
    st.integers(3, 6),
    st.randoms(use_true_random=False),
)
def test_what_is_written_is_read_back(blocks, rows, columns, precision, random):
    beliefs = np.array(
        [[[0.01 + random.random() for _ in range(columns)] for _ in range(rows)] for _ in range(blocks)]
    )
    beliefs /= beliefs.sum(axis=(1, 2), keepdims=True)
    beliefs = np.concatenate([uniform(rows, columns)[None], beliefs])
    runs = parse_beliefs(format_beliefs(beliefs, precision))
    read = np.concatenate([run.beliefs for run in runs])
    assert read.shape == beliefs.shape
    assert np.abs(read - beliefs).max() <= 0.5 * 10.0**-precision + 1e-12
    assert {run.decimals for run in runs} == {precision}


def test_several_blanks_and_blank_lines_and_nan_are_read():
    text = "\n\n0.25   0.25 \n 0.25\t0.25\n\n\n\nnan   nan\nnan   nan\n"
    (run,) = parse_beliefs(text)
    assert run.beliefs.shape == (2, 2, 2)
    assert np.isnan(run.beliefs[1]).all()
    assert run.first_line == 3


def test_appended_runs_are_told_apart_by_their_priors():
    one = format_beliefs(np.array([uniform(), [[1, 0, 0], [0, 0, 0]]]))
    runs = parse_beliefs(one + one + format_beliefs(np.array([uniform(3, 3)])))
    assert [run.beliefs.shape for run in runs] == [(2, 2, 3), (2, 2, 3), (1, 3, 3)]
    assert [run.first_line for run in runs] == [1, 7, 13]


def test_a_prior_over_the_free_cells_only_begins_a_run_too():
    prior = np.array([[0.2, 0.2, 0], [0.2, 0.2, 0.2]])
    certain = np.array([[0, 0, 0], [0, 1, 0]])
    runs = parse_beliefs(format_beliefs(np.array([prior, certain, certain, prior, certain])))
    assert [len(run.beliefs) for run in runs] == [3, 2]


@pytest.mark.parametrize(
    ("text", "line", "column", "what"),
    [
        ("0.5 0.5\n0.0 x1\n", 2, 5, "'x1' is not a probability"),
        ("0.5 0.5\n0.5 0.5 -0.5\n", 2, 9, "negative"),
        ("0.5 0.5\n0.0\n", 2, 3, "this row has 1 values"),
        ("0.5 0.0\n0.1 0.2 0.2\n", 2, 9, "this row has 3 values"),
        ("0.25 0.25\n0.25 0.25\n\n0.90 0.90\n0.00 0.00\n", 4, 1, "adds up to 1.8"),
        ("0.25 0.25\n0.25 0.25\n\n0.90 0.10\n", 4, 1, "1 rows of 2"),
        ("0.25 1.25\n", 1, 6, "above 1"),
        ("0.25 nan\n0.5 0.25\n", 1, 1, "mixes nan"),
        ("0.5 inf\n", 1, 5, "'inf'"),
        ("0.5 0_5\n", 1, 5, "'0_5'"),
    ],
)
def test_the_first_fault_is_named_with_line_and_column(text, line, column, what):
    with pytest.raises(LabError) as caught:
        parse_beliefs(text, "b.out")
    assert str(caught.value).startswith(f"b.out:{line}: column {column}: ")
    assert what in str(caught.value)
    assert "\n" not in str(caught.value)


def test_rounding_is_forgiven_but_no_more():
    row = " ".join(["0.01"] * 98)
    parse_beliefs(row)  # adds up to 0.98
    with pytest.raises(LabError, match=r"adds up to"):
        parse_beliefs(" ".join(["0.010000"] * 98))


@pytest.mark.parametrize("text", ["", "\n\n", "   \n"])
def test_an_empty_file_is_a_fault(text):
    with pytest.raises(LabError, match="empty"):
        parse_beliefs(text)


def test_a_missing_file_a_folder_and_a_binary_file_are_said_in_one_line(tmp_path):
    (tmp_path / "bin").write_bytes(b"\xff\xfe\x00")
    for path in (tmp_path / "none", tmp_path, tmp_path / "bin"):
        with pytest.raises(LabError) as caught:
            read_beliefs(path)
        assert str(path) in str(caught.value)


def test_writing_replaces_the_file_and_leaves_nothing_else(tmp_path):
    path = tmp_path / "localization.out"
    path.write_text("old")
    write_beliefs(path, np.array([uniform()]), precision=5)
    assert path.read_text().startswith("0.16667 ")
    assert [entry.name for entry in tmp_path.iterdir()] == ["localization.out"]


def test_a_failed_write_keeps_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "localization.out"
    path.write_text("old")

    def full_disk(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full_disk)
    with pytest.raises(UsageError, match="No space left on device"):
        write_beliefs(path, np.array([uniform()]))
    assert path.read_text() == "old"
    assert not list(tmp_path.glob(f"*{TEMPORARY_SUFFIX}"))


def test_a_missing_folder_is_a_usage_error():
    with pytest.raises(UsageError, match="No such file"):
        write_beliefs(Path("/nonexistent-folder/localization.out"), np.array([uniform()]))


def test_a_file_of_the_original_agent_with_nan_blocks_is_read(golden):
    path = golden / "seed_runs" / "default_noise_pos1" / "localization.out"
    (run,) = read_beliefs(path)
    assert run.beliefs.shape == (29, 7, 14)
    assert int(np.isnan(run.beliefs).any(axis=(1, 2)).sum()) == 23
