"""Deadlines of the live pose filter: agent and simulator as real processes over UDP, in real time.

Rows are the slowest hundredth of answers (arrival of Measures to the answer); medians, cycles lost, when the
tables came and what memory they took are in the notes. A machine that does other things at once shows that
here, too: the target is for one that does not.
"""

from __future__ import annotations

import dataclasses
import math
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.measure import Row
from ciberrato.files.run_log import read_run
from ciberrato.labs import find_grid, find_lab

LABS = os.environ.get("CIBERRATO_LABS")
CYCLES = int(os.environ.get("CIBERRATO_BENCH_CYCLES", "400"))
DRIVE = os.environ.get("CIBERRATO_BENCH_DRIVE", "active")
_NUMBER = r"([\d.]+)"


@dataclass(frozen=True, slots=True)
class Live:
    """Figures that an agent prints at the end of a run; times in seconds, memory in megabytes."""

    loops: str
    filter: tuple[float, float, float]
    answers: tuple[float, float, float]
    behind: int
    lost: int
    unanswered: int
    tables: str
    memory: tuple[float, float]
    answered: int = 0
    late: int = 0
    """Answers that took longer than half a cycle."""
    first: int = 0
    """Messages not answered in the first ten cycles."""

    @property
    def note(self) -> str:
        """Answers without the slowest hundredth."""
        median, slow, most = (1e3 * value for value in self.filter)
        return (
            f"answers {1e3 * self.answers[0]:.1f} ms (median), {1e3 * self.answers[2]:.0f} ms (most); "
            f"filter {median:.1f}, {slow:.1f}, {most:.0f} ms; behind in {self.behind}, lost {self.lost}, "
            f"unanswered {self.unanswered}; {self.tables}; {self.memory[1]:.0f} MB for computing tables"
        )


def rows() -> Iterator[Row]:
    """Yield a row for every lab, kind of loops and cycle time."""
    if not LABS:
        note = "skipped: set CIBERRATO_LABS to the folder of public labs"
        yield Row(group="agent, live: pathFinderEval1", who="all", seconds=None, note=note)
    public = [str(Path(LABS) / "PathFinder/pathFinderEval1.xml")] if LABS else []
    for name in ("standard", "corridors", "maze", *public):
        group = f"agent, live: {Path(name).stem}, --drive {DRIVE}, {CYCLES} cycles"
        with tempfile.TemporaryDirectory() as folder:
            cache = Path(folder) / "cache"
            for compiled, cycle_time, who in (
                ("off", 50, "numpy, 50 ms, no tables yet"),
                ("off", 50, "numpy, 50 ms"),
                ("auto", 50, "numba, 50 ms"),
                ("auto", 20, "numba, 20 ms"),
            ):
                live = run(name, compiled, cycle_time, cache)
                if compiled == "auto" and live.loops != "numba":
                    yield Row(group=group, who=who, seconds=None, note="skipped: pip install numba")
                    continue
                yield Row(
                    group=group,
                    who=who,
                    seconds=live.answers[1],
                    ours=True,
                    megabytes=live.memory[0],
                    target=cycle_time / 2000.0,
                    note=live.note,
                )


def run(lab: str, compiled: str, cycle_time: int, cache: Path, *, cycles: int = CYCLES) -> Live:
    """Drive once in real time, and read what the agent says of itself."""
    with tempfile.TemporaryDirectory() as folder:
        parameters = Path(folder) / "params.xml"
        parameters.write_text(
            f'<Parameters SimTime="{cycles}" CycleTime="{cycle_time}" MotorsNoise="1.5" ObstacleNoise="0.1"/>'
        )
        world = ["--lab", lab, "--grid", grid_of(lab), "--param", str(parameters), "--seed", "3"]
        simulator = subprocess.Popen(
            [sys.executable, "-m", "simulator_stub", *world, "--port", "0", "--autostart", "1"],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        try:
            assert simulator.stdout is not None
            simulator.stdout.readline()
            port = re.search(r":(\d+)$", simulator.stdout.readline())
            assert port is not None
            host = ["-h", f"127.0.0.1:{port[1]}", "-m", lab]
            files = ["--log", f"{folder}/run.jsonl", "-o", f"{folder}/localization.out"]
            options = ["--angles", "0,60,-60,180", "--drive", DRIVE]
            agent = subprocess.run(
                [sys.executable, "-m", "agent", *host, *options, *files],
                env=os.environ | {"CIBERRATO_CACHE": str(cache), "CIBERRATO_COMPILED": compiled},
                capture_output=True,
                text=True,
                check=False,
            )
        finally:
            simulator.send_signal(signal.SIGTERM)
            simulator.communicate()
        if agent.returncode != 0:
            raise RuntimeError(agent.stderr)
        begin = [cycle for cycle in read_run(Path(folder) / "run.jsonl").cycles if cycle.time < 10]
    live = parse(agent.stderr)
    return dataclasses.replace(live, first=sum(cycle.start and not cycle.answered for cycle in begin))


def grid_of(lab: str) -> str:
    """Return a start: the lab's own, or a pose in its second cell."""
    return str(find_grid(lab)) if find_lab(lab).parent.name == "maps" else "3,3,90"


def parse(said: str) -> Live:
    """Read the lines of `ciberrato.localization.live.statistics`."""
    spread = rf"{_NUMBER} ms a cycle \(median\), {_NUMBER} ms \(99 %\), {_NUMBER} ms \(most\)"
    filtered = re.search(rf"filter \((\w+)\): {spread}; behind in (\d+) of", said)
    answers = re.search(rf"answers: {spread}", said)
    tables = re.search(rf"(tables: .*); memory at most {_NUMBER} MB, {_NUMBER} MB of another", said)
    assert answers is not None, said
    missed = re.search(
        r"\d+ of (\d+) later than a cycle of .* ms, (\d+) than half a cycle; "
        r"(\d+) Measures unanswered, (\d+) lost",
        said,
    )
    assert missed is not None, said
    answered, late, unanswered, lost = map(int, missed.groups())
    return Live(
        loops=filtered[1] if filtered else "no filter yet",
        filter=_seconds(filtered.groups()[1:4]) if filtered else (math.nan,) * 3,
        answers=_seconds(answers.groups()),
        behind=int(filtered[5]) if filtered else 0,
        lost=lost,
        unanswered=unanswered,
        tables=tables[1] if tables else "tables: not in time",
        memory=(float(tables[2]), float(tables[3])) if tables else (math.nan, math.nan),
        answered=answered,
        late=late,
    )


def _seconds(milliseconds: tuple[str, ...]) -> tuple[float, float, float]:
    median, slow, most = (float(value) / 1000.0 for value in milliseconds)
    return median, slow, most
