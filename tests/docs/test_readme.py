"""The commands and the program of README.md and docs/two-terminals.md, run as they are written."""

import contextlib
import os
import re
import shlex
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "README.md").read_text()
TERMINALS = (ROOT / "docs" / "two-terminals.md").read_text()
PROGRAMS = {"ciberrato-agent": "agent", "ciberrato-simulator": "simulator_stub"}


def commands():
    """Every `$ ...` line of the console blocks of the page."""
    for block in re.findall(r"```console\n(.*?)```", TERMINALS, re.DOTALL):
        yield from (line[2:] for line in block.splitlines() if line.startswith("$ "))


def find(start):
    (found,) = [command for command in commands() if command.startswith(start)]
    return found


def process(command, *more, folder):
    words = shlex.split(command)
    words = [sys.executable, "-m", PROGRAMS[words[0]], *words[1:], *more]
    return subprocess.Popen(
        words,
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        stdin=subprocess.DEVNULL,
    )


@contextlib.contextmanager
def watchdog(*processes, seconds=900):
    """Kill what hangs, so that a reader of its output comes to an end."""
    timer = threading.Timer(seconds, lambda: [one.kill() for one in processes])
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        for one in processes:
            if one.poll() is None:
                one.kill()
            one.communicate()


def read_until(running, pattern):
    for line in running.stdout:
        found = re.search(pattern, line)
        if found:
            return found
    raise AssertionError(f"ended without {pattern!r}")


def test_every_make_target_that_is_named_exists():
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    named = set(re.findall(r"\bmake ([a-z]+)", TEXT))
    assert named
    assert named <= targets


def test_every_file_that_is_linked_exists():
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", TEXT) if "://" not in link]
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


@pytest.mark.slow
def test_the_two_terminals(tmp_path):
    pace = ("--port", "0", "--bind", "127.0.0.1", "--lockstep", "--answer-limit", "inf", "--speed", "1000")
    simulator = process(find("ciberrato-simulator --lab corridors"), *pace, folder=tmp_path)
    with watchdog(simulator):
        port = read_until(simulator, r"listening on udp 127\.0\.0\.1:(\d+)")[1]
        agent = process(find("ciberrato-agent -m corridors"), "-h", f"127.0.0.1:{port}", folder=tmp_path)
        with watchdog(agent):
            read_until(agent, "wall ahead")
            agent.send_signal(signal.SIGINT)
            told = agent.stdout.read()
            assert agent.wait() == 0
    assert "written: localization.out (15 blocks)" in told
    for start, expected in (
        ("ciberrato-agent inspect", "prior and 14 steps, 7 x 14 cells, 3 decimals"),
        ("ciberrato-agent localize", "written: published.out (15 blocks)"),
    ):
        running = process(find(start), folder=tmp_path)
        output, _ = running.communicate(timeout=300)
        assert running.returncode == 0
        assert expected in output
        assert re.search(r"13  \(27, 7\) +1\.000", output)


@pytest.mark.slow
def test_the_recipe_for_ci_is_complete_and_ends_by_itself(tmp_path):
    (recipe,) = re.findall(r"```sh\n(.*?)```", TEXT, re.DOTALL)
    recipe, limits = re.subn(
        r"^timeout \d+ ", "timeout 1000 ", recipe, flags=re.MULTILINE
    )  # on a busy machine
    assert limits == 2
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    results = []
    for name in ("once", "again"):
        folder = tmp_path / name
        folder.mkdir()
        done = subprocess.run(
            ["sh", "-c", recipe],
            cwd=folder,
            env=os.environ | {"PATH": path},
            capture_output=True,
            text=True,
            timeout=1200,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        assert done.stdout.splitlines()[-1] == "score 200"
        results.append([(folder / file).read_bytes() for file in ("run.log", "truth.csv", "result.json")])
    assert results[0] == results[1]


def test_the_recipe_for_ci_tells_that_the_simulator_did_not_start(tmp_path):
    (recipe,) = re.findall(r"```sh\n(.*?)```", TEXT, re.DOTALL)
    recipe, limits = re.subn(
        r"^timeout \d+ ", "timeout 1000 ", recipe, flags=re.MULTILINE
    )  # on a busy machine
    assert limits == 2
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    wrong = recipe.replace("--lab maze", "--lab mazze")
    assert wrong != recipe
    done = subprocess.run(
        ["sh", "-c", wrong],
        cwd=tmp_path,
        env=os.environ | {"PATH": path},
        capture_output=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 2
    assert b"did you mean 'maze'" in done.stderr


def test_the_six_lines_are_those_of_the_clients_page():
    # Its programs are run by tests of their own.
    (six_lines,) = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    assert six_lines in (ROOT / "docs" / "client.md").read_text()


def test_the_program_of_the_library_runs(capsys):
    (program,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "api.md").read_text(), re.DOTALL)
    exec(compile(program, "api.md", "exec"), {})
    time, collision, *_ = capsys.readouterr().out.split()
    assert (time, collision) in {("100", "True"), ("100", "False")}


def test_it_is_short():
    assert len(TEXT.splitlines()) < 120


@pytest.mark.slow
def test_the_demo_ends_where_the_readme_says(tmp_path):
    words = [sys.executable, "-m", "ciberrato", "demo", "--folder", str(tmp_path)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (shown,) = re.findall(r"```text\n(lab standard.*?)\n\nin demo/", TEXT, re.DOTALL)
    assert shown in done.stdout
    assert {path.name for path in tmp_path.iterdir()} == {
        "belief.png",
        "localization.out",
        "run.jsonl",
        "truth.csv",
    }


def test_every_run_of_the_agent_is_one_that_its_command_line_takes():
    from agent.commands import SUBCOMMANDS, drive

    runs = [shlex.split(command)[1:] for command in commands() if command.startswith("ciberrato-agent ")]
    parsed = [drive.make_parser().parse_args(words) for words in runs if words[0] not in SUBCOMMANDS]
    assert [options.drive for options in parsed] == [("right", None), ("goto", (27.0, 13.0))]
