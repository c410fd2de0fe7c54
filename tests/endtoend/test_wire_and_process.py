"""The same drive three ways: two processes over UDP, over TCP, and one process without a wire."""

import contextlib
import re
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest

from agent.offline.expected_readings import compute_expected_readings
from agent.offline.localizer import localize
from benchmarks.accuracy import ANGLES, drive, random_start
from ciberrato.files.beliefs import read_beliefs
from ciberrato.files.lab import read_lab
from ciberrato.files.run_log import read_run
from ciberrato.labs import find_lab
from ciberrato.world.parameters import Parameters


@contextlib.contextmanager
def running(module, *words, folder):
    process = subprocess.Popen(
        [sys.executable, "-m", module, *words],
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    timer = threading.Timer(300, process.kill)
    timer.start()
    try:
        yield process
    finally:
        timer.cancel()
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        process.communicate()


def over_the_wire(transport, lab_name, start, seed, folder):
    """Readings of each step and the belief file of the real processes."""
    pose = f"{start.x:g},{start.y:g},{start.direction_deg:g}"
    simulator_words = ["--lab", lab_name, "--grid", pose, "--seed", str(seed), "--port", "0"]
    simulator_words += [
        "--bind",
        "127.0.0.1",
        "--autostart",
        "1",
        "--lockstep",
        "--answer-limit",
        "300",
        "--speed",
        "1000",
    ]
    with running("simulator_stub", *simulator_words, folder=folder) as simulator:
        port = next(
            found[1] for line in simulator.stdout if (found := re.search(rf"{transport} .*:(\d+)", line))
        )
        agent_words = ["-h", f"127.0.0.1:{port}", "-m", lab_name, "--transport", transport]
        agent_words += ["--lockstep", "--exit-at-wall"]
        with running("agent", *agent_words, folder=folder) as agent:
            output = agent.stdout.read()
            assert agent.wait() == 0, output
    run = read_run(folder / "run.jsonl")
    return [step.readings for step in run.steps], read_beliefs(folder / "localization.out")[-1].beliefs


@pytest.mark.slow
@pytest.mark.parametrize("transport", ["udp", "tcp"])
@pytest.mark.parametrize(("lab_name", "seed"), [("corridors", 11), ("maze", 12), ("standard", 13)])
def test_the_wire_changes_nothing(transport, lab_name, seed, tmp_path):
    lab = read_lab(find_lab(lab_name))
    start = random_start(lab, np.random.default_rng(seed))
    here = drive(lab, start, Parameters(), seed)
    readings, beliefs = over_the_wire(transport, lab_name, start, seed, tmp_path)
    assert readings == [crossing.readings for crossing in here.crossings]
    assert len(readings) == here.expected_steps
    expected = localize(readings, compute_expected_readings(lab, ANGLES, Parameters())).beliefs
    np.testing.assert_allclose(beliefs, expected, atol=0.00051)


@pytest.mark.slow
def test_a_run_that_is_watched_ends_as_any_other(tmp_path):
    words = ["--lab", "corridors", "--grid", "corridors", "--seed", "7", "--port", "0", "--autostart", "1"]
    words += ["--bind", "127.0.0.1", "--lockstep", "--answer-limit", "300", "--speed", "20"]
    with running("simulator_stub", *words, folder=tmp_path) as simulator:
        port = next(found[1] for line in simulator.stdout if (found := re.search(r"udp .*:(\d+)", line)))
        agent_words = ["-h", f"127.0.0.1:{port}", "-m", "corridors", "--watch", "--exit-at-wall"]
        with running("agent", *agent_words, folder=tmp_path) as agent:
            output = agent.stdout.read()
            assert agent.wait() == 0, output
    assert output.startswith("\x1b[2J")
    assert "interrupted" not in output
    screens, _, end = output.partition("localization.out: prior and 14 steps")
    assert "ciberrato in corridors_lab.xml: cycle" in screens
    assert "(27, 7)" in end
