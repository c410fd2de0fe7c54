"""A simulator in a process of its own, and peers that play one."""

import contextlib
import re
import subprocess
import sys
import threading

import pytest

from ciberrato import croblink

PATIENCE = 300.0  # seconds; only a failure takes so long


@contextlib.contextmanager
def simulator(*options):
    """Start one on a free port of this machine; yields its address.

    In lockstep without a limit: a robot that this machine leaves without a processor is waited for.
    """
    words = [
        sys.executable,
        "-m",
        "simulator_stub",
        "--bind",
        "127.0.0.1",
        "--port",
        "0",
        "--quiet",
        *options,
        *(("--answer-limit", "inf") if "--lockstep" in options else ()),
    ]
    running = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    watchdog = threading.Timer(PATIENCE, running.kill)
    watchdog.start()
    try:
        lines = iter(running.stdout)
        port = next(found[1] for line in lines if (found := re.search(r"udp \S+:(\d+)", line)))
        yield f"127.0.0.1:{port}"
    finally:
        watchdog.cancel()
        running.terminate()
        running.communicate()


def until_silent(robot, last):
    """Yield a robot's Measures, and let it wait not much longer once those of time `last` have come.

    Not before: its peer may be left without a processor.
    """
    for measures in robot:
        if measures.time == last:
            robot._timeout = 0.2
        yield measures


@pytest.fixture
def patient(monkeypatch):
    """Let the drop-in wait for a busy machine; agents of the course wait 2 s."""
    monkeypatch.setattr(croblink, "_SECONDS", PATIENCE)


@pytest.fixture
def short(tmp_path):
    """Parameters of a run of 60 cycles."""
    path = tmp_path / "short.xml"
    path.write_text('<Parameters SimTime="60" ObstacleNoise="0.1" MotorsNoise="1.5"/>')
    return str(path)
