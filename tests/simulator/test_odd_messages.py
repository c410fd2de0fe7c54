"""Odd messages and parameters that the real simulator takes, in a session: what comes of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from ciberrato.files.parameters import parse_parameters_with_warnings
from ciberrato.protocol import (
    Acceptance,
    Actions,
    Measures,
    Refusal,
    RobotRegistration,
    decode_simulator_message,
    encode_parameters,
)
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid
from simulator_stub.service.session import Session
from simulator_stub.simulation import Simulation


class World:
    """A session and its clients."""

    def __init__(self, session: Session, newcomer: Any) -> None:
        self.session = session
        self.notes: list[str] = []
        self._newcomer = newcomer

    def join(self, data: bytes) -> Any:
        client = self._newcomer()
        self.session.welcome(client, data)
        return client.peer


def received(peer: Any) -> list[Any]:
    messages = [decode_simulator_message(data) for data in peer.received]
    peer.received.clear()
    return messages


@pytest.fixture
def world(open_lab: Lab, three_places: StartGrid, quiet: Parameters, newcomer: Any) -> World:
    notes: list[str] = []
    made = World(Session(Simulation(open_lab, three_places, quiet), notify=notes.append), newcomer)
    made.notes = notes
    return made


@pytest.mark.parametrize("number", [b"-1", b"-99", b"0", b"abc", b""])
def test_a_robot_that_names_no_place_gets_the_first_that_is_free(world: World, number: bytes) -> None:
    first = world.join(b'<Robot Id="1" Name="a"/>')
    second = world.join(b'<Robot Id="' + number + b'" Name="b"/>')
    world.session.cycle()
    assert isinstance(received(first)[0], Acceptance)
    assert isinstance(received(second)[0], Acceptance)
    assert list(world.session.robots) == [1, 2]
    for _ in range(2):
        last = world.join(b'<Robot Id="' + number + b'" Name="c"/>')
        world.session.cycle()
    assert received(last) == [Refusal()], "the grid is full"


@pytest.mark.parametrize("empty", [b"<Say/>", b"<Say></Say>", b"<Say><![CDATA[]]></Say>"])
def test_an_empty_say_keeps_what_was_said_before_in_the_same_cycle(world: World, empty: bytes) -> None:
    robot = world.join(b'<Robot Id="1" Name="a"/>')
    world.session.cycle()
    received(robot)
    for messages, heard in (
        ((b"<Say>hello</Say>", empty), ["hello"]),
        ((b"<Say>hello</Say>", b"<Actions>" + empty + b"</Actions>", b"<Say>you</Say>"), ["you"]),
        ((empty,), []),
        ((), []),
    ):
        for message in messages:
            robot.deliver(message)
        world.session.cycle()
        (measures,) = received(robot)
        assert isinstance(measures, Measures)
        assert [message.text for message in measures.messages] == heard


def test_a_beacon_robot_with_sensors_is_no_registration_and_holds_up_nobody(world: World) -> None:
    for number, sensor in enumerate((b'<IRSensor Id="0"/>', b'<IRSensor Id="0" Angle="1"/>'), 1):
        beacon = world.join(b'<RobotBeacon Name="b">' + sensor + b"</RobotBeacon>")
        robot = world.join(b'<Robot Name="r"/>')
        world.session.cycle()
        assert bool(robot.received)
        assert not beacon.received
        assert len(world.session.robots) == number


def test_a_robot_drives_by_messages_that_are_no_xml(world: World) -> None:
    robot = world.join(b'<!DOCTYPE Robot [<!ENTITY e "x">]><Robot Id="3"Id="1" Name="a\x01">&e;</Robot>')
    world.session.cycle()
    assert isinstance(received(robot)[0], Acceptance)
    assert world.session.simulation.robots[0].name == "a?"
    robot.deliver(b'<Actions LeftMotor="0.1"RightMotor="0.05" LeftMotor="\xc2\xa00.02">&e;</Actions>')
    robot.deliver(b'<Actions RightMotor="&e;"/>')
    robot.deliver(b'<Actions RightMotor="0.15"/>')
    world.session.cycle()
    only = world.session.simulation.robots[0]
    assert (only.left_command, only.right_command) == (0.02, 0.05), "the third waits for the next cycle"
    assert world.notes[-1].startswith("robot 1: Actions RightMotor: entities are not part of the protocol")


def test_two_penalties_keep_their_sign() -> None:
    text = b"""<Parameters ReturnTimePenalty="-7" ArrivalTimePenalty="-7" CollisionWallPenalty="-7"
                           CollisionRobotPenalty="-7" TargetReward="-7" HomeReward="-7"/>"""
    parameters, warnings = parse_parameters_with_warnings(text, "p.xml")
    assert (parameters.return_time_penalty, parameters.collision_robot_penalty) == (-7, -7)
    assert (parameters.arrival_time_penalty, parameters.collision_wall_penalty) == (0, 0)
    assert len(warnings) == 4
    told = encode_parameters(parameters, 0)
    assert 'ReturnTimePenalty="-7" ArrivalTimePenalty="0"' in told
    assert 'CollisionWallPenalty="0" CollisionRobotPenalty="-7"' in told


def test_a_negative_penalty_lowers_the_score(
    open_lab: Lab, three_places: StartGrid, quiet: Parameters
) -> None:
    simulation = Simulation(open_lab, three_places, replace(quiet, collision_robot_penalty=-7))
    for _ in range(2):
        simulation.register(RobotRegistration())
    simulation.launch()
    simulation.place(1, 5.0, 5.0, 0.0)
    simulation.place(2, 6.01, 5.0, 3.14159)
    simulation.step({robot: Actions(left_motor=0.1, right_motor=0.1) for robot in (1, 2)})
    assert [robot.collisions for robot in simulation.robots] == [1, 1]
    assert [robot.score for robot in simulation.robots] == [293, 293]
