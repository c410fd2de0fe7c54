"""Every message is answered in time and safely, however late the agent decides: no clock but ours."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

import pytest

from agent.drives.exchange import Answered, Exchange
from agent.drives.reflex import Reflex
from agent.run.answerer import Answerer, AnswererSetup
from ciberrato.files.lab import read_lab
from ciberrato.files.start_grid import read_grid
from ciberrato.labs import find_grid, find_lab
from ciberrato.net.link import Arrival
from ciberrato.protocol import Actions, Measures, RobotRegistration, decode_actions, encode
from ciberrato.world.parameters import Parameters
from simulator_stub.simulation import Simulation

ANGLES = (0.0, 60.0, -60.0, 180.0)
PARAMETERS = Parameters(sim_time=0)
CYCLE = PARAMETERS.cycle_time / 1000.0
OPEN = (0.5, 0.5, 0.5, 0.5)


def measures(
    time: int, infrared: tuple[float, ...] = OPEN, *, start: bool = True, collision: bool = False
) -> Measures:
    return Measures(time=time, start=start, collision=collision, compass=0.0, infrared=infrared)


class Bench:
    """An answerer, what it has sent, and the time."""

    def __init__(
        self, *, roams: bool = True, parameters: Parameters = PARAMETERS, lockstep: bool = False
    ) -> None:
        self.sent: list[tuple[float, Actions]] = []
        self.told: list[Answered] = []
        self.now = 100.0
        setup = AnswererSetup(
            parameters=parameters, angles=ANGLES, cruise=0.1, roams=roams, lockstep=lockstep
        )
        self.answerer = Answerer(setup, self._send, self.told.append)

    def _send(self, data: bytes) -> None:
        self.sent.append((self.now, decode_actions(data)))

    def hear(self, *messages: Measures, after: float = 0.0, late: float = 0.0) -> None:
        """Let messages arrive together, and the answerer have its turn so much later."""
        self.now += after
        came, self.now = self.now, self.now + late
        self.answerer.take([Arrival(encode(message), came) for message in messages], self.now)
        self.answerer.tick(self.now)

    def decide(self, time: int, left: float, right: float, **more: bool) -> None:
        self.answerer.decide(time, Actions(left_motor=left, right_motor=right, **more), self.now)

    def pass_time(self, until: float) -> None:
        """Let everything happen that is due before a time."""
        while self.answerer.due < until:
            self.now = max(self.now, self.answerer.due)
            self.answerer.tick(self.now)
        self.now = until

    def drive(self, times: range) -> None:
        """Hear a message a cycle, and decide on each at once to go straight on."""
        for time in times:
            self.hear(measures(time))
            self.decide(time, 0.1, 0.1)
            self.pass_time(self.now + CYCLE)


def command(actions: Actions) -> tuple[float | None, float | None]:
    return actions.left_motor, actions.right_motor


def test_a_decision_in_time_is_sent_as_it_is_and_told() -> None:
    bench = Bench()
    bench.drive(range(80))
    assert len(bench.sent) == 80
    bench.hear(measures(80, (1.0, 2.5, 2.5, 0.6)))
    bench.decide(80, 0.05, 0.09, end_led=True)
    assert command(bench.sent[-1][1]) == (0.05, 0.09)
    assert bench.sent[-1][1].end_led is True
    assert bench.told[-1] == Answered(bench.now, (0.05, 0.09), answers=80, seconds=0.0)


def test_without_a_decision_a_message_is_answered_within_half_a_cycle_by_the_last() -> None:
    bench = Bench()
    bench.drive(range(80))
    begin = bench.now
    bench.hear(measures(80))
    bench.pass_time(begin + CYCLE)
    assert [command(actions) for _, actions in bench.sent[80:]] == [(0.1, 0.1)]
    assert 0.0 < bench.sent[-1][0] - begin < CYCLE / 2.0
    # The next is not waited for: who was late once is likely to be late again.
    bench.hear(measures(81))
    assert bench.sent[-1][0] == begin + CYCLE
    # What comes after all is sent at once, and not taken for the answer.
    bench.decide(80, 0.0, 0.0)
    assert command(bench.sent[-1][1]) == (0.0, 0.0)
    assert bench.told[-1].answers is None


def test_a_decision_holds_for_some_cycles_and_not_for_ever() -> None:
    bench = Bench(roams=False)
    bench.drive(range(80))
    for time in range(80, 120):
        bench.hear(measures(time))
        bench.pass_time(bench.now + CYCLE)
    commands = [command(actions) for _, actions in bench.sent[80:]]
    assert commands[:3] == [(0.1, 0.1), (0.06, 0.06), (0.06, 0.06)]
    assert set(commands[3:]) == {(0.0, 0.0)}


def test_a_robot_that_roams_goes_on_by_its_sensors() -> None:
    bench = Bench()
    for time in range(30):
        bench.hear(measures(time))
        bench.pass_time(bench.now + CYCLE)
    assert [answer.answers for answer in bench.told] == list(range(30))
    assert all(0.0 < answer.command[0] <= 0.1 for answer in bench.told)


@pytest.mark.parametrize("pace", [0.01, 1.0, 3.0])
def test_a_simulator_in_lockstep_is_answered_by_decisions_only_at_any_pace(pace: float) -> None:
    bench = Bench(lockstep=True)
    for time in range(10):
        bench.hear(measures(time), after=pace * CYCLE)
        assert math.isinf(bench.answerer.due)
        bench.decide(time, 0.15, -0.15)
    assert [command(actions) for _, actions in bench.sent] == [(0.15, -0.15)] * 10


@pytest.mark.parametrize("pace", [0.01, 3.0])
def test_a_simulator_that_shows_another_pace_is_taken_to_wait(pace: float) -> None:
    bench = Bench()
    for time in range(10):
        bench.hear(measures(time), after=pace * CYCLE)
        assert math.isinf(bench.answerer.due) is (time >= 3)  # real time, as the real one, until then
        bench.decide(time, 0.05, 0.05)
    assert [command(actions) for _, actions in bench.sent] == [(0.05, 0.05)] * 10


def test_of_messages_that_come_together_the_newest_is_answered_and_the_rest_counted() -> None:
    bench = Bench()
    bench.drive(range(20))
    bench.hear(*(measures(time) for time in range(20, 24)), after=3.0 * CYCLE)
    bench.decide(23, 0.1, 0.1)
    assert (bench.told[-1].answers, bench.told[-1].overtaken) == (23, 3)
    exchange = Exchange(PARAMETERS)
    exchange.is_relayed = True
    for answer in bench.told:
        exchange.relayed(answer)
    assert exchange.unanswered == 3
    assert exchange.answered == {*range(20), 23}
    assert exchange.command_in_effect(bench.now + 1.0) == bench.told[-1].command == (0.06, 0.06)


def test_a_robot_that_is_not_heard_is_stopped_again_and_again() -> None:
    bench = Bench()
    bench.drive(range(20))
    bench.pass_time(bench.now + 10.0 * CYCLE)
    stops = [answer for answer in bench.told if answer.stop]
    assert len(stops) >= 6
    assert [command(actions) for _, actions in bench.sent[-len(stops) :]] == [(0.0, 0.0)] * len(stops)


def test_requested_sensors_are_requested_by_every_answer() -> None:
    bench = Bench(parameters=Parameters(sim_time=0, compass_requestable=True, requests_per_cycle=1))
    bench.drive(range(5))
    bench.hear(measures(5))
    bench.pass_time(bench.now + CYCLE)
    assert {actions.requests for _, actions in bench.sent} == {("Compass",)}


@pytest.mark.parametrize("late", [2, 4, 8])
def test_the_later_answers_were_the_slower_a_robot_drives_towards_a_wall(late: int) -> None:
    free = 0.6  # units
    bench = Bench(roams=False)
    bench.drive(range(80))
    bench.hear(measures(79 + late, (1.0 / free, 0.6, 0.6, 0.3)), after=(late - 1) * CYCLE)
    bench.decide(79 + late, 0.15, 0.15)
    left, right = bench.told[-1].command
    assert left == right
    assert left > 0.0
    # The wheels run on from the last command, and this one may act for longer than the last one did.
    assert 0.1 + (late + 1) * left < free
    before = Bench(roams=False)
    before.drive(range(80))
    before.hear(measures(80, (1.0 / free, 0.6, 0.6, 0.3)))
    before.decide(80, 0.15, 0.15)
    assert before.told[-1].command == (0.15, 0.15)


def test_lateness_is_forgotten_little_by_little() -> None:
    reflex = Reflex(ANGLES, 0.1, cruise=0.1, roams=False)
    reflex.answered(6.0)
    assert reflex.cycles > 10.0
    lateness = []
    for _ in range(300):
        reflex.answered(1.0)
        lateness.append(reflex.cycles)
    assert lateness == sorted(lateness, reverse=True)
    assert lateness[50] > 3.0
    assert lateness[-1] < 1.1


def test_a_collision_that_the_decision_did_not_know_of_stops_the_robot() -> None:
    bench = Bench(roams=False)
    bench.drive(range(80))
    bench.hear(measures(80, collision=True))
    bench.pass_time(bench.now + CYCLE)
    assert sum(bench.told[-1].command) <= 0.0


def roam(lab_name: str, seed: int, cycles: int, delay: Callable[[random.Random], float]) -> tuple[int, float]:
    """Drive by the sensors alone, the process having its turns late; return collisions and units driven."""
    simulation = Simulation(read_lab(find_lab(lab_name)), read_grid(find_grid(lab_name)), PARAMETERS, seed)
    robot = simulation.register(RobotRegistration(name="r", sensor_angles=tuple(enumerate(ANGLES))))
    assert robot is not None
    chance, bench, waiting, free_at = random.Random(seed), Bench(), [], 0
    heard, collisions, driven = simulation.launch()[robot], 0, 0.0
    for cycle in range(cycles):
        waiting.append(Arrival(encode(heard), 100.0 + CYCLE * cycle))
        before, sent = simulation.poses()[0].copy(), len(bench.sent)
        if cycle >= free_at:
            cycles_late = delay(chance)
            free_at = cycle + int(cycles_late)
            if cycles_late < 1.0:
                bench.now = 100.0 + CYCLE * (cycle + cycles_late)
                bench.answerer.take(waiting, bench.now)
                waiting = []
                bench.pass_time(100.0 + CYCLE * (cycle + 0.99))
        acts = [actions for _, actions in bench.sent[sent:]]
        heard = simulation.step({robot: acts[-1]} if acts else {})[robot]
        collisions += bool(heard.collision)
        driven += math.dist(simulation.poses()[0][:2], before[:2])
    return collisions, driven


@pytest.mark.parametrize("late", [0.0, 0.03], ids=["in-time", "late-now-and-then"])
@pytest.mark.parametrize("lab_name", ["maze", "corridors", "rooms", "standard"])
def test_a_robot_without_any_decision_drives_and_does_not_collide(lab_name: str, late: float) -> None:
    def delay(chance: random.Random) -> float:
        return chance.uniform(1.0, 2.5) if chance.random() < late else 0.05

    outcomes = [roam(lab_name, seed, 240, delay) for seed in range(1, 6)]
    assert [collisions for collisions, _ in outcomes] == [0] * 5
    assert min(driven for _, driven in outcomes) > 3.0


@pytest.mark.parametrize(
    ("seed", "late", "cycles"),
    [
        (1014, 0.03, 2.5),
        (1019, 0.05, 6.0),
        (1013, 0.2, 4.0),
        (1021, 0.02, 12.0),
        (1007, 0.1, 2.5),
        (1024, 0.1, 2.5),
        (2011, 0.0, 2.5),
        (2007, 0.03, 2.5),
        (2041, 0.1, 4.0),
    ],
)
def test_the_end_of_a_thin_wall_between_two_cones_is_not_driven_into(
    seed: int, late: float, cycles: float
) -> None:
    """Runs that met it, or came near it, whether answers were late or not, before the robot remembered."""

    def delay(chance: random.Random) -> float:
        return chance.uniform(1.0, cycles) if chance.random() < late else 0.05

    assert roam("maze", seed, 240, delay)[0] == 0
