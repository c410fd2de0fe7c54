"""docs/test-your-agent.md, walked word for word."""

import os
import re
import shlex
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from ciberrato.grading.conformance.rows import NAMES

TEXT = (Path(__file__).parents[2] / "docs" / "test-your-agent.md").read_text()
(WORKFLOW,) = re.findall(r"```yaml\n(.*?)```", TEXT, re.DOTALL)
STEPS = [step for step in re.findall(r"- run: (.*)", WORKFLOW) if not step.startswith("pip")]


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A folder with the files of the page, and the programs of this checkout first on the path."""
    for kind, name, body in re.findall(r"```(python|c)\n(?:#|/\*) (\S+)(?: \*/)?\n(.*?)```", TEXT, re.DOTALL):
        assert kind in name or name.endswith(".py")
        (tmp_path / name).write_text(body)
    here = Path(sys.executable).parent
    monkeypatch.setenv("PATH", f"{here}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("PYTEST_ADDOPTS", "-p no:ciberrato -p ciberrato.testing.plugin -W error -ra")
    if not shutil.which("gcc"):
        (tmp_path / "test_robot.py").unlink()
    return tmp_path


def run(command, folder):
    words = ["sh", "-c", command]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=600, check=False)


@pytest.mark.slow
def test_the_steps_of_the_workflow(project):
    assert len(STEPS) == 2
    for step in STEPS:
        done = run(step, project)
        assert done.returncode == 0, done.stdout + done.stderr
    kinds = {"check.xml": "11", "tests.xml": str(10 + (project / "test_robot.py").exists())}
    for name, count in kinds.items():
        (suite,) = ElementTree.parse(project / name).getroot()
        assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == (count, "0", "0")
    assert not (project / "ciberrato-failures").exists()
    assert not (project / "robot").exists()


@pytest.mark.slow
def test_what_a_failure_says(project):
    agent = project / "agent.py"
    agent.write_text(
        agent.read_text() + "        if measures.time == 60:\n            raise ValueError('a mistake')\n"
    )
    done = run("python -m pytest -k 'drives_on and seed3'", project)
    assert done.returncode == 1
    (shown,) = re.findall(r"```text\n(run 1: .*?)```", TEXT, re.DOTALL)
    for line in shown.splitlines():
        if "..." not in line:
            digest = re.sub(r"-[0-9a-f]{6}/", "-DIGEST/", line)
            assert digest in re.sub(r"-[0-9a-f]{6}/", "-DIGEST/", done.stdout)


def test_the_commands_are_those_of_the_workflow():
    console = [line for line in TEXT.splitlines() if line.startswith("$ ")]
    plain = [step.replace(" --junit check.xml", "").replace(" --junitxml=tests.xml", "") for step in STEPS]
    assert [f"$ {step}" for step in plain] == [line for line in console if "pip install" not in line]
    assert [line for line in console if "pip" in line] == ["$ pip install 'ciberrato[test]'"]
    assert all(shlex.split(step) for step in STEPS)


def test_the_workflow_is_yaml_with_the_keys_of_github():
    yaml = pytest.importorskip("yaml")
    document = yaml.safe_load(WORKFLOW)
    assert set(document) == {"name", True, "jobs"}  # YAML 1.1 reads `on` as true
    (job,) = document["jobs"].values()
    assert set(job) == {"runs-on", "timeout-minutes", "steps"}
    for step in job["steps"]:
        assert set(step) <= {"uses", "with", "run", "if", "name"}
        assert ("uses" in step) != ("run" in step)


def test_all_rows_options_and_results_are_in_the_page():
    from ciberrato.testing.options import MARKER
    from ciberrato.testing.runs import AgentRun

    for name in NAMES:
        assert f"`{name}`" in TEXT
    for name in MARKER:
        assert re.search(rf"`{name}`", TEXT), name
    shown = {name for name in AgentRun.__dataclass_fields__ if not name.startswith("_")} - {
        "command",
        "lab",
        "seed",
    }
    for name in shown | {"truth", "files", "log", "arrived", "finished"}:
        assert re.search(rf"`{name}`", TEXT), name
