"""What `inspect` prints and draws, on files of the real agent and on made-up ones."""

import io

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from agent.offline.summary import heat_map, peak, step_table
from agent.views.figures import belief_panels
from agent.views.inspection import inspect
from ciberrato.errors import UsageError
from ciberrato.files.beliefs import write_beliefs
from ciberrato.files.lab import default_lab
from ciberrato.plot.canvas import TRUE_COLOUR
from ciberrato.world.lab import Lab


def inspected(path, **options):
    out = io.StringIO()
    inspect(path, out=out, **options)
    return out.getvalue()


def test_a_run_of_the_original_agent_ends_at_the_right_border(golden):
    text = inspected(golden / "seed_runs" / "noise_free_pos1" / "localization.out")
    lines = text.splitlines()
    assert lines[0].endswith("localization.out: prior and 12 steps, 7 x 14 cells, 3 decimals")
    assert lines[2].split() == ["prior", "(1,", "1)", "and", "all", "others", "0.010", "6.61"]
    assert lines[14].split() == ["11", "(27,", "7)", "1.000", "0.00"]
    assert max(len(line) for line in lines[1:]) <= 80


def test_undefined_blocks_are_counted_and_shown(golden):
    text = inspected(golden / "seed_runs" / "default_noise_pos1" / "localization.out")
    assert "23 of 29 blocks are undefined (nan)" in text
    assert text.count("undefined (nan)") == 23 + 1
    assert "|" + "    ?" * 14 + "|" in text


def test_appended_runs_are_shown_one_after_the_other(tmp_path):
    path = tmp_path / "two.out"
    beliefs = np.array([np.full((2, 2), 0.25), [[0, 1], [0, 0]]])
    write_beliefs(path, beliefs)
    path.write_text(path.read_text() * 2)
    text = inspected(path)
    assert "run 1 of 2, from line 1: prior and 1 step," in text
    assert "run 2 of 2, from line 7: prior and 1 step," in text


def test_a_lab_of_another_size_is_refused(tmp_path):
    path = tmp_path / "b.out"
    write_beliefs(path, np.array([[[0.5, 0.5]]]))
    with pytest.raises(UsageError, match="1 x 2 cells, but the lab 'NO NAMED LAB' has 8 x 8"):
        inspected(path, lab=Lab())


@pytest.mark.parametrize("kind", ["png", "svg", "pdf"])
def test_the_figure_is_of_the_kind_that_its_name_asks_for(tmp_path, golden, kind):
    path = tmp_path / f"b.{kind}"
    text = inspected(
        golden / "seed_runs" / "noise_free_pos5" / "localization.out", png=path, lab=default_lab()
    )
    assert text.endswith(f"figure: {path}\n")
    start = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[kind]
    assert path.read_bytes().startswith(start)
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_an_unknown_kind_of_figure_is_refused(tmp_path):
    with pytest.raises(UsageError, match="kind 'bmpx'"):
        belief_panels(np.full((1, 2, 2), 0.25), tmp_path / "b.bmpx")
    assert not list(tmp_path.iterdir())


def rendered(*arguments, **options):
    """The pixels of belief panels."""
    import tempfile
    from pathlib import Path

    from matplotlib.image import imread

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "f.png"
        belief_panels(*arguments, path, **options)
        return imread(path)


def green(picture):
    """Which pixels have the colour of the true cell."""
    return np.all(np.abs(picture[..., :3] - to_rgb(TRUE_COLOUR)) < 0.02, axis=-1)


def dark(picture):
    """Number of pixels that are nearly black."""
    return np.count_nonzero(picture[..., :3].max(axis=-1) < 0.3)


def test_the_true_cell_and_the_walls_are_drawn():
    beliefs = np.full((1, 7, 14), 1 / 98)
    plain = rendered(beliefs)
    ringed = rendered(beliefs, true_cells=[(3, 2)])
    walled = rendered(beliefs, lab=default_lab())
    # Row 3 of 7 is the middle; column 2 of 14 is on the left. The legend is below.
    rows, columns = np.nonzero(green(ringed)[: int(0.8 * len(ringed))])
    assert rows.size > 20
    assert not green(plain).any()
    assert 0.3 < rows.mean() / len(ringed) < 0.7
    assert columns.mean() / ringed.shape[1] < 0.35
    # Walls are dark lines over the belief; with a lab the axes are larger, so the pictures are not compared.
    assert dark(walled) > 1.2 * dark(plain)


def test_ties_and_verdicts_are_told():
    even = np.array([[0.4, 0.1], [0.1, 0.4]])
    table = step_table(np.array([np.full((2, 2), 0.25), even, even, even]), [None, (0, 0), (1, 1), (1, 0)])
    assert [line.split()[-3:] for line in table.splitlines()[2:]] == [
        ["1", "of", "2"],
        ["1", "of", "2"],
        ["(1,", "3)", "wrong"],
    ]
    assert peak(even).cells == ((0, 0), (1, 1))


def test_the_heat_map_shows_the_top_row_first_and_fits_the_width():
    belief = np.zeros((3, 28))
    belief[2, 0], belief[0, 27] = 0.75, 0.25
    wide = heat_map(belief, width=160).splitlines()
    assert (
        wide[0].split() == ["5", "|", "75", *["."] * 27 + ["|"]]
        or wide[0].replace("|", " ").split()[1] == "75"
    )
    assert wide[2].rstrip("|").endswith("25")
    narrow = heat_map(belief, width=80).splitlines()
    assert max(len(line) for line in narrow) <= 80
    assert narrow[0].startswith("5 |@@")
    assert narrow[2].rstrip("|")[-2:] not in ("  ", "@@")
    bands = heat_map(belief, width=20).splitlines()
    assert max(len(line) for line in bands) <= 20
    assert len(bands) == 2 * 4


def test_colour_adds_only_escapes():
    import re

    belief = np.array([[0.9, 0.1], [0, 0]])
    painted = heat_map(belief, colour=True)
    assert "\x1b[48;5;" in painted
    assert re.sub(r"\x1b\[[0-9;]*m", "", painted) == heat_map(belief)
