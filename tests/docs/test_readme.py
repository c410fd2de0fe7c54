"""The README's commands and program, run as they are written."""

import contextlib
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
PROGRAMS = {"ciberrato-agent": "agent", "ciberrato-simulator": "simulator_stub"}


def commands():
    """Every `$ ...` line of the console blocks."""
    for block in re.findall(r"```console\n(.*?)```", TEXT, re.DOTALL):
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
def watchdog(*processes, seconds=300):
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
def test_the_simulator_for_ci_starts_and_ends(tmp_path):
    simulator = process(find("ciberrato-simulator --lab maze"), "--bind", "127.0.0.1", folder=tmp_path)
    with watchdog(simulator):
        read_until(simulator, r"listening on udp 127\.0\.0\.1:\d+")
        simulator.send_signal(signal.SIGINT)
        assert simulator.wait() == 0


def test_the_program_runs(capsys):
    six_lines, program = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    # The six lines are those of docs/client.md, whose programs are run by tests of their own.
    assert six_lines in (ROOT / "docs" / "client.md").read_text()
    exec(compile(program, "README.md", "exec"), {})
    time, collision, *_ = capsys.readouterr().out.split()
    assert (time, collision) in {("100", "True"), ("100", "False")}


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
