from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from ciberrato.protocol import (
    REPLY_LIMIT,
    Acceptance,
    Actions,
    Measures,
    Refusal,
    Restart,
    RobotStatus,
    SimulatorMessage,
    decode_simulator_message,
    encode,
)
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid
from simulator_stub.service.audience import SOURCE_LIMIT, Admission
from simulator_stub.service.complaints import LIMIT
from simulator_stub.service.session import Session
from simulator_stub.simulation import Simulation
from simulator_stub.world.simulator_state import SimulatorState

ROBOT = b'<Robot Id="%d" Name="r%d"/>'


def state(session: Session) -> SimulatorState:
    return session.simulation.state


@pytest.fixture
def session(open_lab: Lab, three_places: StartGrid, quiet: Parameters) -> Session:
    return Session(Simulation(open_lab, three_places, quiet))


@pytest.fixture
def join(session: Session, newcomer: Any) -> Any:
    def join(data: bytes) -> Any:
        client = newcomer()
        session.welcome(client, data)
        return client.peer

    return join


def received(peer: Any) -> list[SimulatorMessage]:
    messages = [decode_simulator_message(data) for data in peer.received]
    peer.received.clear()
    return messages


def kinds(peer: Any) -> list[str]:
    return [type(message).__name__ for message in received(peer)]


def test_a_robot_gets_its_reply_and_first_measures_in_the_same_cycle(session: Session, join: Any) -> None:
    robot = join(ROBOT % (2, 2))
    assert robot.received == [], "nothing happens between cycles"
    session.cycle()
    reply, measures = received(robot)
    assert isinstance(reply, Acceptance)
    assert encode(reply) == encode(session.simulation.acceptance())
    assert isinstance(measures, Measures)
    assert (measures.time, measures.stop, measures.compass) == (0, True, 90.0)


def test_a_refused_robot_is_told_and_let_go(session: Session, join: Any) -> None:
    robots = [join(ROBOT % (1, 1)), join(ROBOT % (1, 1)), join(ROBOT % (9, 9))]
    robots.append(join(b'<Robot Id="3" Name="' + b"x" * 601 + b'"/>'))
    session.cycle()
    assert [robot.closed for robot in robots] == [False, True, True, True]
    assert [received(robot) for robot in robots[1:]] == [[Refusal()]] * 3
    assert list(session.robots) == [1]


def test_what_is_no_registration_gets_no_answer_and_costs_nobody_else_anything(
    session: Session, join: Any
) -> None:
    bad = [join(b"<Rat/>") for _ in range(2000)]
    robot = join(ROBOT % (1, 1))
    session.cycle()
    assert not any(peer.received for peer in bad)
    assert kinds(robot) == ["Acceptance", "Measures"]
    assert session.take_stock()["junk"] == 2000


def test_a_message_that_is_not_understood_ends_the_reading_of_that_robot_for_the_cycle(
    session: Session, join: Any
) -> None:
    robot, other = join(ROBOT % (1, 1)), join(ROBOT % (2, 2))
    session.cycle()
    robot.deliver(encode(Actions(left_motor=0.1)))
    robot.deliver(b"<Actions")
    robot.deliver(b"\0")
    robot.deliver(encode(Actions(left_motor=0.05, visiting_led=True)))
    other.deliver(encode(Actions(left_motor=0.01)))
    commands = []
    for _ in range(3):
        session.cycle()
        commands.append([record.left_command for record in session.simulation.robots])
    assert commands == [[0.1, 0.01], [0.1, 0.01], [0.05, 0.01]]
    assert session.simulation.robots[0].visiting_led


def test_answers_to_measures_act_in_the_next_step(session: Session, join: Any) -> None:
    robot, view = join(ROBOT % (1, 1)), join(b"<View/>\n\0")
    session.cycle()
    view.deliver(b"<Start/>\0")
    session.cycle()
    robot.received.clear()
    robot.deliver(encode(Actions(left_motor=0.1, right_motor=0.1)))
    session.cycle()
    (measures,) = received(robot)
    assert isinstance(measures, Measures)
    assert measures.time == 1
    assert session.simulation.robots[0].x == 3.05


def test_views_get_lab_and_grid_in_the_order_asked_and_then_the_status_of_every_robot(
    session: Session, join: Any
) -> None:
    join(ROBOT % (1, 1))
    view, other = join(b"<View/>"), join(b"<View/>")
    session.cycle()
    assert kinds(view) == ["Acceptance", "RobotStatus"]
    join(ROBOT % (3, 3))
    view.deliver(b"<LabReq/>\0")
    view.deliver(b"<GridReq/>\0")
    other.received.clear()
    session.cycle()
    lab, grid, first, second = received(view)
    assert isinstance(lab, Lab)
    assert (lab.width, lab.targets) == (20.0, session.simulation.world.lab.targets)
    assert grid == session.simulation.world.grid
    assert isinstance(first, RobotStatus)
    assert isinstance(second, RobotStatus)
    assert (first.robot_id, first.name, first.state, first.x) == (1, "r1", "Stopped", 3.0)
    assert (second.robot_id, second.direction_deg) == (3, 225.0)
    assert kinds(other) == ["RobotStatus"] * 2


def test_a_panel_gets_a_reply_and_is_not_heard(session: Session, join: Any) -> None:
    panel = join(b"<Panel/>")
    robot = join(ROBOT % (1, 1))
    session.cycle()
    panel.deliver(b"<Start/>")
    robot.received.clear()
    session.cycle()
    assert kinds(panel) == ["Acceptance"]
    assert state(session) is SimulatorState.STOPPED


def test_views_start_stop_and_remove(session: Session, join: Any) -> None:
    join(ROBOT % (1, 1))
    robot, view = join(ROBOT % (2, 2)), join(b"<View/>")
    session.cycle()
    view.deliver(b"<Start/>")
    session.cycle()
    assert state(session) is SimulatorState.RUNNING
    view.deliver(b'<Robot Id="7" Removed="Yes"/>')
    view.deliver(b'<Robot Id="2" Removed="Yes"/>')
    view.deliver(b"<Stop/>")
    session.cycle()
    assert state(session) is SimulatorState.STOPPED
    robot.received.clear()
    view.received.clear()
    session.cycle()
    assert robot.received == []
    states = [message.state for message in received(view) if isinstance(message, RobotStatus)]
    assert states == ["Stopped", "Removed"]


def test_a_reset_tells_the_views_and_forgets_everybody(session: Session, join: Any) -> None:
    robot, first, second = join(ROBOT % (1, 1)), join(b"<View/>"), join(b"<View/>")
    session.cycle()
    for peer in (robot, first, second):
        peer.received.clear()
    first.deliver(b"<Reset/>")
    second.deliver(b"<LabReq/>")
    session.cycle()
    assert robot.received == []
    assert received(first) == received(second) == [Restart()]
    assert all(peer.closed for peer in (robot, first, second))
    again = join(ROBOT % (1, 1))
    session.cycle()
    assert kinds(again) == ["Acceptance", "Measures"]


def test_a_start_with_the_first_registration_comes_too_early(session: Session, join: Any) -> None:
    view = join(b"<View/>")
    session.cycle()
    assert state(session) is SimulatorState.STOPPED
    view.deliver(b"<Start/>")
    session.cycle()
    assert state(session) is SimulatorState.RUNNING
    late = join(ROBOT % (1, 1))
    session.cycle()
    assert received(late) == [Refusal()]


def test_the_automatic_start_comes_once(
    open_lab: Lab, three_places: StartGrid, quiet: Parameters, newcomer: Any
) -> None:
    session = Session(Simulation(open_lab, three_places, quiet), autostart=2)
    clients = [newcomer() for _ in range(3)]
    session.welcome(clients[0], ROBOT % (1, 1))
    for _ in range(3):
        session.cycle()
    assert state(session) is SimulatorState.STOPPED
    session.welcome(clients[1], ROBOT % (2, 2))
    session.welcome(clients[2], b"<View/>")
    session.cycle()
    assert state(session) is SimulatorState.STOPPED, "every robot sees a stopped cycle"
    session.cycle()
    assert state(session) is SimulatorState.RUNNING
    clients[2].peer.deliver(b"<Stop/>")
    for _ in range(3):
        session.cycle()
    assert state(session) is SimulatorState.STOPPED


def test_a_long_lab_name_does_not_make_the_reply_too_long(
    open_lab: Lab, three_places: StartGrid, newcomer: Any
) -> None:
    parameters = Parameters(lab_file="/" + "f" * 400 + "/lab.xml", grid_file="grid.xml")
    session = Session(Simulation(open_lab, three_places, parameters))
    client = newcomer()
    session.welcome(client, ROBOT % (1, 1))
    session.cycle()
    assert len(client.peer.received[0]) <= REPLY_LIMIT
    reply = decode_simulator_message(client.peer.received[0])
    assert isinstance(reply, Acceptance)
    assert reply.parameters == replace(parameters, lab_file="lab.xml", beacon_aperture=3.141593)


def test_a_client_may_send_on_before_it_is_registered_where_messages_keep_their_order(
    session: Session, newcomer: Any
) -> None:
    client = newcomer()

    class Stream(newcomer):  # type: ignore[misc]
        def accept(self) -> Any:
            self.registered = client.peer
            return client.peer

    stream = Stream()
    session.welcome(stream, ROBOT % (1, 1))
    session.welcome(stream, encode(Actions(left_motor=0.1)))
    session.cycle()
    session.cycle()
    assert session.simulation.robots[0].left_command == 0.1


def test_a_flood_of_messages_is_bounded(session: Session, join: Any, newcomer: Any) -> None:
    robot, view = join(ROBOT % (1, 1)), join(b"<View/>")
    session.cycle()
    for _ in range(5000):
        robot.deliver(b"<rubbish")
        view.deliver(b"<rubbish")
        session.welcome(newcomer(), b"<rubbish")
    assert len(session.robots[1].messages) <= 1000
    assert len(session.views[0].messages) <= 1000
    robot.received.clear()
    session.cycle()
    assert kinds(robot) == ["Measures"]


def test_views_and_panels_are_taken_up_to_a_limit(session: Session, join: Any) -> None:
    views = [join(b"<View/>") for _ in range(SOURCE_LIMIT - 1)]
    panel = join(b"<Panel/>")
    session.cycle()
    assert len(session.views) == SOURCE_LIMIT - 1
    refused = [join(b"<View/>"), join(b"<Panel/>")]
    session.cycle()
    assert [received(peer) for peer in refused] == [[Refusal()]] * 2
    assert all(peer.closed for peer in refused)
    panel.close()
    views[0].close()
    session.cycle()
    again = [join(b"<View/>"), join(b"<Panel/>")]
    session.cycle()
    assert all(isinstance(received(peer)[0], Acceptance) for peer in again)


def test_without_views_no_client_can_look_or_stop(
    open_lab: Lab, three_places: StartGrid, quiet: Parameters, newcomer: Any
) -> None:
    lines: list[str] = []
    world = Simulation(open_lab, three_places, quiet, 0)
    session = Session(world, admission=Admission(limit=0), notify=lines.append)
    peers = [newcomer() for _ in range(2)]
    for peer, data in zip(peers, (b"<View/>", b"<Panel/>"), strict=True):
        session.welcome(peer, data)
    session.cycle()
    assert not session.views
    assert [received(peer.peer) for peer in peers] == [[Refusal()]] * 2
    assert lines[0].startswith("refused a view: there are to be none (--views 0)")


def test_people_are_not_told_of_broken_messages_without_end(
    open_lab: Lab, three_places: StartGrid, quiet: Parameters, newcomer: Any
) -> None:
    lines: list[str] = []
    session = Session(Simulation(open_lab, three_places, quiet), notify=lines.append)
    for _ in range(100):
        session.welcome(newcomer(), b"<Rat/>")
        session.cycle()
    assert len(lines) == LIMIT + 1
    session.reset()
    session.welcome(newcomer(), b"<Rat/>")
    session.cycle()
    assert "Rat" in lines[-1]


def test_where_no_socket_is_left_the_simulator_goes_on(session: Session, join: Any, newcomer: Any) -> None:
    robot = join(ROBOT % (1, 1))
    session.cycle()
    unlucky = newcomer()

    def accept() -> None:
        raise OSError(24, "Too many open files")

    unlucky.accept = accept
    session.welcome(unlucky, ROBOT % (2, 2))
    robot.received.clear()
    session.cycle()
    assert kinds(robot) == ["Measures"]
    assert list(session.robots) == [1]


@pytest.mark.parametrize(
    ("autostart", "told"),
    [
        (0, ["waiting for Start (a viewer"]),
        (1, []),
        (2, ["waiting for 1 more robot, or for Start (a viewer"]),
    ],
)
def test_a_robot_that_waits_for_start_is_told_of_once(
    autostart: int, told: list[str], open_lab: Lab, three_places: StartGrid, quiet: Parameters, newcomer: Any
) -> None:
    lines: list[str] = []
    session = Session(Simulation(open_lab, three_places, quiet), autostart=autostart, notify=lines.append)
    session.cycle()
    session.welcome(newcomer(), ROBOT % (1, 1))
    for _ in range(10):
        session.cycle()
    session.welcome(newcomer(), ROBOT % (2, 2))
    for _ in range(10):
        session.cycle()
    waiting = [line for line in lines if "waiting for" in line]
    assert len(waiting) == len(told)
    assert all(line.startswith(text) for line, text in zip(waiting, told, strict=True))
