from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from ciberrato.protocol import Acceptance, Actions, decode_simulator_message, encode
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid
from simulator_stub.service.answers import BLIND_PATIENCE, SETTLE
from simulator_stub.service.pace import IDLE_LIMIT, Lockstep, Pace, RealTime
from simulator_stub.service.session import Session
from simulator_stub.simulation import Simulation
from simulator_stub.world.simulator_state import SimulatorState

PERIOD = 0.05
LIMIT = 1.0
DOUBT = PERIOD / 2  # after a silence the first message may be an old answer: it must be quiet for so long
MOVE = encode(Actions(left_motor=0.1, right_motor=0.1))


def move(power: float) -> bytes:
    return encode(Actions(left_motor=power, right_motor=power))


LIGHT = b'<Actions LeftMotor="0.0" RightMotor="0.0" VisitingLed="On"/>'


class World:
    """A clock that passes only while somebody polls, and clients that act at given times."""

    def __init__(self) -> None:
        self.now = 100.0
        self.agenda: list[tuple[float, Callable[[], None]]] = []
        self.polls: list[float] = []

    def clock(self) -> float:
        return self.now

    def at(self, time: float, action: Callable[[], None]) -> None:
        self.agenda.append((time, action))
        self.agenda.sort(key=lambda entry: entry[0])

    def after(self, delay: float, action: Callable[[], None]) -> None:
        self.at(self.now + delay, action)

    def poll(self, timeout: float) -> bool:
        assert timeout >= 0.0
        self.polls.append(timeout)
        end = self.now + timeout
        if self.agenda and self.agenda[0][0] <= end:
            time, action = self.agenda.pop(0)
            self.now = max(self.now, time)
            action()
        else:
            self.now = end
        return True


@pytest.fixture
def world() -> World:
    return World()


@pytest.fixture
def session(open_lab: Lab, three_places: StartGrid) -> Session:
    return Session(Simulation(open_lab, three_places, Parameters(sim_time=200)))


@pytest.fixture
def join(session: Session, newcomer: Any) -> Callable[[bytes], Any]:
    def join(data: bytes = b"<Robot/>") -> Any:
        client = newcomer()
        session.welcome(client, data)
        return client.peer

    return join


def lockstep(session: Session, world: World, notices: list[str] | None = None) -> Lockstep:
    notify = (lambda line: None) if notices is None else notices.append
    return Lockstep(session, PERIOD, limit=LIMIT, adaptive=False, notify=notify, clock=world.clock)


def adaptive(session: Session, world: World, notices: list[str] | None = None) -> Lockstep:
    notify = (lambda line: None) if notices is None else notices.append
    return Lockstep(session, PERIOD, limit=LIMIT, notify=notify, clock=world.clock)


def cycle_at(pace: Pace, session: Session, world: World) -> float:
    """Wait for a cycle and do it; returns the seconds that it took to come."""
    before = world.now
    assert pace.wait(world.poll)
    session.cycle()
    return world.now - before


def test_real_time_cycles_come_at_multiples_of_the_period_whatever_arrives(
    session: Session, world: World, join: Any
) -> None:
    robot = join()
    pace = RealTime(session, PERIOD, clock=world.clock)
    times = []
    for _ in range(40):
        world.after(0.013, lambda: robot.deliver(MOVE))
        world.after(0.031, lambda: robot.deliver(MOVE))
        assert pace.wait(world.poll)
        times.append(world.now)
        session.cycle()
        world.now += 0.007  # what the cycle itself takes
    assert times == pytest.approx([100.0 + PERIOD * (n + 1) for n in range(40)], abs=1e-9)
    assert pace.late == 0


def test_a_long_delay_is_counted_and_not_caught_up_with(session: Session, world: World, join: Any) -> None:
    join()
    pace = RealTime(session, PERIOD, clock=world.clock)
    cycle_at(pace, session, world)
    session.simulation.start()
    cycle_at(pace, session, world)
    assert session.simulation.state is SimulatorState.RUNNING
    world.now += 0.5
    assert cycle_at(pace, session, world) == 0.0
    assert pace.late == 1
    assert cycle_at(pace, session, world) == pytest.approx(PERIOD)
    world.now += 0.06
    assert cycle_at(pace, session, world) == 0.0, "less than a period late: the schedule holds"
    assert cycle_at(pace, session, world) == pytest.approx(0.04)
    assert pace.late == 1


@pytest.fixture
def running(session: Session, world: World, join: Any) -> tuple[Lockstep, list[Any], list[str]]:
    """Two robots in lockstep, running, that have both not answered yet."""
    notices: list[str] = []
    robots = [join(), join()]
    pace = lockstep(session, world, notices)
    cycle_at(pace, session, world)
    session.simulation.start()
    for robot in robots:
        robot.deliver(MOVE)
    cycle_at(pace, session, world)
    assert session.simulation.state is SimulatorState.RUNNING
    return pace, robots, notices


def test_in_lockstep_a_cycle_comes_as_soon_as_all_have_answered(
    session: Session, world: World, running: Any
) -> None:
    pace, robots, _ = running
    for delay in (0.0001, 0.02, 0.7):
        world.after(delay / 2, lambda: robots[1].deliver(MOVE))
        world.after(delay, lambda: robots[0].deliver(MOVE))
        assert cycle_at(pace, session, world) == pytest.approx(delay)
    assert session.simulation.time == 3


def test_a_robot_that_lets_the_limit_pass_is_not_waited_for_until_it_speaks(
    session: Session, world: World, running: Any
) -> None:
    pace, robots, notices = running
    robots[0].deliver(MOVE)
    assert cycle_at(pace, session, world) == pytest.approx(LIMIT)
    assert notices == ["robot 2 is silent and not waited for until it answers"]
    for _ in range(3):
        world.after(0.001, lambda: robots[0].deliver(MOVE))
        assert cycle_at(pace, session, world) == pytest.approx(0.001)
    world.after(0.001, lambda: robots[1].deliver(MOVE))
    world.after(0.002, lambda: robots[0].deliver(MOVE))
    assert cycle_at(pace, session, world) == pytest.approx(0.002)
    world.after(0.001, lambda: robots[0].deliver(MOVE))
    world.after(0.5, lambda: robots[1].deliver(MOVE))
    assert cycle_at(pace, session, world) == pytest.approx(0.5 + DOUBT), "it is waited for again"


def test_with_nobody_left_to_wait_for_the_run_goes_on_in_real_time(
    session: Session, world: World, running: Any
) -> None:
    pace, _, notices = running
    assert cycle_at(pace, session, world) == pytest.approx(LIMIT)
    assert len(notices) == 2
    for _ in range(5):
        assert cycle_at(pace, session, world) == pytest.approx(PERIOD)
    assert pace.late == 0


def test_robots_that_are_finished_or_gone_are_not_waited_for(
    session: Session, world: World, running: Any
) -> None:
    pace, robots, _ = running
    robots[0].deliver(encode(Actions(left_motor=0.1, end_led=True)))
    robots[1].deliver(MOVE)
    cycle_at(pace, session, world)
    assert session.simulation.robots[0].state.value == "Finished"
    world.after(0.001, lambda: robots[1].deliver(MOVE))
    assert cycle_at(pace, session, world) == pytest.approx(0.001)
    session.simulation.remove(2)
    world.after(0.001, lambda: robots[1].deliver(MOVE))
    assert cycle_at(pace, session, world) == pytest.approx(0.001)
    assert cycle_at(pace, session, world) == pytest.approx(PERIOD)


def test_a_connection_that_has_ended_is_not_waited_for(session: Session, world: World, running: Any) -> None:
    pace, robots, notices = running
    robots[0].deliver(MOVE)
    session.robots[2].peer.closed = True
    assert cycle_at(pace, session, world) == 0.0
    assert notices == []


def test_a_led_message_is_given_time_for_the_motor_command_that_follows(
    session: Session, world: World, running: Any
) -> None:
    pace, robots, _ = running
    robots[1].deliver(MOVE)
    world.after(0.01, lambda: robots[0].deliver(LIGHT))
    world.after(0.011, lambda: robots[0].deliver(LIGHT))
    world.after(0.012, lambda: robots[0].deliver(MOVE))
    assert cycle_at(pace, session, world) == pytest.approx(0.012)
    record = session.simulation.robots[0]
    assert (record.left_command, record.visiting_led) == (0.1, True)
    robots[1].deliver(MOVE)
    world.after(0.01, lambda: robots[0].deliver(LIGHT))
    assert cycle_at(pace, session, world) == pytest.approx(0.01 + SETTLE)


def test_while_stopped_cycles_keep_the_pace_and_wait_for_answers_too(
    session: Session, world: World, join: Any
) -> None:
    robot = join()
    pace = lockstep(session, world)
    assert cycle_at(pace, session, world) == pytest.approx(PERIOD), "nobody to wait for yet"
    world.after(0.001, lambda: robot.deliver(MOVE))
    assert cycle_at(pace, session, world) == pytest.approx(PERIOD), "not faster, though it has answered"
    world.after(0.3, lambda: robot.deliver(MOVE))
    assert cycle_at(pace, session, world) == pytest.approx(0.3)
    assert cycle_at(pace, session, world) == pytest.approx(PERIOD + LIMIT), "it does not answer"
    assert cycle_at(pace, session, world) == pytest.approx(PERIOD), "nor is it expected to any more"
    session.simulation.start()
    cycle_at(pace, session, world)
    world.after(0.9, lambda: robot.deliver(MOVE))
    assert cycle_at(pace, session, world) == pytest.approx(0.9 + DOUBT), "but it is once the run starts"
    assert session.simulation.time == 1


@pytest.mark.parametrize(
    ("limit", "fixed", "waited"),
    [
        (10.0, True, 10.0),
        (0.1, True, 0.1),
        (math.inf, True, IDLE_LIMIT),
        (LIMIT, False, IDLE_LIMIT),
        (0.1, False, 0.1),
    ],
)
def test_before_the_start_a_limit_of_the_users_counts_unless_it_has_no_end(
    session: Session, world: World, join: Any, limit: float, fixed: bool, waited: float
) -> None:
    robot = join()
    pace = Lockstep(session, PERIOD, limit=limit, adaptive=not fixed, clock=world.clock)
    cycle_at(pace, session, world)
    world.after(PERIOD + 0.9 * waited, lambda: robot.deliver(MOVE))
    assert cycle_at(pace, session, world) == pytest.approx(PERIOD + 0.9 * waited)
    assert cycle_at(pace, session, world) == pytest.approx(PERIOD + waited)
    assert cycle_at(pace, session, world) == pytest.approx(PERIOD), "once"


def test_the_automatic_start_does_not_wait_for_the_next_tick(
    open_lab: Lab, three_places: StartGrid, world: World, newcomer: Any
) -> None:
    session = Session(Simulation(open_lab, three_places), autostart=1)
    client = newcomer()
    session.welcome(client, b"<Robot/>")
    pace = lockstep(session, world)
    cycle_at(pace, session, world)
    world.after(0.002, lambda: client.peer.deliver(MOVE))
    assert cycle_at(pace, session, world) == pytest.approx(0.002)
    assert session.simulation.state is SimulatorState.RUNNING


def test_a_client_that_always_has_something_waiting_does_not_keep_others_from_being_heard(
    session: Session, world: World, running: Any, join: Any
) -> None:
    pace, robots, _ = running
    for robot in robots:
        for _ in range(50):
            robot.deliver(b"<rubbish")
    view: list[Any] = []
    world.after(0.0, lambda: view.append(join(b"<View/>")))
    cycle_at(pace, session, world)
    assert len(session.views) == 1


def test_waiting_ends_when_the_server_is_to_stop(session: Session, world: World, running: Any) -> None:
    pace, _, _ = running
    assert not pace.wait(lambda timeout: False)
    assert not RealTime(session, PERIOD, clock=world.clock).wait(lambda timeout: False)


def test_a_newcomer_does_not_wait_for_robots_that_are_silent_while_stopped(
    session: Session, world: World, join: Any
) -> None:
    join()
    pace = lockstep(session, world)
    cycle_at(pace, session, world)
    world.after(PERIOD + 0.01, join)
    assert cycle_at(pace, session, world) == pytest.approx(PERIOD + 0.01)
    assert len(session.robots) == 2


@pytest.fixture
def alone(session: Session, world: World, join: Any) -> tuple[Lockstep, Any, list[str]]:
    """One robot in lockstep that adapts, running, whose process cannot be watched; it answered in 1 ms."""
    notices: list[str] = []
    robot = join()
    pace = adaptive(session, world, notices)
    cycle_at(pace, session, world)
    session.simulation.start()
    robot.deliver(MOVE)
    cycle_at(pace, session, world)
    for _ in range(5):
        world.after(0.001, lambda: robot.deliver(MOVE))
        cycle_at(pace, session, world)
    return pace, robot, notices


def test_an_unanswered_measures_costs_no_more_than_real_time_and_then_less(
    session: Session, world: World, alone: Any
) -> None:
    pace, robot, notices = alone
    costs = []
    for _ in range(4):
        costs.append(cycle_at(pace, session, world))
        for _ in range(3):
            world.after(0.001, lambda: robot.deliver(MOVE))
            cycle_at(pace, session, world)
    assert costs[0] == pytest.approx(PERIOD)
    assert costs[1:] == pytest.approx([BLIND_PATIENCE] * 3)
    assert [line for line in notices if "unanswered" in line] == [
        "robot 1 left the Measures of time 5 unanswered: its last command stays "
        "(reported once; --result has the count)"
    ]
    assert pace.counts(1) == {"unanswered": 4, "superseded": 0, "late": 0}


def test_a_robot_that_never_answers_again_costs_one_limit_in_all(
    session: Session, world: World, alone: Any
) -> None:
    pace, _, notices = alone
    costs = []
    while not session.robots[1].silent:
        costs.append(cycle_at(pace, session, world))
    assert max(costs) == pytest.approx(PERIOD)
    assert sum(costs) == pytest.approx(LIMIT, abs=PERIOD)
    assert notices[-1] == "robot 1 is silent and not waited for until it answers"


def test_what_comes_while_a_cycle_is_computed_does_not_answer_its_measures(
    session: Session, world: World, alone: Any
) -> None:
    pace, robot, notices = alone
    world.after(0.001, lambda: robot.deliver(move(0.01)))
    assert pace.wait(world.poll)
    world.at(world.now, lambda: robot.deliver(move(0.02)))
    session.cycle()
    assert session.simulation.robots[0].left_command == 0.01
    world.after(0.001, lambda: robot.deliver(move(0.03)))
    cycle_at(pace, session, world)
    assert session.simulation.robots[0].left_command == 0.03, "what came late is replaced"
    assert pace.counts(1) == {"unanswered": 0, "superseded": 0, "late": 1}
    assert [line for line in notices if "came after its cycle" in line]


def test_a_brake_is_given_time_for_the_command_that_follows(
    session: Session, world: World, alone: Any
) -> None:
    pace, robot, notices = alone
    for _ in range(2):
        world.after(0.001, lambda: robot.deliver(move(0.0)))
        world.after(0.0015, lambda: robot.deliver(move(0.02)))
        cycle_at(pace, session, world)
        assert session.simulation.robots[0].left_command == 0.02
    assert pace.counts(1) == {"unanswered": 0, "superseded": 2, "late": 0}
    assert len([line for line in notices if "the last one counts" in line]) == 1


def test_a_robot_that_sent_several_commands_is_never_a_cycle_behind_for_long(
    session: Session, world: World, alone: Any
) -> None:
    """The second command of a cycle comes after the next Measures: what a clock cannot tell at once."""
    pace, robot, _ = alone
    lags = []
    for cycle in range(40):
        time = session.simulation.time
        tag = (time + 1) / 10_000
        late = cycle % 10 == 5
        if late:  # answers the Measures before: sent 0.3 ms after these went out
            world.after(0.0003, lambda tag=tag: robot.deliver(move(tag - 1e-4)))
        world.after(0.0012, lambda tag=tag: robot.deliver(move(tag)))
        cycle_at(pace, session, world)
        lags.append(time + 1 - round(session.simulation.robots[0].left_command * 10_000))
    assert not world.agenda
    assert not any(lags)


def test_the_settings_of_a_fixed_limit_wait_for_slow_answers(
    session: Session, world: World, running: Any
) -> None:
    pace, robots, _ = running
    robots[0].deliver(MOVE)
    world.after(0.9, lambda: robots[1].deliver(MOVE))
    assert cycle_at(pace, session, world) == pytest.approx(0.9)


@pytest.mark.parametrize("told", [False, True])
def test_clients_are_told_of_lockstep_when_they_register(
    session: Session, world: World, join: Any, told: bool
) -> None:
    pace = lockstep(session, world) if told else RealTime(session, PERIOD, clock=world.clock)
    peer = join()
    cycle_at(pace, session, world)
    answer = decode_simulator_message(peer.received[0])
    assert isinstance(answer, Acceptance)
    assert answer.lockstep is told
