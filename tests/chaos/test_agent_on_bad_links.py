"""The agent and the client on a network that lies, over real sockets: no forged refusal, no blind robot."""

import json
import math
import re
import signal
import socket
import subprocess
import sys
import threading
import time

import pytest

from ciberrato import Robot, croblink
from ciberrato.client import channel, controls
from ciberrato.client.errors import RefusedError, SilenceError
from ciberrato.files.beliefs import read_beliefs
from ciberrato.files.run_log import read_run
from ciberrato.net import UdpLink
from ciberrato.protocol import Acceptance, Measures, Refusal, decode_actions, encode
from ciberrato.world.parameters import Parameters
from tests.ports import lasting_port

PARAMETERS = Parameters(cycle_time=20)
LONG = 300.0  # seconds; only a failure takes so long


class Simulator:
    """Accepts one robot, after what is sent to it first, and falls silent after some Measures.

    To the client it keeps real time, however busy this machine is: `monotonic` is the client's clock.
    """

    def __init__(self, forged=(), cycles=12):
        self.main, self.own = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        self.others = {}
        for sock in (self.main, self.own):
            sock.bind(("127.0.0.1", 0))
            sock.settimeout(LONG)
        self.host = f"127.0.0.1:{self.main.getsockname()[1]}"
        self.commands = []
        self.stopped = threading.Event()
        self._time, self._silent_since = 0, math.inf
        self._forged, self._cycles = forged, cycles
        self._thread = threading.Thread(target=self._serve)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._thread.join()
        for sock in (self.main, self.own, *self.others.values()):
            sock.close()

    def monotonic(self):
        """Return the cycles' seconds, then those of the silence; at last, when all is said, a long time."""
        silence = max(0.0, time.monotonic() - self._silent_since)
        return PARAMETERS.cycle_time / 1000.0 * self._time + silence + 2.0 * LONG * self.stopped.is_set()

    def _serve(self):
        _, client = self.main.recvfrom(4096)
        for address in self._forged:
            other = self.others[address] = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            other.bind((address, 0))
            other.sendto(encode(Refusal()), client)
        self.own.sendto(encode(Acceptance(parameters=PARAMETERS)), client)
        for cycle in range(self._cycles):
            self._time = cycle
            self.own.sendto(encode(Measures(time=cycle, start=True, collision=False)), client)
            self._answer()
        self._silent_since = time.monotonic()
        while self._cycles and self._answer() != (0.0, 0.0):  # nothing is sent any more
            pass
        repeated = self._cycles and self._answer()
        if repeated == (0.0, 0.0):
            self.stopped.set()

    def _answer(self):
        actions = decode_actions(self.own.recvfrom(4096)[0])
        self.commands.append((actions.left_motor, actions.right_motor))
        return self.commands[-1]


@pytest.mark.parametrize("forged", [("127.0.0.1",), ("127.0.0.2",), ("127.0.0.1", "127.0.0.2")])
def test_a_forged_refusal_before_the_acceptance(forged, monkeypatch):
    for name in ("_SECONDS", "_REFUSAL_PATIENCE"):
        monkeypatch.setattr(croblink, name, LONG)
    monkeypatch.setattr(channel, "REFUSAL_PATIENCE", LONG)
    with Simulator(forged, cycles=0) as simulator, Robot("r", simulator.host, give_up_after=LONG) as robot:
        assert robot.parameters.cycle_time == PARAMETERS.cycle_time
    with Simulator(forged, cycles=0) as simulator:
        link = croblink.CRobLink("r", 1, simulator.host)
        assert link.status == 0
        link.sock.close()


def test_a_refusal_that_stays_the_only_answer():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as main:
        main.bind(("127.0.0.1", 0))
        host = f"127.0.0.1:{main.getsockname()[1]}"

        def refuse():
            for _ in range(2):
                _, client = main.recvfrom(4096)
                main.sendto(encode(Refusal()), client)

        thread = threading.Thread(target=refuse)
        thread.start()
        with pytest.raises(RefusedError, match="any free position"):
            Robot("r", host)
        link = croblink.CRobLink("r", 1, host)
        assert link.status == -1
        link.sock.close()
        thread.join()


def test_another_address_cannot_answer():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as main, UdpLink("127.0.0.1", 9) as nobody:
        main.bind(("127.0.0.1", 0))
        main.settimeout(LONG)
        with UdpLink(*main.getsockname()) as link:
            link.register(b"<Robot/>")
            _, client = main.recvfrom(4096)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
                other.bind(("127.0.0.2", 0))
                other.sendto(encode(Acceptance(parameters=PARAMETERS)), client)
                assert link.receive(0.2) is None
            assert link.peer is None
        assert nobody.peer is None


def test_a_client_that_hears_nothing_stops_its_robot_and_says_so_again(monkeypatch):
    with Simulator() as simulator:
        monkeypatch.setattr(controls, "time", simulator)
        with Robot("r", simulator.host, timeout=LONG) as robot:
            for _ in range(12):
                next(robot)
                robot.drive(0.1, 0.1)
            with pytest.raises(SilenceError, match="no Measures"):
                next(robot)
            assert simulator.stopped.is_set()
            assert robot.stops == 1
    assert simulator.commands[10] == (0.1, 0.1)


@pytest.mark.slow
def test_the_agent_registers_again_when_the_simulator_is_started_anew(tmp_path):
    port = lasting_port()
    words = [sys.executable, "-m", "agent", "-h", f"127.0.0.1:{port}", "-m", "corridors", "--reconnect"]
    with subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as agent:
        for log in ("run.jsonl", "run.2.jsonl"):
            simulator = _start_simulator(port, tmp_path)
            for line in agent.stderr:
                if "step 1," in line:
                    break
            simulator.kill()
            simulator.communicate()
            assert any("registering again" in line for line in agent.stderr)
            assert read_run(tmp_path / log).steps
        agent.send_signal(signal.SIGINT)
        agent.stderr.read()
        assert agent.wait() in (0, 3)  # on a busy machine the robot may go on blindly
    for name in ("localization.out", "localization.2.out"):
        assert len(read_beliefs(tmp_path / name)[-1].beliefs) >= 3
    assert not (tmp_path / "localization.3.out").exists()


def _start_simulator(port, folder, *more):
    words = ["--lab", "corridors", "--grid", "corridors", "--bind", "127.0.0.1", "--autostart", "1", *more]
    process = subprocess.Popen(
        [sys.executable, "-m", "simulator_stub", "--port", str(port), *words],
        cwd=folder,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert any("listening on tcp" in line for line in process.stdout)
    return process


@pytest.mark.slow
@pytest.mark.parametrize("number", range(3))
def test_a_seed_in_lockstep_gives_one_log_byte_for_byte(tmp_path, number):
    logs = []
    for name in ("first", "second"):
        folder = tmp_path / name
        folder.mkdir()
        words = ["--lab", "maze", "--grid", "maze", "--seed", "3", "--port", "0", "--bind", "127.0.0.1"]
        words += ["--autostart", "1", "--lockstep", "--answer-limit", "300"]
        with subprocess.Popen(
            [sys.executable, "-m", "simulator_stub", *words], stdout=subprocess.PIPE, text=True, cwd=folder
        ) as simulator:
            port = next(found[1] for line in simulator.stdout if (found := re.search(r"udp .*:(\d+)", line)))
            words = ["-h", f"127.0.0.1:{port}", "-m", "maze", "--lockstep", "--exit-at-wall", "--quiet"]
            done = subprocess.run([sys.executable, "-m", "agent", *words], cwd=folder, timeout=300)
            simulator.send_signal(signal.SIGINT)
            assert done.returncode in (0, 3)
        logs.append((folder / "run.jsonl").read_bytes())
    assert logs[0] == logs[1]
    assert all(json.loads(line)["answered"] for line in logs[0].splitlines()[1:-1])
