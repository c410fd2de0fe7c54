"""A small world to drive in without a network, and what the golden recordings hold."""

from __future__ import annotations

import base64
import contextlib
import json
import math
import socket
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agent.drives.right.controller import Controller
from ciberrato.files.lab import read_lab
from ciberrato.files.run_records import Cycle, RunHeader
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import ideal_reading, round_reading, sensor_distances
from ciberrato.labs import find_lab
from ciberrato.physics.kinematics import advance, clamp_power, filter_power
from ciberrato.protocol import Acceptance, Actions, Measures, decode_actions, decode_simulator_message, encode
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from tests.recordings import OWN

ANGLES = (0.0, 90.0, -90.0, 180.0)


class World:
    """Many robots, each alone in a copy of one lab: motion, collisions, IR and compass, as arrays.

    Written for these tests from the description of the real simulator; it shares geometry and kinematics with
    the library, and nothing with the simulator that ships.
    """

    def __init__(
        self,
        lab: Lab,
        starts: Sequence[tuple[float, float, float]],
        parameters: Parameters,
        seed: int,
        angles: tuple[float, float, float, float] = ANGLES,
    ) -> None:
        self.parameters = parameters
        self.walls = WallMap.from_lab(lab)
        self.x, self.y, degrees = np.array(starts, float).T.copy()
        self.heading = np.radians(degrees)
        self.count = len(starts)
        self.left, self.right = np.zeros(self.count), np.zeros(self.count)
        self.colliding = np.zeros(self.count, bool)
        self.collisions = np.zeros(self.count, int)
        self.time = 0
        self._angles = np.radians(angles)
        self._random = np.random.default_rng(seed)
        self._infrared: deque[np.ndarray] = deque(maxlen=parameters.obstacle_latency + 1)
        self._compass: deque[np.ndarray] = deque(maxlen=parameters.compass_latency + 1)
        self._infrared.extend([np.zeros((self.count, 4))] * (parameters.obstacle_latency + 1))
        self._compass.extend([np.zeros(self.count)] * (parameters.compass_latency + 1))

    def step(self, commands: Sequence[tuple[float, float]]) -> None:
        """Simulate a cycle."""
        power = clamp_power(np.array(commands, float))
        deviation = self.parameters.motors_noise / 100.0
        self.right = filter_power(power[:, 1], self.right, 1 + deviation * self._normal(self.count))
        self.left = filter_power(power[:, 0], self.left, 1 + deviation * self._normal(self.count))
        x, y, self.heading = advance(self.x, self.y, self.heading, self.left, self.right)
        self.colliding = self.walls.distance(x, y) < 0.5
        self.collisions += self.colliding
        self.x = np.where(self.colliding, self.x, x)
        self.y = np.where(self.colliding, self.y, y)
        self.time += 1

    def measures(
        self, *, start: bool = True, stop: bool = False, requests: Sequence[tuple[str, ...]] | None = None
    ) -> list[Measures]:
        """Draw what each robot's sensors say."""
        directions = self.heading[:, None] + self._angles
        ideal = ideal_reading(sensor_distances(self.walls, self.x[:, None], self.y[:, None], directions))
        noise = self.parameters.obstacle_noise * self._normal((self.count, 4))
        self._infrared.append(round_reading(ideal + noise))
        degrees = np.degrees(self.heading) + self.parameters.compass_noise * self._normal(self.count)
        self._compass.append(np.floor((degrees + 180.0) % 360.0 - 180.0 + 0.5))
        messages = []
        for robot in range(self.count):
            infrared = [float(value) for value in self._infrared[0][robot]]
            message = Measures(
                time=self.time,
                start=start,
                stop=stop,
                collision=bool(self.colliding[robot]),
                compass=float(self._compass[0][robot]) if self.parameters.compass_sensor else None,
                ground=-1,
                infrared=(infrared[0], infrared[1], infrared[2], infrared[3]),
            )
            asked = () if requests is None else requests[robot][: self.parameters.requests_per_cycle]
            messages.append(self._hide(message, asked))
        return messages

    def _hide(self, message: Measures, asked: tuple[str, ...]) -> Measures:
        if self.parameters.compass_requestable and "Compass" not in asked:
            message = replace(message, compass=None)
        if self.parameters.collision_requestable and "Collision" not in asked:
            message = replace(message, collision=None)
        if self.parameters.obstacle_requestable:
            first, second, third, fourth = (
                value if f"IRSensor{sensor}" in asked else None
                for sensor, value in enumerate(message.infrared)
            )
            message = replace(message, infrared=(first, second, third, fourth))
        return message

    def _normal(self, shape: int | tuple[int, int]) -> np.ndarray:
        return self._random.standard_normal(shape)


@dataclass
class Drive:
    """What one robot did: its log, and where it truly was at each step."""

    cycles: list[Cycle]
    truth: list[tuple[float, float, float]]
    """Displacement along and across since the start, and heading, at each step."""
    collisions: int
    controller: Controller

    @property
    def times(self) -> list[int]:
        return [cycle.time for cycle in self.cycles if cycle.step is not None]

    @property
    def steps(self) -> int:
        return len(self.truth)


def header_for(parameters: Parameters, angles: tuple[float, float, float, float], cruise: float) -> RunHeader:
    return RunHeader(lab_name="", lab_sha256="", parameters=parameters, sensor_angles=angles, cruise=cruise)


def drive(
    lab: Lab,
    starts: Sequence[tuple[float, float, float]],
    parameters: Parameters,
    *,
    seed: int = 0,
    cruise: float = 0.1,
    angles: tuple[float, float, float, float] = ANGLES,
    cycles: int = 1500,
    stopped: int = 2,
    change: Callable[[Measures], Measures] = lambda message: message,
    pauses: Sequence[int] = (),
) -> list[Drive]:
    """Let robots drive until each stands before a wall; `stopped` messages come before Start."""
    world = World(lab, starts, parameters, seed, angles)
    begin = world.x.copy(), world.y.copy()
    header = header_for(parameters, angles, cruise)
    drives = [Drive([], [], 0, Controller(header, exit_at_wall=True)) for _ in starts]
    actions = [Actions(left_motor=0.0, right_motor=0.0) for _ in starts]
    for number in range(cycles + stopped):
        running = number >= stopped and number not in pauses
        messages = world.measures(start=running, stop=not running, requests=[a.requests for a in actions])
        for robot, (message, drive) in enumerate(zip(messages, drives, strict=True)):
            if drive.controller.ended is not None:
                continue
            cycle, answer = drive.controller.observe(change(message))
            drive.cycles.append(cycle)
            if cycle.step is not None:
                place = world.x[robot] - begin[0][robot], world.y[robot] - begin[1][robot]
                drive.truth.append((*place, world.heading[robot]))
            actions[robot] = Actions(left_motor=0.0, right_motor=0.0) if answer is None else answer
            drive.collisions = int(world.collisions[robot])
        if all(drive.controller.ended is not None for drive in drives):
            break
        if running:
            world.step([(action.left_motor or 0.0, action.right_motor or 0.0) for action in actions])
    return drives


def cells_to_the_right(lab: Lab, start: tuple[float, float, float]) -> int:
    """Number of cells that a robot enters, by the walls of the lab file and nothing else."""
    column, row = int(start[0] // 2), int(start[1] // 2)
    entered = 0
    while column + entered < lab.columns - 1:
        edge, middle = 2.0 * (column + entered + 1), 2.0 * row + 1.0
        boxes = (
            (min(x for x, _ in w.corners), max(x for x, _ in w.corners), [y for _, y in w.corners])
            for w in lab.walls
            if w.height > 0.0
        )
        if any(low < edge < high and min(ys) < middle < max(ys) for low, high, ys in boxes):
            break
        entered += 1
    return entered


@pytest.fixture(scope="session")
def standard() -> Lab:
    return read_lab(find_lab("standard"))


@pytest.fixture(scope="session")
def corridors() -> Lab:
    return read_lab(find_lab("corridors"))


@dataclass(frozen=True)
class Recording:
    """A recorded run of the published method's own agent."""

    parameters: Parameters
    exchange: tuple[Measures | Actions, ...]
    """In the order of the wire."""

    def stream(self) -> Iterator[tuple[Measures, tuple[float, float] | None]]:
        """Each Measures with the command in effect when it was taken."""
        command: tuple[float, float] | None = None
        for message in self.exchange:
            if isinstance(message, Measures):
                yield message, command
            else:
                command = (message.left_motor or 0.0, message.right_motor or 0.0)


@pytest.fixture(scope="session")
def recording() -> Callable[[str], Recording]:
    def read(name: str) -> Recording:
        return _read_recording(OWN / "seed_runs" / name / "datagrams.jsonl")

    return read


def _read_recording(path: Path) -> Recording:
    parameters = Parameters()
    exchange: list[Measures | Actions] = []
    for line in path.read_text().splitlines()[1:]:  # the first is the registration
        event = json.loads(line)
        data = base64.b64decode(event["bytes"])
        if event["from"] == "agent":
            exchange.append(decode_actions(data))
            continue
        message = decode_simulator_message(data)
        if isinstance(message, Measures):
            exchange.append(message)
        else:
            parameters = message.parameters
    return Recording(parameters, tuple(exchange))


def wrapped_degrees(radians: float) -> float:
    return math.degrees(math.remainder(radians, 2.0 * math.pi))


@pytest.fixture(scope="session", name="drive")
def _drive_fixture() -> Callable[..., list[Drive]]:
    return drive


@pytest.fixture(scope="session", name="cells_to_the_right")
def _cells_fixture() -> Callable[..., int]:
    return cells_to_the_right


@pytest.fixture(scope="session", name="header_for")
def _header_fixture() -> Callable[..., RunHeader]:
    return header_for


class FakeSimulator:
    """One robot behind UDP on this machine, a cycle per answer; it can wait at a given time.

    Parameters
    ----------
    parameters : Parameters
    start : (x, y, degrees)
        In the standard lab.
    hold_at : int or None
        At this time no further Measures are sent until `go_on`; None never holds.
    """

    def __init__(
        self,
        parameters: Parameters,
        start: tuple[float, float, float] = (5.0, 7.0, 0.0),
        *,
        seed: int = 1,
        hold_at: int | None = None,
    ) -> None:
        self.commands: list[tuple[float | None, float | None]] = []
        self.held = threading.Event()
        self._go_on = threading.Event()
        self._world = World(read_lab(find_lab("standard")), [start], parameters, seed)
        self._hold_at = hold_at
        self._closing = threading.Event()
        self._main, self._own = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        for endpoint in (self._main, self._own):
            endpoint.bind(("127.0.0.1", 0))
            endpoint.settimeout(0.05)
        self.port: int = self._main.getsockname()[1]
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def go_on(self) -> None:
        self._go_on.set()

    def close(self) -> None:
        self._closing.set()
        self._thread.join()
        self._main.close()
        self._own.close()

    def _receive(self, endpoint: socket.socket) -> tuple[bytes, tuple[str, int]] | None:
        while not self._closing.is_set():
            with contextlib.suppress(TimeoutError):
                return endpoint.recvfrom(2000)
        return None

    def _serve(self) -> None:
        received = self._receive(self._main)
        if received is None:
            return
        client = received[1]
        self._own.sendto(encode(Acceptance(parameters=self._world.parameters, n_beacons=1)), client)
        stopped = 2
        while True:
            (message,) = self._world.measures(start=stopped == 0, stop=stopped > 0)
            self._own.sendto(encode(message), client)
            answer = self._receive(self._own)
            if answer is None:
                return
            actions = decode_actions(answer[0])
            self.commands.append((actions.left_motor, actions.right_motor))
            if stopped > 0:
                stopped -= 1
                continue
            if self._hold_at == self._world.time:
                self.held.set()
                while not self._go_on.wait(0.02):
                    with contextlib.suppress(TimeoutError):
                        actions = decode_actions(self._own.recvfrom(2000)[0])
                        self.commands.append((actions.left_motor, actions.right_motor))
                    if self._closing.is_set():
                        return
            self._world.step([(actions.left_motor or 0.0, actions.right_motor or 0.0)])


@pytest.fixture
def fake_simulator() -> Iterator[Callable[..., FakeSimulator]]:
    made: list[FakeSimulator] = []

    def make(*arguments: Any, **options: Any) -> FakeSimulator:
        made.append(FakeSimulator(*arguments, **options))
        return made[-1]

    yield make
    for simulator in made:
        simulator.close()
