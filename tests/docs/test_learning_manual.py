"""The programs and examples of docs/learning.md, run as they are written."""

import doctest
import re
from pathlib import Path

import pytest

pytest.importorskip("gymnasium")

PAGE = Path(__file__).parents[2] / "docs" / "learning.md"


def test_examples():
    result = doctest.testfile(str(PAGE), module_relative=False)
    assert result.attempted >= 10
    assert result.failed == 0


def test_the_first_program_runs(capsys):
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    (program,) = [block for block in blocks if not block.startswith(">>>")]
    assert "ciberrato.gym:" in program
    exec(compile(program, "docs/learning.md", "exec"), {})
    score, success = capsys.readouterr().out.split()
    assert int(score) > 0
    assert success == "False"


def test_the_table_of_observations_names_all_columns():
    from ciberrato.gym import CiberRatoEnv

    text = PAGE.read_text()
    section = text[text.index("| numbers | unit |") : text.index("`env.unwrapped.task.columns()`")]
    sizes = {"Navigate": 9, "Localize": 13, "Circuit": 7}
    for name, size in sizes.items():
        assert len(CiberRatoEnv(name.lower()).task.columns()) == size
    rows = [line.split("|")[1:-1] for line in section.splitlines() if line.startswith("| ")][1:]
    assert {row[3].strip() for row in rows} == {"all", "Navigate", "Localize"}
