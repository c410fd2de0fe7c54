from __future__ import annotations

import copy
import csv
import doctest
import gzip
import math
from dataclasses import replace

import numpy as np
import pytest

import simulator_stub.simulation
from ciberrato.files.lab import read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import ideal_reading, other_robot_distance, sensor_distances
from ciberrato.protocol import (
    Actions,
    Measures,
    RobotBeaconRegistration,
    RobotRegistration,
)
from ciberrato.world.lab import Beacon, Lab, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation
from simulator_stub.world.floor import Floor
from simulator_stub.world.simulator_state import SimulatorState
from tests.recordings import OWN

AHEAD = Actions(left_motor=0.1, right_motor=0.1)


def buttons(measures: Measures) -> tuple[int, bool, bool]:
    return measures.time, measures.start, measures.stop


def test_buttons_and_time_through_a_run_as_the_real_simulator_showed_them(
    open_lab: Lab, three_places: StartGrid, quiet: Parameters
) -> None:
    simulation = Simulation(open_lab, three_places, replace(quiet, sim_time=5))
    robot = simulation.register(RobotRegistration())
    assert robot == 1
    seen = []
    for command in (None, None, "start", None, None, "stop", None, None, "start", None, None, None, None):
        if command == "start":
            simulation.start()
        elif command == "stop":
            simulation.stop()
        seen.append(buttons(simulation.step()[robot]))
    assert seen == [
        (0, False, True),
        (0, False, True),
        (0, True, False),
        (1, True, False),
        (2, True, False),
        (3, False, True),  # the cycle that reads Stop still runs
        (3, False, True),
        (3, False, True),
        (3, True, False),
        (4, True, False),
        (5, True, False),
        (5, False, False),
        (5, False, False),
    ]
    assert simulation.state is SimulatorState.FINISHED


def test_a_start_before_the_first_cycle_is_over_is_lost(open_lab: Lab, three_places: StartGrid) -> None:
    simulation = Simulation(open_lab, three_places)
    simulation.register(RobotRegistration())
    simulation.start()
    simulation.step()
    assert simulation.state is SimulatorState.STOPPED


def test_a_run_of_unlimited_time_does_not_end(open_lab: Lab, three_places: StartGrid) -> None:
    simulation = Simulation(open_lab, three_places, Parameters(sim_time=0))
    simulation.register(RobotRegistration())
    simulation.launch()
    for _ in range(20):
        simulation.step()
    assert simulation.time == 20
    assert simulation.state is SimulatorState.RUNNING


def test_who_may_register(open_lab: Lab, three_places: StartGrid) -> None:
    simulation = Simulation(open_lab, three_places)

    def register(place: int) -> int | None:
        return simulation.register(RobotRegistration(robot_id=place))

    assert register(2) == 2
    assert register(2) is None, "taken"
    assert register(4) is None, "not in the grid"
    assert register(-1) == 1, "0 and below are the first free place"
    simulation.launch()
    assert register(3) is None, "not while running"
    simulation.remove(2)
    simulation.stop()
    simulation.step()
    assert register(2) is None, "a removed robot keeps its place"
    assert register(0) == 3
    assert register(0) is None, "full"
    simulation.reset()
    assert register(2) == 2


def test_robot_beacons_only_where_the_lab_has_no_beacon(three_places: StartGrid) -> None:
    registration = RobotBeaconRegistration(robot_id=1, height=4.0)
    assert Simulation(Lab(), three_places).register(registration) == 1
    assert Simulation(Lab(beacons=(Beacon(),)), three_places).register(registration) is None


def test_robots_start_on_their_positions(open_lab: Lab, three_places: StartGrid) -> None:
    simulation = Simulation(open_lab, three_places)
    for _ in range(3):
        simulation.register(RobotRegistration())
    np.testing.assert_array_equal(
        simulation.poses(),
        [(3.0, 5.0, 0.0), (8.0, 5.0, math.pi / 2), (12.0, 5.0, 225.0 * math.pi / 180.0)],
    )


def test_what_a_message_does_not_mention_stays(open_lab: Lab, three_places: StartGrid) -> None:
    simulation = Simulation(open_lab, three_places)
    robot = simulation.register(RobotRegistration())
    assert robot is not None
    simulation.launch()
    first = Actions(left_motor=0.1, right_motor=0.9, end_led=False, visiting_led=True)
    simulation.step({robot: [first, Actions(left_motor=-0.3), Actions(returning_led=True)]})
    record = simulation.robots[0]
    assert (record.left_command, record.right_command) == (-0.15, 0.15)
    assert (record.end_led, record.returning_led, record.visiting_led) == (False, True, True)
    measures = simulation.step()[robot]
    assert (record.left_command, record.right_command) == (-0.15, 0.15)
    assert (measures.end_led, measures.returning_led, measures.visiting_led) == (False, True, True)


def test_a_motor_command_that_is_no_number_is_refused(open_lab: Lab, three_places: StartGrid) -> None:
    simulation = Simulation(open_lab, three_places)
    robot = simulation.register(RobotRegistration())
    assert robot is not None
    with pytest.raises(ValueError, match="NaN"):
        simulation.step({robot: Actions(left_motor=math.nan)})


def test_the_end_led_stops_a_robot_one_cycle_later_and_for_good(
    open_lab: Lab, three_places: StartGrid, quiet: Parameters
) -> None:
    simulation = Simulation(open_lab, three_places, quiet)
    robot = simulation.register(RobotRegistration())
    assert robot is not None
    simulation.launch()
    simulation.step({robot: AHEAD})
    simulation.step({robot: Actions(end_led=True)})
    pose = simulation.poses()
    assert pose[0, 0] == pytest.approx(3.0 + 0.05 + 0.075), "the cycle that reads it still moves"
    simulation.step({robot: Actions(end_led=False, left_motor=0.15)})
    np.testing.assert_array_equal(simulation.poses(), pose)
    assert simulation.statuses()[0].state == "Finished"


def test_motors_are_kept_through_a_pause(open_lab: Lab, three_places: StartGrid, quiet: Parameters) -> None:
    through, paused = (Simulation(open_lab, three_places, quiet) for _ in range(2))
    for simulation in (through, paused):
        simulation.register(RobotRegistration())
        simulation.launch()
        simulation.step({1: AHEAD})
    paused.stop()
    for simulation in (through, paused):
        simulation.step()
    for _ in range(5):
        paused.step()
    paused.start()
    paused.step()
    for simulation in (through, paused):
        simulation.step()
    np.testing.assert_array_equal(through.poses(), paused.poses())
    assert through.time == paused.time == 3


def test_a_removed_robot_gets_nothing_and_is_in_nobodys_way(open_lab: Lab, quiet: Parameters) -> None:
    close = StartGrid(positions=(GridPosition(x=5.0, y=5.0), GridPosition(x=6.2, y=5.0)))
    simulation = Simulation(open_lab, close, quiet)
    simulation.register(RobotRegistration())
    simulation.register(RobotRegistration())
    simulation.launch()
    for _ in range(4):
        measures = simulation.step({1: AHEAD})
    assert measures[1].collision
    simulation.remove(2)
    assert set(simulation.step()) == {1, 2}, "the cycle that removes it still serves it"
    for _ in range(10):
        measures = simulation.step()
    assert set(measures) == {1}
    assert not measures[1].collision
    assert simulation.poses()[0, 0] > 6.0
    assert [status.state for status in simulation.statuses()] == ["Running", "Removed"]


def test_a_robot_that_touches_a_wall_stays_but_turns(quiet: Parameters) -> None:
    lab = Lab(width=10.0, height=10.0)
    grid = StartGrid(positions=(GridPosition(x=9.45, y=5.0),))
    simulation = Simulation(lab, grid, quiet)
    simulation.register(RobotRegistration())
    simulation.launch()
    for _ in range(2):
        measures = simulation.step({1: Actions(left_motor=0.1, right_motor=0.14)})
        assert measures[1].collision, "9.45 + 0.06 is beyond 9.5"
    np.testing.assert_allclose(simulation.poses(), [(9.45, 5.0, 0.02 + 0.03)])
    assert simulation.robots[0].collisions == 1, "only beginnings count"


def test_other_robots_are_seen_through_walls_as_in_the_recordings() -> None:
    walls = WallMap.from_lab(read_lab(OWN / "ir/other_robots.lab.xml"))
    with gzip.open(OWN / "ir/other_robots.csv.gz", "rt") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) >= 2000
    for row in rows:
        x, y, other_x, other_y = (float(row[name]) for name in ("x1", "y1", "x2", "y2"))
        heading = float(row["dir1_deg"]) * math.pi / 180.0
        direction = heading + float(row["sensor_angle_deg"]) / 180.0 * math.pi
        distance = min(
            float(sensor_distances(walls, x, y, direction)),
            other_robot_distance(x, y, direction, other_x, other_y),
        )
        assert float(ideal_reading(distance)) == pytest.approx(float(row["ideal_with_other"]), abs=1e-9)


def drive(simulation: Simulation, cycles: int, *, idle: int = 0) -> list[dict[int, Measures]]:
    simulation.step()
    for _ in range(idle):
        simulation.step()
    simulation.start()
    simulation.step()
    return [simulation.step({1: AHEAD}) for _ in range(cycles)]


def test_the_same_seed_gives_the_same_run_and_another_seed_another(
    open_lab: Lab, three_places: StartGrid
) -> None:
    runs = []
    for seed in (5, 5, 6):
        simulation = Simulation(open_lab, three_places, seed=seed)
        simulation.register(RobotRegistration())
        runs.append((drive(simulation, 300), simulation.poses().tolist()))
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


def test_a_generator_may_be_given_instead_of_a_seed(open_lab: Lab, three_places: StartGrid) -> None:
    poses = []
    for seed in (5, np.random.default_rng(5)):
        simulation = Simulation(open_lab, three_places, seed=seed)
        simulation.register(RobotRegistration())
        drive(simulation, 10)
        poses.append(simulation.poses().tolist())
    assert poses[0] == poses[1]


def test_how_long_robots_waited_for_start_does_not_change_their_run(
    open_lab: Lab, three_places: StartGrid
) -> None:
    runs = []
    for idle in (0, 7, 400):
        simulation = Simulation(open_lab, three_places, seed=5)
        simulation.register(RobotRegistration())
        runs.append(drive(simulation, 50, idle=idle))
    assert runs[0] == runs[1] == runs[2]


def test_the_noise_of_one_sensor_does_not_depend_on_the_others(
    open_lab: Lab, three_places: StartGrid
) -> None:
    runs = []
    for parameters in (
        Parameters(),
        Parameters(compass_sensor=False, line_sensor_true_probability=1.0, motors_noise=1.5),
    ):
        simulation = Simulation(open_lab, three_places, parameters, seed=5)
        simulation.register(RobotRegistration())
        runs.append([measures[1].infrared for measures in drive(simulation, 50)])
    assert runs[0] == runs[1]


def test_robots_have_noise_of_their_own_whoever_else_is_there(open_lab: Lab) -> None:
    far = StartGrid(
        positions=(GridPosition(x=2.0, y=2.0), GridPosition(x=18.0, y=8.0), GridPosition(x=2.0, y=2.0))
    )
    compasses = []
    for order in ((1,), (1, 2), (2, 1)):
        simulation = Simulation(open_lab, far, seed=5)
        for place in order:
            simulation.register(RobotRegistration(robot_id=place))
        run = drive(simulation, 50)
        compasses.append([measures[1].compass for measures in run])
        if 2 in order:
            assert [measures[2].compass for measures in run] != compasses[-1]
    assert compasses[0] == compasses[1] == compasses[2]


def test_a_reset_begins_again_with_other_noise(open_lab: Lab, three_places: StartGrid) -> None:
    simulation = Simulation(open_lab, three_places, seed=5)
    runs = []
    for _ in range(2):
        simulation.register(RobotRegistration())
        runs.append(drive(simulation, 50))
        simulation.reset()
        assert (simulation.time, simulation.robots) == (0, ())
        assert simulation.state is SimulatorState.READY
    assert runs[0] != runs[1]


def test_a_copy_goes_on_as_the_original_does(open_lab: Lab, three_places: StartGrid) -> None:
    simulation = Simulation(open_lab, three_places, seed=5)
    simulation.register(RobotRegistration())
    drive(simulation, 300)
    twin = copy.deepcopy(simulation)
    assert twin.world is simulation.world
    ahead = [simulation.step() for _ in range(300)]
    assert [twin.step() for _ in range(300)] == ahead


def test_noise_has_the_size_that_the_parameters_say(open_lab: Lab, three_places: StartGrid) -> None:
    parameters = Parameters(
        sim_time=0, compass_noise=3.0, obstacle_noise=0.5, line_sensor_true_probability=0.9
    )
    simulation = Simulation(open_lab, three_places, parameters, seed=11)
    simulation.register(RobotRegistration())
    simulation.launch()
    n = 4000
    measured = [simulation.step()[1] for _ in range(n)]
    compass = np.array([measures.compass for measures in measured])
    infrared = np.array([measures.infrared for measures in measured])
    line = np.array([[int(element) for element in measures.line or ""] for measures in measured])
    # Four standard errors. Rounding adds a variance of 1/12 of its step squared.
    spread = math.sqrt(9.0 + 1 / 12)
    assert compass.mean() == pytest.approx(0.0, abs=4 * spread / math.sqrt(n))
    assert compass.std() == pytest.approx(spread, rel=4 / math.sqrt(2 * n))
    spread = math.sqrt(0.25 + 0.01 / 12)
    walls = WallMap.from_lab(open_lab)
    ideal = ideal_reading(sensor_distances(walls, 3.0, 5.0, np.radians([0.0, 60.0, -60.0, 180.0])))
    np.testing.assert_allclose(infrared.mean(axis=0), ideal, atol=4 * spread / math.sqrt(n))
    np.testing.assert_allclose(infrared.std(axis=0), spread, rtol=4 / math.sqrt(2 * n))
    assert (infrared < 0.0).any(), "readings are not clamped"
    correlation = np.corrcoef(np.column_stack((compass, infrared)), rowvar=False) - np.eye(5)
    assert abs(correlation).max() < 4.5 / math.sqrt(n)
    np.testing.assert_allclose(line.mean(axis=0), 0.1, atol=4 * math.sqrt(0.09 / n))


def test_the_motor_factor_is_drawn_for_each_wheel_and_cycle() -> None:
    lab = Lab(width=2000.0, height=2000.0)
    grid = StartGrid(positions=(GridPosition(x=1000.0, y=1000.0),))
    simulation = Simulation(lab, grid, Parameters(sim_time=0, motors_noise=4.0), seed=3)
    simulation.register(RobotRegistration())
    simulation.launch()
    previous = (0.0, 0.0)
    factors = []
    for _ in range(4000):
        simulation.step({1: AHEAD})
        robot = simulation.robots[0]
        outputs = (robot.left_output, robot.right_output)
        factors.append([2.0 * new / (0.1 + old) for new, old in zip(outputs, previous, strict=True)])
        previous = outputs
    drawn = np.array(factors)
    np.testing.assert_allclose(drawn.mean(axis=0), 1.0, atol=4 * 0.04 / math.sqrt(4000))
    np.testing.assert_allclose(drawn.std(axis=0), 0.04, rtol=4 / math.sqrt(8000))
    assert abs(np.corrcoef(drawn[:, 0], drawn[:, 1])[0, 1]) < 4 / math.sqrt(4000)
    assert abs(np.corrcoef(drawn[1:, 0], drawn[:-1, 0])[0, 1]) < 4 / math.sqrt(4000)


def test_what_is_requestable_is_sent_only_when_asked_for(open_lab: Lab, three_places: StartGrid) -> None:
    parameters = Parameters(
        requests_per_cycle=3,
        obstacle_requestable=True,
        compass_requestable=True,
        ground_requestable=True,
    )
    simulation = Simulation(open_lab, three_places, parameters)
    simulation.register(RobotRegistration())
    measures = simulation.step()[1]
    assert (measures.compass, measures.ground, measures.infrared) == (None, None, (None,) * 4)
    assert measures.collision is not None
    asked = Actions(requests=("IRSensor2", "Nonsense", "Collision", "Compass", "Ground"))
    measures = simulation.step({1: asked})[1]
    assert measures.compass is not None
    assert [reading is None for reading in measures.infrared] == [True, True, False, True]
    assert measures.ground is None, "Collision, though always sent, used up a request"
    assert simulation.step()[1].compass is None, "a request lasts one cycle"


def test_latency_delivers_old_readings(open_lab: Lab, three_places: StartGrid, quiet: Parameters) -> None:
    parameters = replace(quiet, compass_latency=3, obstacle_latency=2, ground_latency=1)
    late, prompt = (Simulation(open_lab, three_places, each) for each in (parameters, quiet))
    turn = Actions(left_motor=-0.1, right_motor=0.1)
    records: list[list[Measures]] = [[], []]
    for simulation, record in zip((late, prompt), records, strict=True):
        simulation.register(RobotRegistration(robot_id=2))
        record.append(simulation.step()[2])
        simulation.start()
        record.extend(simulation.step({2: turn})[2] for _ in range(20))
    assert [measures.compass for measures in records[0][:3]] == [0.0] * 3
    assert [measures.infrared for measures in records[0][:2]] == [(0.0,) * 4] * 2
    assert [m.compass for m in records[0][3:]] == [m.compass for m in records[1][:-3]]
    assert [m.infrared for m in records[0][2:]] == [m.infrared for m in records[1][:-2]]


def test_the_last_of_overlapping_targets_is_reported(quiet: Parameters, open_lab: Lab) -> None:
    # Target 0: radius 2 around x = 15; target 1: radius 1 around 15.5. The robot must be inside entirely.
    expected = {13.4: -1, 13.5: 0, 14.9: 0, 15.0: 1, 16.0: 1, 16.1: 0, 16.5: 0, 16.6: -1}
    for x, target in expected.items():
        simulation = Simulation(open_lab, StartGrid(positions=(GridPosition(x=x, y=5.0),)), quiet)
        simulation.register(RobotRegistration())
        assert simulation.step()[1].ground == target


def test_lines_and_walls_are_seen_on_the_floor_but_not_the_border(quiet: Parameters) -> None:
    line = Wall(height=0.0, corners=((4.0, 3.9), (8.0, 3.9), (8.0, 4.1), (4.0, 4.1)))
    wall = Wall(height=2.0, corners=((4.0, 7.9), (8.0, 7.9), (8.0, 8.1), (4.0, 8.1)))
    lab = Lab(width=20.0, height=20.0, walls=(line, wall))
    floor, walls = Floor(lab), WallMap.from_lab(lab)
    points = np.random.default_rng(0).uniform(3.0, 9.0, (2000, 2))
    marked = [floor.is_marked(x, y) for x, y in points]
    assert marked == walls.point_in_polygons(points[:, 0], points[:, 1]).tolist()
    assert 10 < sum(marked) < 200
    readings = []
    poses = ((5.0, 4.0, 0.0), (5.0, 3.92, 0.0), (5.0, 4.08, 180.0), (5.0, 8.0, 0.0), (19.9, 9.0, 0.0))
    for x, y, direction in poses:
        grid = StartGrid(positions=(GridPosition(x=x, y=y, direction_deg=direction),))
        simulation = Simulation(lab, grid, quiet)
        simulation.register(RobotRegistration())
        readings.append(simulation.step()[1].line)
    assert readings == ["0011100", "0111000", "0111000", "0011100", "0000000"]


def test_the_example_in_the_documentation_of_the_class() -> None:
    failures, tried = doctest.testmod(simulator_stub.simulation)
    assert tried >= 7
    assert failures == 0
