"""Lockstep with clients in processes of their own that send several commands in a cycle, or none."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from simulator_stub.assembly import build_server
from simulator_stub.options import parse_arguments
from simulator_stub.service.client_process import Activity, watch_client
from simulator_stub.service.pace import Lockstep

CLIENT = Path(__file__).with_name("talking_client.py")
CYCLES = 150
PATIENCE = 300.0  # seconds; only a failure takes so long
LINUX = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="what /proc tells")


class Outcome:
    """What a run with the client left: the log, the result, and what was said."""

    def __init__(self, folder: Path, kind: str, *, silent: float = 0.0, doze: float = 0.0) -> None:
        folder.mkdir()
        (folder / "p.xml").write_text(f'<Parameters SimTime="{CYCLES}" CycleTime="50"/>', encoding="utf-8")
        options = ["--param", "p.xml", "--lab", "open", "--grid", "5,7,0", "--seed", "1", "--port", "0"]
        options += ["--bind", "127.0.0.1", "--autostart", "1", "--lockstep", "--exit-at-end"]
        options += ["--log", "log.xml", "--result", "result.json"]
        before = Path.cwd()
        os.chdir(folder)
        try:
            self.run(options, kind, "3", str(silent), str(doze))
        finally:
            os.chdir(before)
        self.log = (folder / "log.xml").read_text(encoding="utf-8")
        [self.result] = json.loads((folder / "result.json").read_text(encoding="utf-8"))["runs"][0]["robots"]

    def run(self, options: list[str], kind: str, *arguments: str) -> None:
        self.notices: list[str] = []
        server = build_server(parse_arguments(options), print_line=lambda _: None, notify=self.notices.append)
        assert isinstance(server.pace, Lockstep)
        server.pace.limit = PATIENCE  # of a client at work: it may have to wait for a processor
        command = [sys.executable, str(CLIENT), kind, str(server.port), str(CYCLES), *arguments]
        with subprocess.Popen(command) as client:
            try:
                server.run()
                self.processes = [client.answers.process for client in server.session.robots.values()]
            finally:
                server.close()
                client.kill()

    def commands(self) -> Iterator[tuple[int, int, int]]:
        """Yield time, time of the Measures answered, and commands left, where a cycle has a command."""
        for block in self.log.split("<LogInfo ")[1:]:
            time = re.match(r'Time="(\d+)"', block)
            motors = re.search(r'LeftMotor="([-\d.e]+)" RightMotor="([-\d.e]+)"', block)
            assert time
            if motors:
                yield int(time[1]), round(float(motors[1]) * 100_000), round(float(motors[2]) * 1000)

    def lags(self) -> set[int]:
        return {time - answered for time, answered, _ in self.commands() if time >= 3}


@LINUX
@pytest.mark.parametrize("kind", ["udp", "tcp"])
def test_the_last_of_several_commands_counts_in_its_own_cycle(kind: str, tmp_path: Path) -> None:
    run = Outcome(tmp_path / "run", kind, silent=0.1)
    assert run.lags() == {0}
    assert {left for _, _, left in run.commands()} == {1}
    assert run.result["lockstep"]["superseded"] > 10
    assert run.result["lockstep"]["unanswered"] > 5
    assert run.result["lockstep"]["late"] == 0
    assert len([line for line in run.notices if "the last one counts" in line]) == 1
    assert len([line for line in run.notices if "unanswered" in line]) == 1
    again = Outcome(tmp_path / "again", kind, silent=0.1)
    assert (list(again.commands()), again.result) == (list(run.commands()), run.result)


@LINUX
@pytest.mark.parametrize("kind", ["udp", "tcp"])
def test_a_client_that_sleeps_between_its_commands_is_waited_for(kind: str, tmp_path: Path) -> None:
    run = Outcome(tmp_path / "run", kind, doze=0.002)
    assert run.lags() == {0}
    assert run.result["lockstep"]["unanswered"] == 0


@pytest.mark.parametrize("kind", ["udp", "tcp"])
def test_without_a_look_at_the_process_commands_do_not_stay_behind(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("simulator_stub.service.pace.watch_client", lambda *ends: None)
    run = Outcome(tmp_path / "run", kind)
    # Where only time tells, how fast this machine is decides about single cycles.
    lags = [time - answered for time, answered, _ in run.commands() if time >= 3]
    assert sum(lag == 0 for lag in lags) > 0.9 * len(lags)
    assert lags[-1] == 0
    assert run.result["lockstep"]["superseded"] + run.result["lockstep"]["late"] > 10


SLEEPER = """
import socket, sys, time
own = socket.socket({family}, socket.{kind})
own.bind(("127.0.0.1" if own.family == socket.AF_INET else "::ffff:127.0.0.1", 0))
print(own.getsockname()[1], flush=True)
while True:
    what = own.recv(100)
    if what == b"work":
        while True:
            pass
    if what == b"doze":
        time.sleep(1000.0)
"""


def until(condition: Any) -> None:
    """Look until it holds."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, "it never came to hold"


@LINUX
@pytest.mark.parametrize("family", ["socket.AF_INET", "socket.AF_INET6"])
@pytest.mark.parametrize(("message", "activity"), [("work", Activity.WORKS), ("doze", Activity.DOZES)])
def test_what_a_client_does_is_seen_from_outside(family: str, message: str, activity: Activity) -> None:
    code = SLEEPER.format(family=family, kind="SOCK_DGRAM")
    with (
        subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as client,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own,
    ):
        assert client.stdout is not None
        own.bind(("127.0.0.1", 0))
        address = ("127.0.0.1", int(client.stdout.readline()))
        process = watch_client("udp", address, own.getsockname())
        assert process is not None
        assert process.truthful
        until(lambda: process.activity() is Activity.RESTS)
        assert process.has_read_all()
        own.sendto(message.encode(), address)
        until(lambda: process.activity() is activity)
        until(process.has_read_all)
        own.sendto(b"unread", address)
        assert not process.has_read_all()
        client.kill()
        client.wait()
        until(lambda: process.activity() is Activity.WORKS and process.gone)


@LINUX
def test_of_several_threads_the_one_that_messages_wake_is_watched() -> None:
    code = "import threading\nspin = lambda: [None for _ in iter(int, 1)]\n"
    code += "threading.Thread(target=spin, daemon=True).start()\n"
    code += SLEEPER.format(family="socket.AF_INET", kind="SOCK_DGRAM")
    with (
        subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as client,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own,
    ):
        assert client.stdout is not None
        own.bind(("127.0.0.1", 0))
        address = ("127.0.0.1", int(client.stdout.readline()))
        process = watch_client("udp", address, own.getsockname())
        assert process is not None
        assert not process.truthful

        def lesson() -> bool:
            until(process.has_read_all)
            process.before_message()
            own.sendto(b"again", address)
            process.after_message()
            return process.truthful

        until(lesson)
        until(lambda: process.activity() is Activity.RESTS)
        assert process.activity(all_threads=True) is Activity.WORKS
        client.kill()


def test_this_process_and_what_cannot_be_found_are_not_watched() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.bind(("127.0.0.1", 0))
        assert watch_client("udp", own.getsockname(), ("127.0.0.1", 1)) is None
        port = own.getsockname()[1]
    assert watch_client("udp", ("127.0.0.1", port), ("127.0.0.1", 1)) is None
