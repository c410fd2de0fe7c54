"""The link between the agent and the process that answers for it: real sockets and processes, no clock."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator

import pytest

from agent.drives.exchange import Answered
from agent.run.channel import Channel
from agent.run.relayed_link import Relay, can_relay
from ciberrato.net.link import Arrival
from ciberrato.net.udp import UdpLink
from ciberrato.protocol import (
    Acceptance,
    Actions,
    Measures,
    RobotRegistration,
    decode_actions,
    decode_simulator_message,
    encode,
)
from ciberrato.world.parameters import Parameters

PARAMETERS = Parameters(sim_time=0)
ANGLES = (0.0, 60.0, -60.0, 180.0)
PATIENCE = 300.0  # seconds; only a failure takes so long

needs_relay = pytest.mark.skipif(not can_relay(), reason="this system hands no sockets over")


def measures(time: int, *, start: bool = False) -> bytes:
    return encode(
        Measures(time=time, start=start, collision=False, compass=0.0, infrared=(0.5, 0.5, 0.5, 0.5))
    )


def test_records_of_any_length_arrive_whole_and_in_order() -> None:
    ours, theirs = (Channel(end) for end in socket.socketpair())
    records = [b"x" * length for length in (0, 1, 70_000, 3_000_000)] + [("a", 1.5)]
    for record in records:
        ours.send(record)
    assert ours.is_waiting  # more than the stream takes, and the sender was not held up
    heard = []
    while len(heard) < len(records):
        heard += theirs.receive()
        ours.flush()
    assert heard == records
    ours.close()
    assert theirs.receive() == []
    assert theirs.ended
    theirs.send("to nobody")
    assert not theirs.is_waiting
    theirs.close()


class Meeting:
    """A simulator's socket, and a link that the answering process has registered there."""

    def __init__(self) -> None:
        self.main = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.main.bind(("127.0.0.1", 0))
        self.main.settimeout(PATIENCE)
        self.direct = UdpLink("127.0.0.1", self.main.getsockname()[1])
        self.relay = Relay()
        self.link = self.relay.take_over(self.direct, ANGLES, 0.1, roams=True)
        self.heard: list[Arrival] = []
        self.told: list[Answered] = []
        self.link.register(encode(RobotRegistration(name="r")))
        _, self.client = self.main.recvfrom(2000)

    def accept(self, *, lockstep: bool = False) -> None:
        """Accept the robot, and send the Measures of time 0 behind."""
        self.main.sendto(encode(Acceptance(parameters=PARAMETERS, lockstep=lockstep)), self.client)
        self.main.sendto(measures(0), self.client)
        self.listen(lambda: len(self.heard) == 2)
        assert isinstance(decode_simulator_message(self.heard.pop(0).data), Acceptance)

    def listen(self, until: Callable[[], bool]) -> None:
        """Receive until something has come."""
        while not until():
            self.heard += self.link.receive_arrivals()
            self.told += self.link.told()
            if not until():  # what a link that is released has kept makes no socket readable
                self.link.wait(PATIENCE)

    def answer(self) -> Actions:
        return decode_actions(self.main.recv(2000))

    def close(self) -> None:
        self.link.close()
        self.relay.close()
        self.main.close()


@pytest.fixture
def meeting() -> Iterator[Meeting]:
    met = Meeting()
    met.accept()
    yield met
    met.close()


@needs_relay
def test_messages_come_through_and_decisions_leave(meeting: Meeting) -> None:
    meeting.main.sendto(measures(1), meeting.client)
    meeting.listen(lambda: len(meeting.heard) == 2)
    assert [arrival.data for arrival in meeting.heard] == [measures(0), measures(1)]
    assert all(arrival.time is not None for arrival in meeting.heard)
    meeting.link.decide(1, encode(Actions(left_motor=0.03, right_motor=-0.02, end_led=True)))
    answer = meeting.answer()
    assert (answer.left_motor, answer.right_motor, answer.end_led) == (0.03, -0.02, True)
    meeting.listen(lambda: bool(meeting.told))
    assert (meeting.told[0].command, meeting.told[0].answers) == ((0.03, -0.02), 1)


@needs_relay
def test_nothing_is_sent_after_the_agent_has_taken_the_link_back(meeting: Meeting) -> None:
    meeting.link.decide(0, encode(Actions(left_motor=0.1, right_motor=0.1)))
    assert meeting.answer().left_motor == 0.1
    meeting.link.release()
    assert not meeting.link.answers
    meeting.direct.send(encode(Actions(left_motor=0.0, right_motor=0.0)))
    assert meeting.answer().left_motor == 0.0
    meeting.main.setblocking(False)
    with pytest.raises(BlockingIOError):
        meeting.main.recv(2000)


@needs_relay
def test_a_process_that_was_killed_leaves_the_link_to_the_agent(meeting: Meeting) -> None:
    meeting.relay.process.kill()
    meeting.relay.process.wait()
    meeting.main.sendto(measures(1), meeting.client)
    meeting.listen(lambda: len(meeting.heard) == 2)
    assert not meeting.link.answers
    assert not meeting.link.is_released
    meeting.link.decide(1, encode(Actions(left_motor=0.04, right_motor=0.04)))
    assert meeting.answer().left_motor == 0.04


@needs_relay
def test_when_the_agent_is_gone_the_robot_is_stopped(meeting: Meeting) -> None:
    meeting.link.abandon()
    assert meeting.answer() == Actions(left_motor=0.0, right_motor=0.0)
    assert meeting.relay.process.wait(PATIENCE) == 0


@needs_relay
def test_a_process_that_gets_no_link_ends() -> None:
    relay = Relay()
    relay.close()
    assert relay.process.returncode == 0


@needs_relay
def test_the_first_message_that_counts_is_answered_while_the_agent_does_nothing(meeting: Meeting) -> None:
    meeting.main.sendto(measures(0, start=True), meeting.client)
    assert meeting.answer().left_motor is not None  # before the agent has looked at anything
    meeting.listen(lambda: bool(meeting.told))
    assert meeting.told[0].answers == 0
    assert meeting.link.registered is not None


@needs_relay
def test_a_simulator_that_says_it_is_in_lockstep_is_answered_by_decisions_only() -> None:
    meeting = Meeting()
    try:
        meeting.accept(lockstep=True)
        meeting.main.sendto(measures(0, start=True), meeting.client)
        meeting.listen(lambda: len(meeting.heard) == 2)
        meeting.link.decide(0, encode(Actions(left_motor=0.05, right_motor=0.05)))
        assert meeting.answer().left_motor == 0.05
        # What the process has received before it ends is not lost.
        meeting.main.sendto(measures(1, start=True), meeting.client)
        meeting.link.wait(PATIENCE)
        meeting.link.release()
        meeting.heard.clear()
        meeting.listen(lambda: bool(meeting.heard))
        assert [one.data for one in meeting.heard] == [measures(1, start=True)]
        assert meeting.direct.peer == meeting.main.getsockname()
    finally:
        meeting.close()


@needs_relay
def test_a_registration_is_sent_again_until_one_is_accepted_and_not_after() -> None:
    meeting = Meeting()
    try:
        meeting.link.register(encode(RobotRegistration(name="r")))
        assert meeting.main.recvfrom(2000)[1] == meeting.client
        meeting.accept()
        meeting.link.register(encode(RobotRegistration(name="r")))  # it has crossed the acceptance
        meeting.link.decide(0, encode(Actions(left_motor=0.05, right_motor=0.05)))
        assert meeting.answer().left_motor == 0.05  # and no registration before
    finally:
        meeting.close()
