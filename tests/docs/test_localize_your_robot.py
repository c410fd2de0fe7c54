"""The manual's two programs, run as they are written, against a simulator of its own process."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from ciberrato.files.run_log import read_run

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "localize-your-robot.md").read_text()
LIVE, RECORDED = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
LAB = (
    '<Lab Name="small" Height="6" Width="8"><Wall Height="4">'
    '<Corner X="1.9" Y="2"/><Corner X="2.1" Y="2"/><Corner X="2.1" Y="6"/>'
    '<Corner X="1.9" Y="6"/></Wall></Lab>'
)


def program(text):
    names = {}
    exec(compile(text, "docs/localize-your-robot.md", "exec"), names)
    return names


@pytest.fixture
def simulator(tmp_path, monkeypatch):
    """Start a simulator in lockstep; return its port, and the file of the true poses."""
    monkeypatch.setenv("CIBERRATO_CACHE", str(tmp_path / "cache"))
    (tmp_path / "small_lab.xml").write_text(LAB)
    truth = tmp_path / "truth.csv"
    world = ["--lab", str(tmp_path / "small_lab.xml"), "--grid", "1,4.2,77", "--seed", "1"]
    running = subprocess.Popen(
        [
            *(sys.executable, "-m", "simulator_stub", *world, "--port", "0", "--bind", "127.0.0.1"),
            *("--autostart", "1", "--lockstep", "--answer-limit", "inf", "--truth", str(truth)),
        ],
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )
    try:
        assert running.stdout is not None
        ports = (re.search(r":(\d+)$", line) for line in running.stdout)
        yield int(next(port for port in ports if port)[1]), truth
    finally:
        running.send_signal(signal.SIGTERM)
        running.wait()
        running.stdout.close()


def test_a_client_localizes_its_robot_live(simulator, tmp_path):
    port, truth = simulator
    said = program(LIVE)["drive"](port, str(tmp_path / "small_lab.xml"), 150, wait=True)
    x, y, degrees, certain = said.split()
    rows = [line.split(",") for line in truth.read_text().splitlines()]
    names = rows[0]
    at_end = next(row for row in rows if row[names.index("time")] == "150")
    true_x, true_y, direction = (float(at_end[names.index(name)]) for name in ("x", "y", "dir_deg"))
    assert certain == "True"
    assert math.hypot(float(x) - true_x, float(y) - true_y) < 0.3
    assert abs(math.remainder(float(degrees) - direction, 360.0)) < 6.0


@pytest.mark.slow
def test_a_log_is_localized_as_it_was_live(simulator, tmp_path):
    port, _ = simulator
    lab = str(tmp_path / "small_lab.xml")
    parameters = ["-m", lab, "--drive", "active", "--exit-when-finished", "--lockstep"]
    done = subprocess.run(
        [sys.executable, "-P", "-m", "agent", "-h", f"127.0.0.1:{port}", *parameters],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    logged = [
        "{} {:.4f} {:.4f} {:.3f} {:.4f}".format(cycle.time, *cycle.estimate)
        for cycle in read_run(tmp_path / "run.jsonl").cycles
    ]
    assert program(RECORDED)["replay"](tmp_path / "run.jsonl", lab) == logged
    assert len(logged) > 5
