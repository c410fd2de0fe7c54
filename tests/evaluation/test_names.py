"""Names of labs, parameter files, drives and filters that would like to be more than names."""

import unicodedata
from pathlib import Path

import pytest
from matplotlib import pyplot

from ciberrato.evaluation import figures
from ciberrato.evaluation.attempt import Result
from ciberrato.evaluation.comparison import compare
from ciberrato.evaluation.figures import draw_figures
from ciberrato.evaluation.published import Compared, LabTask, published_table
from ciberrato.evaluation.replay import Replay, draw_replay, replay_table
from ciberrato.evaluation.report import MOST_NAME, group_by, table
from ciberrato.evaluation.task import Task
from ciberrato.files.lab import read_lab
from ciberrato.labs import find_lab
from ciberrato.plot.canvas import legend_text
from tests.evaluation.test_evaluation import outcome

NAMES = [
    "\x1b[2J\x1b]0;mine\x07\x9b31m\x00",
    "\u202egnp.exe\u2066\u200b\u2028next\nline",
    "<img src=x onerror='alert(1)'>",
    r"$\frac{a}$ and $\undefined$ \$",
    "_hidden",
    "m" * 400,
    "m" * 399 + "n",
]


def unseen(text):
    return {sign for sign in text if unicodedata.category(sign) in ("Cc", "Cf", "Cs", "Zl", "Zp")} - {"\n"}


def runs(**fields):
    return [Result(Task(**({"lab": "maze"} | fields), seed=seed), outcome()) for seed in range(3)]


@pytest.mark.parametrize("field", ["lab", "parameters", "drive", "filter", "settings", "code"])
def test_they_are_inert_in_tables_and_stay_apart(field):
    results = [result for name in NAMES for result in runs(**{field: name})]
    groups = group_by(results, field)
    assert [len(group) for group in groups.values()] == [3] * len(NAMES)
    text = table(groups)
    assert not unseen(text)
    assert max(map(len, text.splitlines())) <= 100
    assert all(len(name) <= MOST_NAME + len(" #2") for (name,) in groups)


def test_labs_with_one_short_name_are_two_groups():
    results = [*runs(lab="/a/labs/x.xml"), *runs(lab="/b/labs/x.xml"), *runs(lab="/b/labs/y.xml")]
    assert {key: len(group) for key, group in group_by(results, "lab").items()} == {
        ("labs/x",): 3,
        ("labs/x #2",): 3,
        ("labs/y",): 3,
    }


def test_they_are_inert_in_comparisons():
    one, other = NAMES[0], NAMES[5]
    results = [result for drive in (one, other) for name in NAMES for result in runs(lab=name, drive=drive)]
    text = compare(results, one, other, ["lab"])
    assert not unseen(text)
    assert f"all groups: {len(NAMES)} groups" in text
    assert not unseen(published_table([Compared(LabTask(name, 0.1, 1), ()) for name in NAMES]))


def test_a_recordings_name_is_inert(tmp_path):
    found = Replay(NAMES[0] + "$x_$", [(1.0, 1.0), (2.0, 1.0)], 1, (), (0, 0), 0, 0)
    assert not unseen(replay_table(found))
    draw_replay(found, read_lab(find_lab("maze")), tmp_path / "x.png")


@pytest.mark.parametrize("by", [["lab", "drive"], ["lab"]])
def test_they_are_text_in_figures(by, tmp_path, monkeypatch):
    # A figure of one kind is enough, and what it shows is looked at before it is closed.
    monkeypatch.setattr(figures, "_FIGURES", figures._FIGURES[:1])
    seen, close = [], pyplot.close
    monkeypatch.setattr(pyplot, "close", seen.append)
    results = [result for name in NAMES for result in runs(lab=name, drive=name)]
    (path,) = draw_figures(results, by, Path(tmp_path))
    assert path.stat().st_size > 5000
    (figure,) = seen
    (legend,) = figure.legends
    labels = [text.get_text() for text in legend.get_texts()]
    assert len(labels) == len(set(labels)) == len(NAMES)
    titles = [axes.get_title() for axes in figure.axes if axes.get_visible()]
    assert len(set(titles)) == (len(NAMES) if "drive" in by else 1)
    assert not unseen("".join([*labels, *titles]))
    assert any("hidden" in label for label in labels)
    close(figure)


def test_a_label_begins_no_formula_and_is_never_hidden():
    axes = pyplot.figure().add_subplot()
    for name in NAMES:
        axes.plot([0, 1], label=legend_text(name))
    legend = axes.legend()
    assert len(legend.get_texts()) == len(NAMES)
    axes.figure.canvas.draw()  # a formula that is none would raise
    pyplot.close(axes.figure)
