"""`ciberrato-simulator --view`: a viewer that begins and ends with the simulator."""

import re
import signal
import socket
import subprocess
import sys
import time

import pytest

from .conftest import SECONDS


def refused(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) != 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_the_viewer_watches_this_simulator_and_ends_with_it(number):
    command = [sys.executable, "-m", "simulator_stub", "--port", "0", "--view", "0", "--quiet"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as simulator:
        lines = iter(simulator.stdout.readline, "")
        page = int(
            next(filter(None, (re.match(r"page: http://127.0.0.1:(\d+)/", line) for line in lines)))[1]
        )
        assert not refused(page)
        simulator.send_signal(number)
        assert simulator.wait(SECONDS) == (-number if number == signal.SIGKILL else 0)
    deadline = time.monotonic() + SECONDS
    while not refused(page):
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_a_simulator_goes_on_without_the_viewer_if_its_port_is_taken():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        view = str(taken.getsockname()[1])
        command = [sys.executable, "-m", "simulator_stub", "--port", "0", "--view", view, "--quiet"]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as simulator:
            assert "cannot open the page's port" in simulator.stderr.readline()
            assert simulator.poll() is None
            simulator.terminate()
            assert simulator.wait(SECONDS) == 0
