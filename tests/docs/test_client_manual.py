"""The programs of docs/client.md, run as they are written."""

import re
from pathlib import Path

import pytest

from tests.client.conftest import simulator

TEXT = (Path(__file__).parents[2] / "docs" / "client.md").read_text()
PROGRAMS = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)


@pytest.mark.parametrize("number", range(len(PROGRAMS)))
def test_a_program_of_the_page(number, tmp_path, capsys):
    parameters = tmp_path / "short.xml"
    parameters.write_text('<Parameters SimTime="60"/>')
    program = PROGRAMS[number]
    if "localhost:6000" not in program:
        exec(compile(program, f"client.md, program {number}", "exec"), {})
        return
    options = (
        "--lab",
        "maze",
        "--grid",
        "maze",
        "--param",
        str(parameters),
        "--autostart",
        "1",
        "--lockstep",
    )
    with simulator(*options) as host:
        program = program.replace("localhost:6000", host)
        exec(compile(program, f"client.md, program {number}", "exec"), {})


def test_all_programs_are_found():
    assert len(PROGRAMS) == 4
