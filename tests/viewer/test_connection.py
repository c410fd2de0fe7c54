"""The viewer's talk with a simulator, without sockets: who asks what, when."""

import itertools

import pytest

from ciberrato.protocol import Acceptance, Refusal, Restart, RobotStatus, encode
from ciberrato.viewer.connection import (
    ANSWER_SECONDS,
    FIRST_RETRY,
    LONGEST_RETRY,
    MOST_UNANSWERED,
    SILENCE_SECONDS,
    ConnectionState,
    SimulatorConnection,
)
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid

REPLY = encode(Acceptance(parameters=Parameters(), n_beacons=1))
LAB = encode(Lab(name="x", width=4.0, height=2.0))
GRID = encode(StartGrid())
STATUS = encode(RobotStatus(name="a", robot_id=1))


@pytest.fixture
def watching():
    connection = SimulatorConnection()
    connection.start(0.0)
    for data in (REPLY, LAB, GRID):
        connection.receive(data, 1.0)
    assert connection.state is ConnectionState.WATCHING
    return connection


def sent(outgoing):
    return [message.data for message in outgoing]


@pytest.mark.parametrize(("token", "data"), [(None, b"<View/>\0"), ("s", b'<View Token="s"/>\0')])
def test_registers_with_the_token_that_it_has(token, data):
    connection = SimulatorConnection(token=token)
    assert sent(connection.start(0.0)) == [data]


def test_asks_for_the_lab_and_then_the_grid_as_soon_as_it_is_accepted():
    connection = SimulatorConnection()
    [registration] = connection.start(0.0)
    assert registration.registration
    assert registration.data == b"<View/>\0"
    message, outgoing = connection.receive(REPLY, 0.1)
    assert isinstance(message, Acceptance)
    assert sent(outgoing) == [b"<LabReq/>\0", b"<GridReq/>\0"]
    assert not any(one.registration for one in outgoing)


def test_is_watching_only_with_both_lab_and_grid():
    connection = SimulatorConnection()
    connection.start(0.0)
    connection.receive(REPLY, 0.1)
    connection.receive(GRID, 0.2)
    assert connection.state is ConnectionState.LOADING
    connection.receive(LAB, 0.2)
    assert connection.state is ConnectionState.WATCHING


def test_registers_again_at_once_after_a_restart_and_asks_anew(watching):
    message, outgoing = watching.receive(encode(Restart()), 2.0)
    assert isinstance(message, Restart)
    assert [(one.data, one.registration) for one in outgoing] == [(b"<View/>\0", True)]
    _, outgoing = watching.receive(REPLY, 2.1)
    assert sent(outgoing) == [b"<LabReq/>\0", b"<GridReq/>\0"]


def test_registers_less_and_less_often_while_nobody_answers():
    connection = SimulatorConnection()
    connection.start(0.0)
    moments, now = [], 0.0
    while len(moments) < 8:
        now += 0.05
        if connection.tick(now):
            moments.append(now)
    gaps = [round(b - a, 2) for a, b in itertools.pairwise(moments)]
    assert moments[0] == pytest.approx(FIRST_RETRY, abs=0.1)
    assert gaps == sorted(gaps)
    assert gaps[-1] == pytest.approx(LONGEST_RETRY, abs=0.1)


def test_goes_on_trying_after_a_refusal():
    connection = SimulatorConnection()
    connection.start(0.0)
    _, outgoing = connection.receive(encode(Refusal()), 0.1)
    assert outgoing == []
    assert connection.state is ConnectionState.SEARCHING
    assert sent(connection.tick(0.1 + LONGEST_RETRY)) == [b"<View/>\0"]


def test_asks_again_for_what_was_lost_on_the_way():
    connection = SimulatorConnection()
    connection.start(0.0)
    connection.receive(REPLY, 0.0)
    assert connection.tick(ANSWER_SECONDS - 0.01) == []
    assert sent(connection.tick(ANSWER_SECONDS)) == [b"<LabReq/>\0", b"<GridReq/>\0"]


def test_a_silent_simulator_is_asked_and_given_up_in_the_end(watching):
    now = 1.0 + SILENCE_SECONDS
    assert watching.tick(now - 0.01) == []
    for _ in range(MOST_UNANSWERED):
        assert sent(watching.tick(now)) == [b"<GridReq/>\0"]
        now += ANSWER_SECONDS
    [registration] = watching.tick(now)
    assert registration.registration
    assert watching.state is ConnectionState.SEARCHING


def test_an_empty_simulator_that_answers_is_not_given_up(watching):
    now = 1.0
    for _ in range(50):
        now += SILENCE_SECONDS
        assert sent(watching.tick(now)) == [b"<GridReq/>\0"]
        watching.receive(GRID, now)
    assert watching.state is ConnectionState.WATCHING


def test_what_is_no_message_is_counted_and_reported_once():
    lines = []
    connection = SimulatorConnection(lines.append)
    connection.start(0.0)
    for data in (b"", b"\xff", b"<Robot", REPLY[:50]):
        assert connection.receive(data, 0.0) == (None, [])
    assert connection.undecodable == 4
    assert len(lines) == 1


def test_late_messages_of_the_former_world_do_not_count_while_it_registers(watching):
    watching.receive(encode(Restart()), 2.0)
    assert watching.receive(STATUS, 2.0) == (None, [])
