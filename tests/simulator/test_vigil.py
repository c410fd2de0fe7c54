"""Waiting awake: only where it takes nothing from others, and for a bounded time."""

from __future__ import annotations

import pytest

from simulator_stub.service import vigil
from simulator_stub.service.clients import RobotClient
from simulator_stub.service.transports import Peer
from simulator_stub.service.vigil import LONGEST, PAUSE, WINDOW, Vigil

LOOK = 1e-5


class Deaf(Peer):
    def send(self, data: bytes) -> None:
        pass

    def close(self) -> None:
        self.closed = True


class Machine:
    """Two processors and a clock: looking takes time, and so may yielding."""

    def __init__(self, *, idle: float | None = 1.0, count: int = 2) -> None:
        self.now, self.idle_share, self.yielding, self.looks, self.going_on = 0.0, idle, 0.0, 0, True
        self.vigil = Vigil(
            clock=lambda: self.now,
            yield_processor=self.yield_processor,
            idle=lambda: None if self.idle_share is None else self.idle_share * self.now,
            count=count,
        )
        self.robots = [RobotClient(1, Deaf("one"))]
        self.robots[0].answers.take(LONGEST / 2, 0.0)
        self.answer_after: int | None = None

    def yield_processor(self) -> None:
        self.now += self.yielding

    def poll(self, seconds: float) -> bool:
        assert seconds == 0.0
        self.now += LOOK
        self.looks += 1
        if self.looks == self.answer_after:
            self.robots[0].answered = True
        return self.going_on

    def wait(self) -> int:
        """Wait once; returns how often was looked."""
        self.looks = 0
        self.robots[0].answered = False
        assert self.vigil.keep(self.poll, self.robots) is self.going_on
        return self.looks


@pytest.fixture
def machine() -> Machine:
    machine = Machine()
    machine.now = WINDOW
    return machine


def test_looks_until_the_answer_is_there_and_no_longer_than_it_may(machine: Machine) -> None:
    machine.answer_after = 7
    assert machine.wait() == 7
    machine.answer_after = None
    assert machine.wait() == pytest.approx(LONGEST / LOOK, abs=1.5)
    assert (machine.vigil.awake, machine.vigil.asleep) == (2, 0)


def test_never_before_it_is_known_how_idle_the_processors_were() -> None:
    machine = Machine()
    machine.now = 0.9 * WINDOW
    assert machine.wait() == 0
    machine.now = WINDOW
    assert machine.wait() > 0


@pytest.mark.parametrize("idle", [0.0, 0.1, None])
def test_never_where_the_processors_were_busy_or_nobody_knows(idle: float | None) -> None:
    machine = Machine(idle=idle)
    for _ in range(10):
        machine.now += WINDOW
        assert machine.wait() == 0
    assert machine.vigil.asleep == 10


@pytest.mark.parametrize(("count", "robots", "awake"), [(1, 1, False), (2, 2, False), (4, 3, True)])
def test_only_where_the_clients_leave_a_processor_over(count: int, robots: int, awake: bool) -> None:
    machine = Machine(count=count)
    for number in range(2, robots + 1):
        machine.robots.append(RobotClient(number, Deaf("another")))
        machine.robots[-1].answers.take(LONGEST / 2, 0.0)
    machine.now = WINDOW
    assert (machine.wait() > 0) is awake


def test_not_for_clients_that_take_longer_or_have_not_answered_yet(machine: Machine) -> None:
    machine.robots[0].answers.fastest = 1.01 * LONGEST
    assert machine.wait() == 0
    machine.robots = [RobotClient(1, Deaf("one"))]
    assert machine.wait() == 0


def test_a_processor_that_another_process_wanted_is_left_to_it_for_a_while(machine: Machine) -> None:
    machine.yielding = 1.5 * vigil.TAKEN
    assert machine.wait() == 1
    began, machine.yielding = machine.now, 0.0
    while machine.now < began + 0.95 * PAUSE:
        assert machine.wait() == 0
        machine.now += 0.1 * PAUSE
    machine.now = began + 1.1 * PAUSE
    assert machine.wait() > 1


def test_ends_when_the_server_is_to_stop(machine: Machine) -> None:
    machine.going_on = False
    assert machine.wait() == 1
