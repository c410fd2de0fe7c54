"""The plots of docs/figures.md, drawn as they are written, one program after the other."""

from __future__ import annotations

import re
from pathlib import Path

import matplotlib as mpl
import numpy as np

from ciberrato import plot

mpl.use("Agg")
from matplotlib import image

TEXT = (Path(__file__).parents[2] / "docs" / "figures.md").read_text()
PROGRAMS = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)


def test_the_programs_draw_what_they_say(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {}
    for program in PROGRAMS:
        exec(compile(program, "docs/figures.md", "exec"), names)
    wanted = re.findall(r'savefig\("(\w+\.png)"\)', TEXT)
    assert len(wanted) == 8
    for name in wanted:
        picture = image.imread(tmp_path / name)
        assert len(np.unique(picture.reshape(-1, picture.shape[2]), axis=0)) > 20, name


def test_the_table_lists_every_plot():
    rows = TEXT.split("| function | draws |")[1].split("```")[0]
    listed = set(re.findall(r"`(\w+)[(`]", rows))
    assert listed >= set(plot.__all__)
