"""Gradings on a Dask cluster."""

import pytest

from ciberrato.errors import UsageError
from ciberrato.grading import cluster
from ciberrato.grading.course import read_course
from ciberrato.grading.runner import grade, read_runs
from ciberrato.grading.task import tasks_of
from tests.grading.agents import CRASHING, ROBOT, table, write
from tests.grading.program import rows, run

distributed = pytest.importorskip("distributed")
HEAD = """
seeds = [1, 2]
[[lab]]
name = 'maze'
grid = 'maze'
set = {SimTime = 40}
[[lab]]
name = 'chance'
random = { size = "6x4", seed = 3 }
parameters = 'harsh'
set = {SimTime = 40}
"""


@pytest.fixture(scope="module")
def address():
    with distributed.LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
    ) as workers:
        yield workers.scheduler_address
        cluster._KEPT.close()
        cluster._LAUNCHERS.clear()


@pytest.fixture
def course(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    write(tmp_path, "robot", ROBOT)
    write(tmp_path, "crashing", CRASHING)
    path = tmp_path / "course.toml"
    agents = table("robot", build="true") + table("crashing")
    path.write_text(HEAD + agents + "[[agent]]\nname = 'bare'\ncommand = 'false'\n")
    return path


def done(course, folder, **options):
    graded = read_course(course)
    tasks = tasks_of(graded)
    faults = grade(graded, tasks, folder, sandbox="none", jobs=2, progress=None, **options)
    return faults, {key: outcome for key, (outcome, _) in read_runs(folder / "runs.jsonl").items()}


@pytest.mark.slow
def test_a_cluster_gives_the_report_of_one_computer(course, tmp_path, address):
    here, there = tmp_path / "here", tmp_path / "there"
    run(course, "--quiet", "--sandbox", "none", "--output", here)
    faults, outcomes = done(course, there, scheduler=address)
    assert faults == []
    assert outcomes == done(course, here)[1]
    assert len(outcomes) == 12
    run(course, "--quiet", "--report", "--output", there)
    assert rows(there) == rows(here)
    names = {path.name: path.read_bytes() for path in (here / "recordings").iterdir()}
    assert {path.name: path.read_bytes() for path in (there / "recordings").iterdir()} == names


def test_what_cannot_be_run_there_is_told_and_not_kept(course, tmp_path, address, monkeypatch):
    def refuse(*words):
        raise UsageError("no walls")

    monkeypatch.setattr(cluster.sandbox, "choose", refuse)
    monkeypatch.setattr(cluster, "_LAUNCHERS", {})
    faults, outcomes = done(course, tmp_path / "there", scheduler=address)
    assert "robot, maze, seed 1: no walls" in faults
    assert len(faults) == 12
    assert outcomes == {}


def test_a_cluster_that_is_not_there_is_a_line(course, tmp_path):
    words = ("--quiet", "--scheduler", "nonsense://x", "--output", tmp_path / "there")
    assert "--scheduler nonsense://x: " in run(course, *words, expect=2).stderr


def test_the_same_files_are_the_same_bytes_and_links_stay_links(tmp_path):
    write(tmp_path, "robot", ROBOT)
    folder = tmp_path / "agents" / "robot"
    (folder / "link").symlink_to("/etc/passwd")
    (folder / ".git").mkdir()
    one = cluster.pack(folder)
    (folder / "agent.py").touch()
    assert cluster.pack(folder) == one
    assert b"root:" not in one
    assert b".git" not in one
    assert cluster.pack(None) is None
