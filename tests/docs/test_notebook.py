"""The manual's notebook is executed, as a notebook, and what its cells show is looked at."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "notebook.md"
CELLS = re.findall(r"```\{code-cell\} python\n(.*?)```", PAGE.read_text(), re.DOTALL)


@pytest.fixture(scope="module")
def outputs():
    """Outputs of all cells, in order."""
    for name in ("nbclient", "nbformat", "ipykernel", "pandas"):
        if not importlib.util.find_spec(name):
            pytest.skip(f"{name} is not installed (extra docs)")
    import nbclient
    import nbformat

    cells = [nbformat.v4.new_code_cell(re.sub(r"^:tags:.*\n", "", text)) for text in CELLS]
    notebook = nbformat.v4.new_notebook(cells=cells)
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("JUPYTER_PATH", str(PAGE.parent / "_extensions"))
        nbclient.NotebookClient(notebook, timeout=300, startup_timeout=300, kernel_name="quiet").execute()
    return [cell.outputs for cell in notebook.cells]


def shown(outputs, kind):
    """What the outputs hold of one kind, a list for each cell."""
    return [[one.data[kind] for one in cell if kind in one.get("data", {})] for cell in outputs]


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of zmq and asyncio, which are not ours
def test_every_cell_runs_and_shows_what_the_text_says(outputs):
    pictures = shown(outputs, "image/png")
    assert [len(one) for one in pictures] == [
        1 if "pyplot.subplots" in text or re.search(r"^(?:ax = )?plot\.", text, re.MULTILINE) else 0
        for text in CELLS
    ]
    assert sum(map(len, pictures)) == 7
    tables = [text for one in shown(outputs, "text/html") for text in one]
    assert "12 x 8, 4 walls" in tables[0]
    assert "probability" in tables[1]  # the estimate
    assert "first_right" in tables[2]  # the outcomes
    said = "".join(one.text for cell in outputs for one in cell if one.output_type == "stream")
    assert [one.text for cell in outputs for one in cell if one.get("name") == "stderr"] == []
    for step in range(3):
        found = re.search(rf"step {step}: most likely (\(.*?\)), ([\d.]+) bits, true (\(.*?\))", said)
        assert found is not None
        assert found[1] == found[3]


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_the_filter_of_the_notebook_is_certain_and_right_at_the_end(outputs):
    (table,) = [text for one in shown(outputs, "text/html") for text in one if "<th>heading" in text]
    assert "(certain)" in table
    assert "cycle 199" in table
