"""A simulator in a process of its own, and peers that play one."""

import contextlib
import re
import subprocess
import sys
import threading

import pytest


@contextlib.contextmanager
def simulator(*options):
    """Start one on a free port of this machine; yields its address."""
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
    ]
    running = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    watchdog = threading.Timer(120, running.kill)
    watchdog.start()
    try:
        lines = iter(running.stdout)
        port = next(found[1] for line in lines if (found := re.search(r"udp \S+:(\d+)", line)))
        yield f"127.0.0.1:{port}"
    finally:
        watchdog.cancel()
        running.terminate()
        running.communicate()


@pytest.fixture
def short(tmp_path):
    """Parameters of a run of 60 cycles."""
    path = tmp_path / "short.xml"
    path.write_text('<Parameters SimTime="60" ObstacleNoise="0.1" MotorsNoise="1.5"/>')
    return str(path)
