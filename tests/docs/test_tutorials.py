"""The programs of the tutorials, run as they are written."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.client.conftest import simulator

DOCS = Path(__file__).parents[2] / "docs"


def program(page: str) -> str:
    (found,) = re.findall(r"```python\n(.*?)```", (DOCS / page).read_text(), re.DOTALL)
    return found


@pytest.mark.slow
def test_the_first_agent_drives_to_the_end_and_the_same_every_time(tmp_path):
    (tmp_path / "robot.py").write_text(program("first-agent.md"))
    results = []
    for number in (1, 2):
        result = tmp_path / f"result-{number}.json"
        options = ("--lab", "maze", "--grid", "maze", "--seed", "1", "--autostart", "1", "--lockstep")
        with simulator(*options, "--result", str(result)) as host:
            words = [sys.executable, "-W", "error", "robot.py", host]
            done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=300)
        assert (done.returncode, done.stdout, done.stderr) == (0, "the run is over: TIME_UP\n", "")
        results.append(result.read_text())
    assert results[0] == results[1]


def test_the_first_belief_is_right(capsys):
    exec(compile(program("first-belief.md"), "first-belief.md", "exec"), {})
    believed, true = (
        [float(number) for number in re.findall(pattern, line)]
        for pattern, line in zip(
            (r"(?:x|y|heading)=(-?\d+\.?\d*)", r"-?\d+\.\d*"),
            capsys.readouterr().out.splitlines(),
            strict=True,
        )
    )
    assert believed[:3] == pytest.approx(true, abs=0.1)
