"""The sandbox of containers, with a stand-in for docker that checks what it is told: no engine runs here."""

import contextlib
import json
import os
import sys
from pathlib import Path

import pytest

from ciberrato.processes import ROOT
from ciberrato.version import __version__
from tests.grading.agents import CRASHING, FLOODING, HANGING, ROBOT, table, write
from tests.grading.program import rows, run

HEAD = """
image = "course:1"
[limits]
processes = 40
memory = 150
silence = 1
disk = 8
[[lab]]
name = 'maze'
grid = 'maze'
set = {SimTime = 40}
"""


@pytest.fixture(params=["docker", "podman"])
def engine(tmp_path, monkeypatch, request):
    """The stand-in, alone on the path, and what it was told."""
    state, programs = tmp_path / "state", tmp_path / "programs"
    state.mkdir()
    programs.mkdir()
    program = programs / request.param
    program.write_text(f'#!/bin/sh\nexec {sys.executable} {Path(__file__).with_name("engine.py")} "$@"\n')
    program.chmod(0o755)
    for tool in ("env", "true"):
        (programs / tool).symlink_to(f"/usr/bin/{tool}")
    monkeypatch.setenv("PATH", str(programs))
    monkeypatch.setenv("ENGINE_STATE", str(state))
    monkeypatch.setenv("ENGINE_CHECKOUT", str(ROOT))

    def told():
        return [json.loads(line) for line in (state / "log").read_text().splitlines()]

    return request.param, state, told


def engine_inside(state, name):
    """Processes that were started in a container and still run."""
    wanted = f"STAND_IN_CONTAINER={state / name}".encode()
    found = []
    for path in Path("/proc").glob("[0-9]*/environ"):
        with contextlib.suppress(OSError):  # gone, or another user's
            if wanted in path.read_bytes():
                found.append(path.parent.name)
    return found


def course(tmp_path, *agents, head=HEAD):
    path = tmp_path / "course.toml"
    path.write_text(head + "".join(agents))
    return path


@pytest.mark.slow
def test_each_run_is_two_containers_with_walls_and_limits(tmp_path, engine):
    name, state, told = engine
    write(tmp_path, "robot", ROBOT)
    path = course(tmp_path, table("robot", build="env"))
    run(path, "--sandbox", "docker", "--quiet", "--output", tmp_path / "report")
    (row,) = rows(tmp_path / "report")
    assert (row["status"], row["answered"]) == ("time over", "40")
    assert len(list((tmp_path / "report" / "recordings").iterdir())) == 1
    probe, build, simulator, agent = told()
    assert probe[0]["--network"] == "none"
    for options, image, _ in (build, simulator, agent):
        assert image == "course:1"
        assert options["--read-only"] is True
        assert options["--cap-drop"] == "ALL"
        assert options["--security-opt"] == "no-new-privileges"
        assert options["--pull"] == "never"
        assert options["--user"] == f"{os.getuid()}:{os.getgid()}"
        assert ("--userns" in options) == (name == "podman")
    assert build[0]["--network"] == simulator[0]["--network"] == "none"
    assert agent[0]["--network"] == f"container:{simulator[0]['--name']}"
    for options, _, _ in (build, agent):
        assert (options["--memory"], options["--memory-swap"]) == ("150m", "150m")
        assert options["--pids-limit"] == "40"
        assert set(options["--ulimit"]) == {"nofile=256:256", f"fsize={8 << 20}:{8 << 20}", "core=0:0"}
        assert options["--tmpfs"] == f"/tmp:size={8 << 20}"
        (volume,) = options["--volume"]  # its own folder alone
        assert volume.endswith(":/agent")
        assert not any(entry.startswith("PATH=") for entry in options["--env"])
    assert "CIBERRATO_HOST=127.0.0.1" in agent[0]["--env"]
    assert "CIBERRATO_LOCKSTEP=1" in agent[0]["--env"]
    assert agent[2] == ["python", "agent.py", "127.0.0.1", "6000", "robot"]
    assert simulator[2][:4] == ["python", "-P", "-m", "simulator_stub"]
    names = {one[0]["--name"] for one in (build, simulator, agent)}
    assert {path.stem for path in state.glob("*.removed")} == names


@pytest.mark.slow
def test_what_comes_of_bad_agents_is_told_in_containers_too(tmp_path, engine):
    _, state, _ = engine
    programs = {
        "crashing": CRASHING,
        "hanging": HANGING,
        "flooding": FLOODING,
        "failing": "raise SystemExit(3)",
    }
    for name, program in programs.items():
        write(tmp_path, name, program)
    path = course(tmp_path, *map(table, programs))
    run(path, "--sandbox", "docker", "--quiet", "--output", tmp_path / "report")
    came = {row["agent"]: (row["status"], row["detail"]) for row in rows(tmp_path / "report")}
    assert came == {
        "crashing": ("crashed at 21", "exit status 1"),
        "hanging": ("silent since 20", ""),
        "flooding": ("stopped at 20", "output limit"),
        "failing": ("never registered", "exit status 3"),
    }
    names = [pid.stem for pid in state.glob("*.pid")]
    assert len(names) > len(programs)
    # The engine was told to end them all: those that left the group, too.
    assert [pid for name in names for pid in engine_inside(state, name)] == []
    (state / "out-of-memory").touch()
    run(path, "--sandbox", "docker", "--quiet", "--output", tmp_path / "again")
    assert rows(tmp_path / "again")[0]["detail"] == "memory limit"


def test_what_is_missing_is_a_line(tmp_path, engine, monkeypatch):
    write(tmp_path, "robot", ROBOT)

    def said(head):
        return run(course(tmp_path, table("robot"), head=head), "--sandbox", "docker", expect=2).stderr

    assert "the course names no image; write image = ..." in said(HEAD.replace("image", "title"))
    assert "No such image: course:2" in said(HEAD.replace("course:1", "course:2"))
    assert "is no image" in said(HEAD.replace("course:1", "--privileged"))
    monkeypatch.setenv("ENGINE_CHECKOUT", str(tmp_path))
    (tmp_path / "ciberrato").mkdir()
    (tmp_path / "ciberrato" / "__init__.py").touch()
    (tmp_path / "ciberrato" / "version.py").write_text("__version__ = '0.0'")
    assert f"has ciberrato 0.0, and here is {__version__}" in said(HEAD)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert "there is neither docker nor podman here" in said(HEAD)
