"""The programs in a folder full of the user's own files, which are called as ours are."""

import os
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from ciberrato.processes import module_command

BIN = Path(sys.executable).parent
TRAPS = ("agent", "maps", "viewer", "evaluation", "simulator_stub", "localization", "client", "examples")
SECONDS = 300


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Half of the names are modules, half are packages; each says so and ends the program that loads it."""
    home = tmp_path / "home"
    home.mkdir()
    for number, name in enumerate(TRAPS):
        trap = home / f"{name}.py" if number % 2 == 0 else home / name / "__init__.py"
        trap.parent.mkdir(exist_ok=True)
        trap.write_text(
            f"print('this is the user's own {name}')\nraise SystemExit(77)\n".replace("user's", "users")
        )
    (home / "maps" / "corridors_lab.xml").write_text("not a lab")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))  # cold: tables are built by a child
    monkeypatch.setenv("PYTHONUNBUFFERED", "1")
    monkeypatch.delenv("PYTHONPATH", raising=False)
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    return home


def start(folder, *words, **options):
    return subprocess.Popen(
        words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options
    )


def program(name):
    return str(BIN / f"ciberrato-{name}")


def until(running, pattern):
    """Read up to a line that matches; a program that never prints it is killed, which ends the reading."""
    lines = []
    timer = threading.Timer(SECONDS, running.kill)
    timer.start()
    try:
        for line in running.stdout:
            lines.append(line)
            if found := re.search(pattern, line):
                return found
    finally:
        timer.cancel()
    raise AssertionError(f"no {pattern} in: {''.join(lines)}")


def end(running):
    running.send_signal(signal.SIGINT)
    said, _ = running.communicate(timeout=SECONDS)
    return said


def test_the_users_own_module_is_theirs(folder):
    done = subprocess.run(
        [sys.executable, "-c", "import agent"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (77, "this is the users own agent\n")


def test_children_find_ours_though_the_folder_is_on_the_path_of_all_pythons(folder, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([".", str(folder)]))
    words = module_command("agent", "--version")
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=SECONDS, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("ciberrato ")


@pytest.mark.parametrize("name", ["agent", "simulator", "evaluate", "grade", "lab", "viewer"])
def test_installed_programs_are_ours_though_the_folder_is_on_the_path_of_all_pythons(
    folder, monkeypatch, name
):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([".", str(folder)]))
    words = [program(name), "--version"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=SECONDS, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("ciberrato ")


@pytest.mark.slow
def test_simulator_agent_and_viewer_with_all_their_children(folder):
    simulator = start(
        folder,
        *(program("simulator"), "--lab", "corridors", "--grid", "corridors", "--seed", "1"),
        *("--port", "0", "--bind", "127.0.0.1", "--autostart", "1", "--lockstep", "--view", "0"),
    )
    try:
        said = [until(simulator, r"udp \S+:(\d+)")]
        page = until(simulator, r"page: (\S+)")  # printed by the viewer, a child of the simulator
        assert page[1].startswith("http://127.0.0.1:")
        agent = start(
            folder,
            *(program("agent"), "-h", f"127.0.0.1:{said[0][1]}", "-m", "corridors", "--drive", "goto:3,7"),
            *("--exit-when-finished", "--lockstep", "--watch"),
            env={**os.environ, "TERM": "dumb"},
        )
        try:
            out, _ = agent.communicate(timeout=SECONDS)
        finally:
            agent.kill()
        assert agent.returncode == 0, out
        assert "users own" not in out
        assert "Traceback" not in out
        assert (folder / "localization.out").exists()
        assert "users own" not in end(simulator)
        assert simulator.returncode == 0
    finally:
        simulator.kill()


@pytest.mark.parametrize(
    "words",
    [
        [program("agent"), "--help"],
        [program("simulator"), "--help"],
        [program("viewer"), "--help"],
        [program("evaluate"), "--help"],
        [sys.executable, "-m", "ciberrato.viewer", "--help"],
        [sys.executable, "-m", "ciberrato.evaluation", "--help"],
        [program("agent"), "draw", "walls", "-m", "corridors", "-o", "walls.png"],
    ],
    ids=lambda words: " ".join([Path(words[0]).name, *words[1:4]]),
)
def test_commands(folder, words):
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=SECONDS, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "users own" not in done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    "program_words", [[program("evaluate")], [sys.executable, "-m", "ciberrato.evaluation"]]
)
def test_an_evaluation_with_its_workers(folder, program_words):
    words = [
        *program_words,
        "--lab",
        "corridors",
        "--seeds",
        "1",
        "--cycles",
        "5",
        "--jobs",
        "2",
        "--output",
        "o.jsonl",
    ]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=SECONDS, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "users own" not in done.stdout + done.stderr
