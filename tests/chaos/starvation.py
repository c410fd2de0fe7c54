"""The live filter and its drive on a machine that has no time for them.

As a program::

    python -m tests.chaos.starvation --runs 40 [--drive explore] [--lab maze corridors] [--speed 1]

Each run is a simulator in real time and an agent with `nice`, both programs of their own, beside a process a
core that does nothing but count. Prints, a run each: collisions, the most full turns within half a unit,
poses said with more than 0.9 and how many of them were off by more than half a unit.
"""

from __future__ import annotations

import argparse
import contextlib
import csv
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from benchmarks.busy import busy
from ciberrato.files.run_log import read_run
from ciberrato.system.process import processors

SURE = 0.9
OFF = 0.5
PATIENCE = 4.0
"""Seconds that an agent may take to end."""


@dataclass(frozen=True)
class Outcome:
    """What a run came to.

    Attributes
    ----------
    collisions : int
        As the simulator counts them.
    turns : float
        The most full turns in a row within half a unit.
    sure, wrong : int
        Poses said with more than `SURE`, and those of them that were off by more than `OFF` units.
    missed : int
        Running cycles that no command of the agent answered, of `cycles`.
    driven : float
        Units.
    slow, most : float
        Milliseconds of the slowest hundredth of answers, and of the slowest.
    """

    collisions: int
    turns: float
    sure: int
    wrong: int
    missed: int
    cycles: int
    driven: float
    slow: float
    most: float

    def __str__(self) -> str:
        return (
            f"{self.collisions:3d} collisions, {self.turns:.2f} turns, "
            f"{self.wrong} of {self.sure} sure poses wrong, "
            f"{self.missed} of {self.cycles} cycles not answered, {self.driven:.1f} units driven, "
            f"answers {self.slow:.0f} ms (99 %), {self.most:.0f} ms (most)"
        )


def run(lab: str, drive: str, seed: int, cycles: int, speed: float, niceness: int, late: bool) -> Outcome:
    """Let an agent drive from a place of the lab's grid, and compare what it said with the truth."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        parameters = folder / "parameters.xml"
        parameters.write_text(f'<Parameters SimTime="{cycles}" CycleTime="50"/>')
        truth, result, log = folder / "truth.csv", folder / "result.json", folder / "run.jsonl"
        words = [
            "simulator_stub",
            "--lab",
            lab,
            "--grid",
            lab,
            "--seed",
            str(seed),
            "--param",
            str(parameters),
        ]
        words += ["--speed", f"{speed:g}", "--exit-at-end", "--autostart", "1", "--port", "0"]
        words += ["--truth", str(truth), "--result", str(result)]
        with (
            open(folder / "said", "w") as said,
            subprocess.Popen(
                [sys.executable, "-m", *words], stdout=subprocess.PIPE, stderr=said, text=True
            ) as simulator,
        ):
            try:
                assert simulator.stdout is not None
                port = next(
                    match[1] for line in simulator.stdout if (match := re.search(r"udp .*:(\d+)", line))
                )
                agent = [sys.executable, "-m", "agent", "-h", f"127.0.0.1:{port}", "-m", lab, "-p", "0"]
                agent += ["--drive", drive, "--log", str(log), "-o", str(folder / "belief.out")]
                if not late:
                    agent = ["nice", "-n", str(niceness), *agent]
                said_by_agent = drive_starved(agent, niceness if late else None, simulator)
                simulator.wait(120.0)
            finally:
                simulator.kill()
        answers = re.search(r"answers: .*?, ([\d.]+) ms \(99 %\), ([\d.]+) ms \(most\)", said_by_agent)
        slow = (float(answers[1]), float(answers[2])) if answers else (math.nan, math.nan)
        return compare(truth, result, log, slow)


def drive_starved(agent: list[str], niceness: int | None, simulator: subprocess.Popen[str]) -> str:
    """Run the agent, made nice when it has registered if that is asked for; return what it said.

    When the simulator has ended the agent has some seconds to process what is left: the log is there already.
    """
    said: list[str] = []
    with subprocess.Popen(agent, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None

        def listen(lines: Iterable[str]) -> None:
            for line in lines:
                said.append(line)
                if niceness is not None and "registered as" in line:
                    make_nice(process.pid, niceness)

        listener = threading.Thread(target=listen, args=(process.stderr,), daemon=True)
        listener.start()
        simulator.wait(900.0)
        try:
            assert process.wait(PATIENCE) == 0, "".join(said)
        except subprocess.TimeoutExpired:
            pass
        finally:
            process.kill()
        listener.join()
    return "".join(said)


def make_nice(process: int, niceness: int) -> None:
    """Lower the priority of a process, of all its threads and of its children."""
    for task in Path(f"/proc/{process}/task").iterdir():
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, int(task.name), niceness)
            for child in (task / "children").read_text().split():
                make_nice(int(child), niceness)


def compare(truth: Path, result: Path, log: Path, slow: tuple[float, float]) -> Outcome:
    """Compare the log's estimates with the true poses of the same cycles."""
    with open(truth, newline="") as file:
        poses = {
            int(row["time"]): (float(row["x"]), float(row["y"]), math.radians(float(row["dir_deg"])))
            for row in csv.DictReader(file)
        }
    (world,) = json.loads(result.read_text())["runs"]
    (robot,) = world["robots"]
    turns = turned = driven = 0.0
    place = former = poses[0]
    for time in range(1, world["time"] + 1):
        pose = poses[time]
        driven += math.dist(pose[:2], former[:2])
        turned += math.remainder(pose[2] - former[2], 2.0 * math.pi)
        if math.dist(pose[:2], place[:2]) > 0.5:
            place, turned = pose, 0.0
        turns = max(turns, abs(turned) / (2.0 * math.pi))
        former = pose
    sure = wrong = 0
    for cycle in read_run(log).cycles:
        if cycle.estimate is not None and cycle.estimate[3] > SURE and cycle.time in poses:
            sure += 1
            wrong += math.dist(cycle.estimate[:2], poses[cycle.time][:2]) > OFF
    return Outcome(robot["collisions"], turns, sure, wrong, robot["unanswered"], world["time"], driven, *slow)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.chaos.starvation")
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--lab", nargs="+", default=["maze", "corridors", "rooms", "standard"])
    parser.add_argument("--drive", default="explore")
    parser.add_argument("--cycles", type=int, default=400)
    parser.add_argument("--speed", type=float, default=1.0)
    parser.add_argument("--nice", type=int, default=10)
    parser.add_argument("--late", action="store_true", help="nice only when it has registered")
    parser.add_argument("--jobs", type=int, default=1, help="runs at a time")
    parser.add_argument("--busy", type=int, default=processors(), help="processes that only count")
    options = parser.parse_args()

    def one(number: int) -> Outcome:
        lab, seed = options.lab[number % len(options.lab)], options.first_seed + number
        outcome = run(lab, options.drive, seed, options.cycles, options.speed, options.nice, options.late)
        print(f"{lab:10} {seed:4d}  {outcome}", flush=True)
        return outcome

    with busy(options.busy), ThreadPoolExecutor(options.jobs) as pool:
        outcomes = list(pool.map(one, range(options.runs)))
    print(
        f"{len(outcomes)} runs: {sum(one.collisions > 0 for one in outcomes)} with collisions, "
        f"{sum(one.turns > 1.5 for one in outcomes)} that turned more than one and a half times in place, "
        f"{sum(one.wrong > 0 for one in outcomes)} with a sure pose that was wrong "
        f"({sum(one.wrong for one in outcomes)} of {sum(one.sure for one in outcomes)} sure poses); "
        f"{sum(one.missed for one in outcomes)} of {sum(one.cycles for one in outcomes)} cycles not answered"
    )


if __name__ == "__main__":
    main()
