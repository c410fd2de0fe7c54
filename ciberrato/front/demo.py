"""Run the whole path once: simulator, agent, ``localization.out``, a table and a figure.

Starts the simulator on a free port and the agent as a process of its own, lets the robot drive until a
wall stops it, sends the agent the signal that Ctrl-C sends, and looks at what it leaves. The agent is told
the lab, not where in it the robot stands. Run it as ``ciberrato demo`` or ``make demo``.
"""

from __future__ import annotations

import contextlib
import re
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO

from agent.offline.summary import step_table
from ciberrato.command_line import ProgramParser, run_program
from ciberrato.errors import UsageError
from ciberrato.files.beliefs import read_beliefs
from ciberrato.files.lab import read_lab
from ciberrato.files.run_log import read_run
from ciberrato.files.truth import read_truth, true_cells
from ciberrato.labs import find_lab
from ciberrato.processes import module_command
from ciberrato.system.process import interrupt, interruptible

LAB = "standard"
PATIENCE = 60.0
"""Seconds after which a process that says nothing is given up."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the demonstration.

    Parameters
    ----------
    argv : sequence of str or None
        Command line without the program's name.

    Returns
    -------
    int
        Exit status: 0 when the robot ended up most likely where it really is.
    """
    parser = ProgramParser(
        "ciberrato demo", "Run simulator and agent once, and show what the robot believes."
    )
    parser.add_argument("--seed", type=int, default=7, help="seed of the simulator's noise; default: 7")
    parser.add_argument(
        "--folder", type=Path, default=Path("demo"), help="folder of the files; default: demo"
    )

    def body() -> int:
        options = parser.parse_args(argv)
        return demonstrate(options.folder, options.seed)

    return run_program("ciberrato demo", body)


def demonstrate(folder: Path, seed: int) -> int:
    """Run simulator and agent once and show what came of it.

    Parameters
    ----------
    folder : Path
        Gets ``localization.out``, ``run.jsonl``, ``truth.csv`` and ``belief.png``.
    seed : int

    Returns
    -------
    int
        0 when the last belief is right.

    Raises
    ------
    UsageError
        If one of the processes fails.
    """
    began = time.monotonic()
    folder.mkdir(parents=True, exist_ok=True)
    output, log, truth = folder / "localization.out", folder / "run.jsonl", folder / "truth.csv"
    for path in (output, log, truth, folder / "belief.png"):
        path.unlink(missing_ok=True)  # what is there afterwards is from this run
    simulator_words = ["--lab", LAB, "--grid", LAB, "--seed", str(seed), "--port", "0"]
    simulator_words += [
        "--autostart",
        "1",
        "--lockstep",
        "--answer-limit",
        "inf",
        "--speed",
        "20",
        "--truth",
        str(truth),
    ]
    simulator_words += ["--bind", "127.0.0.1"]
    with running("simulator_stub", simulator_words) as simulator:
        port = announced_port(simulator)
        agent_words = ["-h", f"127.0.0.1:{port}", "-m", LAB, "-p", "1", "-r", "demo"]
        agent_words += ["--log", str(log), "-o", str(output)]
        with running("agent", agent_words) as agent:
            wait_for_line(agent, re.compile("wall ahead"), "agent")
            print("  ^C")
            interrupt(agent)
            pass_on(agent)
            status = agent.wait(PATIENCE)
        if status:
            raise UsageError(f"the agent ended with status {status}")
    return show(folder, began)


def show(folder: Path, began: float) -> int:
    """Print the table and draw the figure, with the truth that only the simulator knew.

    Parameters
    ----------
    folder : Path
        With the files of the run.
    began : float
        Begin of the demonstration, by the monotonic clock.

    Returns
    -------
    int
        0 when the last belief is right.
    """
    from agent.views.figures import belief_panels

    beliefs = read_beliefs(folder / "localization.out")[-1].beliefs
    times = [step.time for step in read_run(folder / "run.jsonl").steps]
    cells = true_cells(read_truth(folder / "truth.csv"), times)
    table = step_table(beliefs, [None, *cells])
    print(f"\nlab {LAB}, {beliefs.shape[1]} x {beliefs.shape[2]} cells, named by their centres in units\n")
    print(table)
    title = f"Where is the robot? Lab {LAB!r}, start cell unknown (red ring: the true cell)"
    lab = read_lab(find_lab(LAB))
    belief_panels(beliefs, folder / "belief.png", lab=lab, true_cells=[None, *cells], title=title)
    print(f"\nin {folder}/: localization.out  run.jsonl  truth.csv  belief.png")
    print(f"took {time.monotonic() - began:.1f} s")
    return 0 if table.endswith("right") else 1


@contextlib.contextmanager
def running(module: str, words: Sequence[str]) -> Iterator[subprocess.Popen[str]]:
    """Run a module as a process; end it, first politely, when the block is left.

    Parameters
    ----------
    module : str
    words : sequence of str
        Its command line.

    Yields
    ------
    subprocess.Popen
        Started program; its output comes through one pipe.
    """
    name = {"simulator_stub": "ciberrato-simulator", "agent": "ciberrato-agent"}[module]
    print(f"\n$ {name} {' '.join(words)}", flush=True)
    process = subprocess.Popen(
        module_command(module, *words),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        **interruptible(),
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            interrupt(process)
        try:
            process.communicate(timeout=PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


def announced_port(simulator: subprocess.Popen[str]) -> int:
    """Read the port that the simulator chose from what it prints.

    Parameters
    ----------
    simulator : subprocess.Popen

    Returns
    -------
    int
    """
    return int(wait_for_line(simulator, re.compile(r"udp\D.*:(\d+)"), "simulator")[1])


def wait_for_line(process: subprocess.Popen[str], pattern: re.Pattern[str], who: str) -> re.Match[str]:
    """Forward what a process prints until a line matches.

    Parameters
    ----------
    process : subprocess.Popen
    pattern : compiled regular expression
    who : str
        Its name for the reader.

    Returns
    -------
    re.Match

    Raises
    ------
    UsageError
        If its output ends before that.
    """
    for line in _stdout(process):
        print(f"  {line}", end="", flush=True)
        found = pattern.search(line)
        if found:
            return found
    raise UsageError(f"the {who} ended before it said {pattern.pattern!r}")


def pass_on(process: subprocess.Popen[str]) -> None:
    """Forward what a process prints until it ends.

    Parameters
    ----------
    process : subprocess.Popen
    """
    for line in _stdout(process):
        print(f"  {line}", end="", flush=True)


def _stdout(process: subprocess.Popen[str]) -> IO[str]:
    assert process.stdout is not None
    return process.stdout
