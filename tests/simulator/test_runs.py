"""Beginning again: Reset, a robot's Reset, several runs, and what is told of each."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ciberrato.errors import UsageError
from ciberrato.protocol import (
    Acceptance,
    Actions,
    Measures,
    Restart,
    RobotRegistration,
    RobotStatus,
    decode_simulator_message,
    encode,
)
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid
from simulator_stub.recording.results import Results
from simulator_stub.service.runs import Runs
from simulator_stub.service.session import Session
from simulator_stub.simulation import Simulation
from simulator_stub.world.simulator_state import SimulatorState

DRIVE = Actions(left_motor=0.1, right_motor=0.12)
RESET = Actions(reset=True)


@pytest.fixture
def noisy() -> Parameters:
    return replace(Parameters(), gps=True, score_sensor=True, compass_latency=2)


@pytest.fixture
def simulation(open_lab: Lab, three_places: StartGrid, noisy: Parameters) -> Simulation:
    simulation = Simulation(open_lab, three_places, noisy, seed=11)
    for _ in range(2):
        simulation.register(RobotRegistration())
    simulation.launch()
    return simulation


def run(simulation: Simulation, cycles: int) -> list[dict[int, Measures]]:
    return [simulation.step({1: DRIVE, 2: DRIVE}) for _ in range(cycles)]


def test_a_robots_reset_puts_all_robots_back_and_starts_again(simulation: Simulation) -> None:
    run(simulation, 30)
    simulation.step({2: Actions(visiting_led=True, end_led=True)})
    simulation.step()
    before, old_offset = simulation.poses().copy(), simulation.gps_offset
    again = simulation.step({1: [DRIVE, RESET, DRIVE]})
    assert list(again) == [1, 2]
    assert [(measures.time, measures.start) for measures in again.values()] == [(0, True)] * 2
    assert simulation.poses()[:, :2].tolist() == [[3.0, 5.0], [8.0, 5.0]]
    assert not (simulation.poses() == before).any(axis=1).all()
    assert simulation.gps_offset != old_offset
    assert not again[2].visiting_led
    assert not again[2].end_led
    assert again[1].compass == 0.0, "late readings are forgotten"
    assert simulation.state is SimulatorState.RUNNING
    moved = simulation.step()
    assert [measures.time for measures in moved.values()] == [1, 1]
    assert simulation.poses()[0, 0] == 3.0, "motors are off, whatever came with the Reset"
    assert [status.state for status in simulation.statuses()] == ["Running", "Running"]
    assert [robot.score for robot in simulation.robots] == [300, 300]


def test_after_a_reset_the_noise_is_another_and_the_same_each_time(simulation: Simulation) -> None:
    twin = copy.deepcopy(simulation)
    first = run(simulation, 20)
    simulation.step({1: RESET})
    second = run(simulation, 20)
    assert run(twin, 20) == first
    twin.step({2: RESET})
    assert run(twin, 20) == second
    assert [m[1].infrared for m in second] != [m[1].infrared for m in first]


def test_a_reset_leads_out_of_the_end_and_of_a_pause(open_lab: Lab, three_places: StartGrid) -> None:
    simulation = Simulation(open_lab, three_places, Parameters(sim_time=3))
    simulation.register(RobotRegistration())
    simulation.launch()
    run_one = [simulation.step({1: DRIVE})[1].time for _ in range(5)]
    assert run_one == [1, 2, 3, 3, 3]
    assert simulation.state is SimulatorState.FINISHED
    assert simulation.step({1: RESET})[1].start
    assert [simulation.step()[1].time for _ in range(2)] == [1, 2]
    simulation.stop()
    simulation.step()
    simulation.step({1: RESET})
    assert simulation.step()[1].time == 1


def test_a_removed_robot_stays_removed(simulation: Simulation) -> None:
    simulation.remove(2)
    simulation.step()
    assert list(simulation.step({1: RESET})) == [1]
    assert list(simulation.step()) == [1]
    assert [status.state for status in simulation.statuses()] == ["Running", "Removed"]


def test_a_reset_with_a_seed_is_a_new_simulation(simulation: Simulation, noisy: Parameters) -> None:
    run(simulation, 5)
    simulation.reset(12)
    fresh = Simulation(simulation.world.lab, simulation.world.grid, noisy, seed=12)
    for one in (simulation, fresh):
        one.register(RobotRegistration())
        one.register(RobotRegistration())
    assert simulation.launch() == fresh.launch()
    assert run(simulation, 20) == run(fresh, 20)


# --- among clients ------------------------------------------------------------------------------------


@pytest.fixture
def lines() -> list[str]:
    return []


@pytest.fixture
def results(tmp_path: Path, lines: list[str]) -> Results:
    return Results(seed=11, scoring=0, path=tmp_path / "result.json", notify=lines.append)


@pytest.fixture
def session(open_lab: Lab, three_places: StartGrid, results: Results) -> Session:
    parameters = Parameters(sim_time=6, cycle_time=1)
    return Session(Simulation(open_lab, three_places, parameters, seed=11), autostart=1, observers=[results])


@pytest.fixture
def join(session: Session, newcomer: Any) -> Callable[[bytes], Any]:
    def join(data: bytes) -> Any:
        client = newcomer()
        session.welcome(client, data)
        session.cycle()
        return client.peer

    return join


ROBOT = encode(RobotRegistration(name="r"))


def decoded(peer: Any) -> list[Any]:
    messages = [decode_simulator_message(data) for data in peer.received]
    peer.received.clear()
    return messages


def test_where_there_is_no_restart_a_robots_reset_changes_nothing(session: Session, join: Any) -> None:
    session._restarts = False
    view, robot = join(b"<View/>"), join(ROBOT)
    for _ in range(3):
        session.cycle()
    time = session.simulation.time
    decoded(view)
    decoded(robot)
    robot.deliver(encode(RESET))
    session.cycle()
    (status,) = decoded(view)
    assert isinstance(status, RobotStatus)
    assert session.simulation.time == time + 1
    assert decoded(robot)[0].time == time + 1


def test_a_robots_reset_sends_restart_to_views_and_keeps_them(session: Session, join: Any) -> None:
    view, robot = join(b"<View/>"), join(ROBOT)
    for _ in range(3):
        session.cycle()
    decoded(view)
    decoded(robot)
    robot.deliver(encode(RESET))
    session.cycle()
    restart, status = decoded(view)
    assert isinstance(restart, Restart)
    assert isinstance(status, RobotStatus)
    assert (status.time, status.state, status.x) == (0, "Stopped", 3.0)
    (measures,) = decoded(robot)
    assert (measures.time, measures.start) == (0, True)
    session.cycle()
    assert decoded(robot)[0].time == 1
    assert decoded(view)[0].state == "Running"


def test_results_are_written_for_each_run_in_which_time_passed(
    session: Session, results: Results, join: Any, lines: list[str], tmp_path: Path
) -> None:
    file = tmp_path / "result.json"
    assert json.loads(file.read_text()) == {"format": 1, "runs": []}
    robot = join(ROBOT)
    session.cycle()
    robot.deliver(encode(DRIVE))
    for _ in range(4):
        session.cycle()
    (mover,) = session.simulation.robots
    place = (mover.x, mover.y, mover.heading_degrees)
    robot.deliver(encode(RESET))
    session.cycle()
    (first,) = json.loads(file.read_text())["runs"]
    assert (first["run"], first["seed"], first["scoring"], first["lab"]) == (1, 11, 0, "open")
    assert (first["time"], first["sim_time"], first["state"]) == (4, 6, "Running")
    (told,) = first["robots"]
    assert (told["x"], told["y"], told["direction"]) == place
    assert (told["id"], told["name"], told["state"], told["score"]) == (1, "r", "Running", 300)
    assert (told["visited"], told["collisions"], told["returning_time"]) == ([], 0, 0)
    assert told["arrival_time"] == 4
    session.close()
    assert results.count == 1, "the second run had not begun"
    assert lines == [
        "run 1: time 4 of 6",
        "robot 1, 'r': running, score 300, targets visited: none, collisions: 0",
    ]


def test_a_result_file_that_cannot_be_written_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be written"):
        Results(seed=1, scoring=0, path=tmp_path / "none/result.json", notify=print)


def test_runs_follow_one_another_with_seeds_counted_up(
    session: Session, results: Results, join: Any, tmp_path: Path
) -> None:
    runs = Runs(session, results, seed=11, count=3)
    noise = []
    for number in range(3):
        robot = join(ROBOT)
        assert runs.go_on()
        assert isinstance(decoded(robot)[0], Acceptance), "everybody registers anew"
        robot.deliver(encode(DRIVE))
        alive = True
        while alive and not robot.closed:
            session.cycle()
            alive = runs.go_on()
        messages = decoded(robot)
        assert messages[-1].time == 6
        assert (messages[-1].start, messages[-1].stop) == (False, False), "the robot sees the end"
        noise.append([message.infrared for message in messages if message.time])
        assert alive == (number < 2)
    session.close()
    text = (tmp_path / "result.json").read_text()
    document = json.loads(text)
    assert text == json.dumps(document, indent=2) + "\n"
    assert [(entry["run"], entry["seed"], entry["state"]) for entry in document["runs"]] == [
        (1, 11, "Finished"),
        (2, 12, "Finished"),
        (3, 13, "Finished"),
    ]
    assert noise[0] != noise[1] != noise[2]


@pytest.mark.parametrize("ending", ["finish", "remove", "close"])
def test_a_run_is_over_when_all_robots_are_done(
    session: Session, results: Results, newcomer: Any, ending: str
) -> None:
    runs = Runs(session, results, seed=11, count=1)
    robots = [newcomer(), newcomer()]
    for robot in robots:
        session.welcome(robot, ROBOT)
    for _ in range(3):
        session.cycle()
        assert runs.go_on()
    robots[0].peer.deliver(encode(Actions(end_led=True)))
    session.cycle()
    assert runs.go_on(), "one is left"
    if ending == "finish":
        robots[1].peer.deliver(encode(Actions(end_led=True)))
    elif ending == "remove":
        session.simulation.remove(2)
    else:
        robots[1].peer.close()
    session.cycle()
    session.cycle()
    assert runs.go_on()
    session.cycle()
    assert not runs.go_on()


def test_without_a_number_of_runs_nothing_ever_ends(session: Session, results: Results, join: Any) -> None:
    runs = Runs(session, results, seed=11, count=0)
    join(ROBOT)
    for _ in range(20):
        session.cycle()
        assert runs.go_on()
    assert session.simulation.state is SimulatorState.FINISHED
