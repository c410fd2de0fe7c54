from __future__ import annotations

import dataclasses
import signal
import subprocess
import sys
import threading
import time

import pytest

from ciberrato.errors import UsageError
from ciberrato.evaluation import cluster
from ciberrato.evaluation.judged import code_of
from ciberrato.evaluation.runner import read_evaluation, run_tasks
from ciberrato.evaluation.task import Task

distributed = pytest.importorskip("distributed")

PATIENCE = 300.0  # seconds; only a failure takes so long
TIMES = ("filter_ms", "drive_ms", "ms_counts")
SMALL = """<Lab Name="small" Height="4" Width="6">
  <Wall Height="4"><Corner X="1.9" Y="2"/><Corner X="2.1" Y="2"/><Corner X="2" Y="4"/></Wall>
</Lab>"""


def workers(number):
    """Start a scheduler and workers, in this process."""
    return distributed.LocalCluster(
        n_workers=number,
        threads_per_worker=1,
        processes=False,
        protocol="tcp://",
        host="127.0.0.1",
        dashboard_address="127.0.0.1:0",
    )


@pytest.fixture(scope="module")
def address():
    with workers(2) as two:
        yield two.scheduler_address


@pytest.fixture
def tasks(tmp_path, monkeypatch):
    monkeypatch.setenv("CIBERRATO_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small_lab.xml").write_text(SMALL)
    return [
        Task(lab="small_lab.xml", seed=seed, cycles=20, resolution=0.5, staged=False) for seed in range(3)
    ]


def test_a_cluster_gives_the_results_of_one_process(address, tasks, tmp_path):
    (tmp_path / "grid.xml").write_text('<Grid><Position X="2" Y="3" Dir="0"/></Grid>')  # in a wall
    bad = Task(lab="small_lab.xml", start="grid", grid="grid.xml", resolution=0.5, staged=False)
    there = run_tasks([bad, *tasks], tmp_path / "there.jsonl", scheduler=address, progress=None)
    here = run_tasks([bad, *tasks], tmp_path / "here.jsonl", jobs=1, progress=None)
    # Under the names that were given, although the workers get absolute ones.
    assert [result.task for result in there.results] == tasks
    assert [failure.task for failure in there.failures] == [bad]
    for one, other in zip(there.results, here.results, strict=True):
        first, second = one.outcome.to_json(), other.outcome.to_json()
        assert {k: v for k, v in first.items() if k not in TIMES} == {
            k: v for k, v in second.items() if k not in TIMES
        }
    assert sorted(r.task.seed for r in read_evaluation(tmp_path / "there.jsonl").results) == [0, 1, 2]


def test_a_filter_of_ones_own_runs_on_the_workers(address, tasks, tmp_path, monkeypatch):
    (tmp_path / "cluster_filter.py").write_text(
        "from types import SimpleNamespace\n"
        "def make(setup):\n"
        "    found = SimpleNamespace(x=3.0, y=2.0, heading=0.0, probability=0.5)\n"
        "    return SimpleNamespace(observe=lambda measures, command: None, estimate=lambda: found)\n"
    )
    monkeypatch.setattr(sys, "path", [*sys.path])
    code = code_of("cluster_filter:make", "explore")
    own = [dataclasses.replace(task, filter="cluster_filter:make", code=code) for task in tasks]
    there = run_tasks(own, tmp_path / "there.jsonl", scheduler=address, progress=None)
    assert [result.task for result in there.results] == own
    assert all(result.outcome.first_claim is None for result in there.results)
    other = [dataclasses.replace(task, code="0" * 12) for task in own]
    with pytest.raises(UsageError, match=r"the code of cluster_filter:make and explore is .* there, and 000"):
        list(cluster.on_cluster(other, address))
    lost = [dataclasses.replace(task, filter="lost_filter:make", code=code) for task in tasks]
    with pytest.raises(UsageError, match="filter lost_filter:make cannot be loaded"):
        list(cluster.on_cluster(lost, address))


def test_workers_without_the_labs_or_with_other_code_are_told_at_once(address, tasks, tmp_path, monkeypatch):
    lost = [*tasks, Task(lab=str(tmp_path / "lost_lab.xml"))]
    with pytest.raises(UsageError, match=r"no file .*lost_lab\.xml"):
        list(cluster.on_cluster(lost, address))
    theirs = cluster._version() | {"numpy": "0.1"}
    monkeypatch.setattr(cluster, "_ask", lambda *arguments: {"tcp://there": theirs})
    with pytest.raises(UsageError, match=r"worker tcp://there: numpy is 0\.1 there"):
        list(cluster.on_cluster(tasks, address))


def test_a_cluster_without_workers_and_none_at_all_are_told_in_a_line(tasks):
    with workers(0) as empty, pytest.raises(UsageError, match="no workers"):
        list(cluster.on_cluster(tasks, empty.scheduler_address))
    with pytest.raises(UsageError, match="nonsense"):
        list(cluster.on_cluster(tasks, "nonsense::"))


def test_what_a_worker_raises_loses_its_own_task_only(address, tasks, monkeypatch):
    def deadly(task, folder=None):
        from ciberrato.evaluation.attempt import attempt

        if task.seed == 1:
            raise MemoryError("so much for the worker")
        return attempt(task)

    monkeypatch.setattr(cluster, "attempt", deadly)
    found = {one.task.seed: one for one in cluster.on_cluster(tasks, address)}
    assert found[1].error == "MemoryError: so much for the worker"
    assert found[0].outcome.cycles == found[2].outcome.cycles == 20


@pytest.fixture
def one_by_one(monkeypatch):
    """Let the worker, a thread of this process, finish a task, and keep it in the next until released."""
    from ciberrato.evaluation import episode

    run_task, begun, released = episode.run_task, [], threading.Event()

    def hesitant(task):
        begun.append(task)
        if len(begun) > 1:
            assert released.wait(PATIENCE)
        return run_task(task)

    monkeypatch.setattr(episode, "run_task", hesitant)
    yield begun, released
    released.set()


def test_an_interrupted_evaluation_ends_at_once_and_takes_its_tasks_back(tasks, tmp_path, one_by_one):
    output, (begun, released) = tmp_path / "out.jsonl", one_by_one
    with workers(1) as one:
        command = [
            *(sys.executable, "-m", "ciberrato.evaluation", "--lab", "small_lab.xml", "--seeds", "500"),
            *("--cycles", "20", "--resolution", "0.5", "--output", str(output), "--quiet"),
            *("--scheduler", one.scheduler_address),
        ]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=tmp_path) as process:
            try:
                wait_until(lambda: len(read_evaluation(output).results) == 1 and len(begun) == 2)
                process.send_signal(signal.SIGINT)
                _, error = process.communicate(timeout=PATIENCE)
            finally:
                process.kill()
        assert process.returncode == 130
        assert error == "\nciberrato-evaluate: interrupted; the same command continues from here\n"
        wait_until(lambda: not one.scheduler.tasks)
        released.set()
    assert len(begun) == 2
    assert len(read_evaluation(output).results) == 1


def wait_until(condition):
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)
