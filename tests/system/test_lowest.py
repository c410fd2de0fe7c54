"""The CI step that tests with the lowest declared versions."""

import os
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def test_the_part_that_ci_runs_names_tests_that_exist():
    text = (ROOT / ".ci/lowest").read_text()
    (listed,) = re.findall(r"what=\((tests/\{.*?)\)\n", text, re.DOTALL)
    rooms = re.search(r"tests/\{(.*?)\}", listed)[1].split(",")
    paths = [f"tests/{room}" for room in rooms] + re.findall(r"tests/\S+\.py", listed)
    assert len(paths) > 10
    assert all((ROOT / path).exists() for path in paths)
    assert ".ci/lowest part" in (ROOT / ".ci/run").read_text()
    assert "run: .ci/lowest\n" in (ROOT / ".github/workflows/tests.yml").read_text()


@pytest.mark.slow
def test_without_a_network_it_says_so_in_a_line_and_passes(tmp_path):
    nowhere = {"PIP_INDEX_URL": "http://127.0.0.1:9/simple", "PIP_CONFIG_FILE": os.devnull}
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PIP_", "UV_"))}
    ended = subprocess.run(
        [ROOT / ".ci/lowest", "part"],
        env={**kept, **nowhere, "FOLDER": str(tmp_path / "venv"), "PIP_NO_CACHE_DIR": "1"},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    (line,) = ended.stdout.splitlines()
    assert line.startswith("lowest versions: not tested, the packages cannot be fetched (ERROR: No matching")
