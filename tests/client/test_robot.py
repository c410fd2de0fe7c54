"""`Robot` and `AsyncRobot` against the simulator: over UDP, TCP, asyncio, and in the same process."""

import asyncio
import csv
import math
import socket
import threading

import pytest

from ciberrato import Robot, find_grid, find_lab, read_grid, read_lab, read_parameters
from ciberrato.client import AsyncRobot, RunEnd
from ciberrato.client.errors import RefusedError, SilenceError
from ciberrato.errors import UsageError
from ciberrato.files.run_log import read_run
from ciberrato.protocol import Acceptance, Measures, encode
from ciberrato.world.parameters import Parameters
from simulator_stub.simulation import Simulation
from tests.client.conftest import PATIENCE, simulator, until_silent

ANGLES = (0, 60, -60, 180)
PATIENT = {"timeout": PATIENCE, "give_up_after": PATIENCE}


def wander(robot, measures):
    robot.drive(0.1, 0.1 if measures.infrared[0] < 2 else -0.1)


def world(truth, parameters):
    return (
        *("--lab", "maze", "--grid", "maze", "--param", parameters, "--seed", "5"),
        *("--autostart", "1", "--lockstep", "--truth", str(truth)),
    )


def in_process(parameters):
    """Measures and poses of a run, without sockets: what the others are held against."""
    simulation = Simulation(
        read_lab(find_lab("maze")), read_grid(find_grid("maze")), read_parameters(parameters), seed=5
    )
    seen, poses = [], []
    with Robot("r2", angles=ANGLES, simulation=simulation) as robot:
        for measures in robot:
            wander(robot, measures)
            seen.append(measures)
            poses.append(simulation.poses()[0])
    assert robot.ended is RunEnd.TIME_UP
    return seen, poses


@pytest.mark.parametrize("transport", ["udp", "tcp"])
def test_a_run_over_the_network_is_the_run_in_process(tmp_path, short, transport):
    wanted, poses = in_process(short)
    seen = []
    with (
        simulator(*world(tmp_path / "truth.csv", short)) as host,
        Robot("r2", host, angles=ANGLES, transport=transport, log=tmp_path / "run.jsonl", **PATIENT) as robot,
    ):
        for measures in robot:
            wander(robot, measures)
            seen.append(measures)
    assert seen == wanted
    assert [measures.time for measures in seen] == list(range(60))
    assert (robot.ended, robot.lost, robot.skipped, robot.stale) == (RunEnd.TIME_UP, 0, 0, 0)
    with (tmp_path / "truth.csv").open() as file:
        truth = {int(row["time"]): (float(row["x"]), float(row["y"])) for row in csv.DictReader(file)}
    for measures, pose in zip(seen, poses, strict=True):
        assert truth[measures.time] == pytest.approx(pose[:2], abs=1e-4)
    cycles = read_run(tmp_path / "run.jsonl").cycles
    assert [cycle.time for cycle in cycles if cycle.phase == "running"] == list(range(60))
    assert {cycle.command for cycle in cycles} == {(0.0, 0.0), (0.1, 0.1), (0.1, -0.1)}


def test_the_same_with_async_for(tmp_path, short):
    wanted, _ = in_process(short)

    async def run(host):
        seen = []
        async with AsyncRobot("r2", host, angles=ANGLES, **PATIENT) as robot:
            async for measures in robot:
                wander(robot, measures)
                seen.append(measures)
        return seen, robot

    with simulator(*world(tmp_path / "truth.csv", short)) as host:
        seen, robot = asyncio.run(run(host))
    assert seen == wanted
    assert robot.ended is RunEnd.TIME_UP


def test_finishing_ends_the_loop(short):
    simulation = Simulation(read_lab(find_lab("maze")), read_grid(find_grid("maze")), seed=1)
    with Robot(simulation=simulation) as robot:
        for measures in robot:
            robot.drive(0.1, 0.1)
            if measures.time == 7:
                robot.finish()
    assert robot.ended is RunEnd.FINISHED
    assert robot.measures.time == 8
    assert repr(robot) == "<Robot 'robot' finished at time 8>"


def test_leaving_the_block_stops_the_robot(short):
    simulation = Simulation(read_lab(find_lab("maze")), read_grid(find_grid("maze")), seed=1)
    with Robot(simulation=simulation) as robot:
        for measures in robot:
            robot.drive(0.1, 0.1)
            if measures.time == 7:
                break
    assert robot.ended is RunEnd.STOPPED_BY_PROGRAM
    (record,) = simulation.robots
    assert (record.left_command, record.right_command) == (0.0, 0.0)
    assert list(robot) == []


def test_a_refused_robot_is_told_why():
    simulation = Simulation(read_lab(find_lab("maze")), read_grid(find_grid("maze")))
    with pytest.raises(RefusedError, match="position 99"):
        Robot("r2", position=99, simulation=simulation)
    with (
        simulator("--lab", "maze", "--grid", "maze") as host,
        pytest.raises(RefusedError, match="position 99"),
    ):
        Robot("r2", host, position=99, **PATIENT)


@pytest.mark.parametrize("transport", ["udp", "tcp"])
def test_nobody_there(transport):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # a port that nobody listens on
        host = f"127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(SilenceError, match=r"in 0\.3 s: start one"):
            Robot("r2", host, transport=transport, give_up_after=0.3)

        async def run():
            async with AsyncRobot("r2", host, transport=transport, give_up_after=0.3):
                raise AssertionError

        with pytest.raises(SilenceError, match=r"in 0\.3 s: start one"):
            asyncio.run(run())


class Scripted(threading.Thread):
    """A simulator over UDP that accepts, sends what it is told after each message, and falls silent."""

    def __init__(self, *batches):
        super().__init__(daemon=True)
        self._batches = batches
        self._main, self._robot = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        for one in (self._main, self._robot):
            one.bind(("127.0.0.1", 0))
            one.settimeout(PATIENCE)
        self.host = f"127.0.0.1:{self._main.getsockname()[1]}"
        self.heard = []

    def run(self):
        _, peer = self._main.recvfrom(2048)
        self._robot.sendto(encode(Acceptance(parameters=Parameters(cycle_time=10))), peer)
        for batch in self._batches:
            for data in batch:
                self._robot.sendto(data, peer)
            self.heard.append(self._robot.recvfrom(2048)[0])

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        self.join(PATIENCE)
        self._main.close()
        self._robot.close()


def test_silence_is_told_and_strange_bytes_are_left_out():
    first = [b"<Measures", encode(Measures(time=1, start=True))]
    with Scripted(first, [encode(Measures(time=4, start=True))]) as peer:
        robot = Robot("r2", peer.host, **PATIENT)
        times = []
        with pytest.raises(SilenceError, match=r"for 0\.2 s, after time 4"), robot:
            times += (measures.time for measures in until_silent(robot, 4))
    assert (times, robot.lost) == ([1, 4], 2)
    assert len(peer.heard) == 2


def test_arguments_are_checked_before_anything_is_opened(tmp_path):
    for wrong in (
        {"host": "a:b:c"},
        {"host": "localhost:99999"},
        {"transport": "smoke"},
        {"localize": "atlantis"},
        {"localize": 7},
        {"name": None},
        {"host": None},
        {"timeout": 0},
        {"timeout": math.nan},
        {"timeout": "2"},
        {"give_up_after": math.nan},
        {"give_up_after": None},
        {"log": 7},
        {"log": ""},
        {"log": tmp_path},
    ):
        with pytest.raises(UsageError):
            Robot(**{"name": "r2", **wrong})
    simulation = Simulation(read_lab(find_lab("maze")), read_grid(find_grid("maze")))
    with pytest.raises(UsageError, match="cannot be written"):
        Robot("r2", simulation=simulation, log=tmp_path / "none" / "run.jsonl")
    assert len(simulation.poses()) == 0  # no robot has taken a place


@pytest.mark.slow
def test_localizing_while_driving(tmp_path):
    lab = read_lab(find_lab("maze"))
    simulation = Simulation(lab, read_grid(find_grid("maze")), seed=3)
    claims = []
    with Robot("r2", simulation=simulation, localize="maze", log=tmp_path / "run.jsonl") as robot:
        for measures in robot:
            front, left, right, _ = measures.infrared
            turn = 0.1 if left < right else -0.1
            robot.drive(*((0.1, 0.1) if front < 1.2 else (-turn, turn)))
            if robot.pose is not None and robot.pose.certain:
                x, y, heading = simulation.poses()[0]
                near = math.hypot(robot.pose.x - x, robot.pose.y - y) < 0.5
                claims.append(near and abs(math.remainder(robot.pose.heading - heading, math.tau)) < 0.18)
            if len(claims) == 50 or measures.time == 800:
                break
    assert len(claims) == 50
    assert sum(claims) >= 49
    estimates = [cycle.estimate for cycle in read_run(tmp_path / "run.jsonl").cycles if cycle.estimate]
    assert estimates[-1][3] > 0.95
