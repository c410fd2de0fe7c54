"""GPS, beacons, score sensor, hearing, and requests: what the recordings do not show alone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ciberrato.infrared.model import distances_at, ideal_reading, other_robot_distance, round_reading
from ciberrato.protocol import Actions, HeardMessage, Measures, RobotBeaconRegistration, RobotRegistration
from ciberrato.world.lab import Beacon, Lab, Target, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation


def at(*poses: tuple[float, float, float]) -> StartGrid:
    return StartGrid(positions=tuple(GridPosition(x=x, y=y, direction_deg=d) for x, y, d in poses))


def simulate(
    lab: Lab, grid: StartGrid, parameters: Parameters, seed: int = 1
) -> tuple[Simulation, dict[int, Measures]]:
    simulation = Simulation(lab, grid, parameters, seed)
    for _ in grid.positions:
        simulation.register(RobotRegistration())
    return simulation, simulation.launch()


# --- GPS ---------------------------------------------------------------------------------------------


def test_the_gps_adds_a_constant_offset_that_the_seed_decides(open_lab: Lab, quiet: Parameters) -> None:
    parameters = replace(quiet, gps=True)
    offsets = set()
    for seed in range(20):
        simulation, first = simulate(open_lab, at((3, 5, 0), (8.04, 5, 90)), parameters, seed)
        x, y = simulation.gps_offset
        offsets.add((x, y))
        assert 0 <= x < 1000
        assert 0 <= y < 1000
        after = simulation.step({1: Actions(left_motor=0.1, right_motor=0.1)})
        for measures, place in ((first[1], 3.0), (first[2], 8.04), (after[1], 3.05)):
            expected = (math.floor((place + x) * 10 + 0.5) / 10, math.floor((5 + y) * 10 + 0.5) / 10)
            assert measures.gps == expected
        simulation.reset()
        assert simulation.gps_offset != (x, y)
    assert len(offsets) == 20
    assert Simulation(open_lab, at((3, 5, 0)), parameters, 1).gps_offset == (
        Simulation(open_lab, at((3, 5, 0)), parameters, 1).gps_offset
    )


def test_the_gps_offset_can_be_set(open_lab: Lab, quiet: Parameters) -> None:
    simulation = Simulation(open_lab, at((3, 5, 0)), replace(quiet, gps=True))
    simulation.gps_offset = (840.1877, 394.3829)
    simulation.register(RobotRegistration())
    assert simulation.step()[1].gps == (843.2, 399.4)


# --- beacons -----------------------------------------------------------------------------------------


def test_a_beacon_is_seen_unless_a_wall_at_least_as_high_stands_before_it(quiet: Parameters) -> None:
    rng = np.random.default_rng(5)
    walls = []
    for _ in range(12):
        x, y, width, height = rng.uniform((1, 1, 0.2, 0.2), (18, 8, 1.5, 1.5))
        corners = ((x, y), (x + width, y), (x + width, y + height), (x, y + height))
        walls.append(Wall(height=float(rng.choice([0.0, 1.0, 2.0, 3.0])), corners=corners))
    beacons = tuple(Beacon(x=rng.uniform(0, 20), y=rng.uniform(0, 10), height=h) for h in (0.5, 1, 2, 2.5, 5))
    # One outside: the border, 4 high, hides it if it is not higher.
    beacons += (Beacon(x=25, y=5, height=4), Beacon(x=25, y=5, height=4.5))
    lab = Lab(width=20, height=10, walls=tuple(walls), beacons=beacons)
    poses = rng.uniform((0.5, 0.5, -180), (19.5, 9.5, 180), (60, 3))
    seen = hidden = 0
    for x, y, direction in poses.tolist():
        _, measures = simulate(lab, at((x, y, direction)), replace(quiet, beacon_sensor=True))
        assert [reading.beacon for reading in measures[1].beacons] == list(range(len(beacons)))
        for beacon, reading in zip(beacons, measures[1].beacons, strict=True):
            high = [w for w in (lab.border, *walls) if w.height >= beacon.height]
            if any(crosses((x, y), (beacon.x, beacon.y), wall) for wall in high):
                assert reading.bearing is None
                hidden += 1
            else:
                angle = math.degrees(math.atan2(beacon.y - y, beacon.x - x)) - direction
                assert reading.bearing is not None
                assert (reading.bearing - angle + 180) % 360 - 180 == pytest.approx(0, abs=0.5 + 1e-9)
                assert -180 <= reading.bearing <= 180
                seen += 1
    assert min(seen, hidden) > 50


def crosses(a: tuple[float, float], b: tuple[float, float], wall: Wall) -> bool:
    """Sample the line of sight against the wall's sides, densely enough for random places."""
    ends = list(zip(wall.corners, wall.corners[1:] + wall.corners[:1], strict=True))
    for c, d in ends:
        m = np.array([[b[0] - a[0], c[0] - d[0]], [b[1] - a[1], c[1] - d[1]]])
        if abs(np.linalg.det(m)) < 1e-12:
            continue
        s, t = np.linalg.solve(m, np.array([c[0] - a[0], c[1] - a[1]]))
        if 0 <= s < 1 and 0 <= t <= 1:
            return True
    return False


def test_beyond_the_aperture_a_beacon_is_not_seen_and_noise_counts(quiet: Parameters) -> None:
    lab = Lab(width=20, height=10, beacons=(Beacon(x=10 + 5, y=5, height=2),))
    parameters = replace(quiet, beacon_sensor=True, beacon_aperture=math.radians(30))

    def bearing(direction: float) -> float | None:
        return simulate(lab, at((10, 5, direction)), parameters)[1][1].beacons[0].bearing

    assert [bearing(d) for d in (0, 29.9, -29.9, 30.1, -30.1, 180)] == [0, -30, 30, None, None, None]
    simulation, _ = simulate(lab, at((10, 5, 30)), replace(parameters, beacon_noise=2.0))
    readings = [simulation.step()[1].beacons[0].bearing for _ in range(2000)]
    assert sum(reading is None for reading in readings) == pytest.approx(1000, abs=4 * math.sqrt(500))
    assert min(reading for reading in readings if reading is not None) == -30


def test_on_the_beacon_its_absolute_bearing_is_straight_down(quiet: Parameters) -> None:
    lab = Lab(width=20, height=10, beacons=(Beacon(x=10, y=5, height=2),))
    _, measures = simulate(lab, at((10, 5, 30)), replace(quiet, beacon_sensor=True))
    assert measures[1].beacons[0].bearing == -120


def test_beacons_late_are_not_visible_at_first(quiet: Parameters) -> None:
    lab = Lab(width=20, height=10, beacons=(Beacon(x=15, y=5, height=2),))
    simulation = Simulation(lab, at((10, 5, 0)), replace(quiet, beacon_sensor=True, beacon_latency=3))
    simulation.register(RobotRegistration())
    assert [simulation.step()[1].beacons[0].bearing for _ in range(5)] == [None, None, None, 0, 0]


def test_a_carried_beacon_is_for_robots_that_come_later(quiet: Parameters) -> None:
    lab = Lab(width=20, height=10)
    simulation = Simulation(
        lab, at((3, 5, 0), (6, 5, 0), (9, 5, 0), (12, 5, 0)), replace(quiet, beacon_sensor=True)
    )
    simulation.register(RobotRegistration())
    assert simulation.register(RobotBeaconRegistration(height=5.0)) == 2
    simulation.register(RobotRegistration())
    assert simulation.register(RobotBeaconRegistration(height=5.0)) is None, "there is a beacon now"
    measures = simulation.step()
    assert [len(measures[robot].beacons) for robot in (1, 2, 3)] == [0, 0, 1]
    angle = measures[3].beacons[0].bearing
    assert angle == math.floor(math.degrees(math.atan2(-5, -9)) + 0.5), "it stays at the origin"
    assert simulation.lab_shown().beacons == (Beacon(height=5.0),)
    assert simulation.acceptance().n_beacons == 0
    simulation.reset()
    assert simulation.lab_shown().beacons == ()
    assert simulation.register(RobotBeaconRegistration(height=5.0)) == 1


# --- score -------------------------------------------------------------------------------------------


def test_the_score_sensor_tells_what_views_are_told(open_lab: Lab, quiet: Parameters) -> None:
    simulation, measures = simulate(open_lab, at((15.4, 5, 0)), replace(quiet, score_sensor=True))
    seen = []
    for cycle in range(6):
        simulation.begin_cycle()
        simulation.act(1, Actions(visiting_led=cycle == 2))
        measures = simulation.advance()
        (status,) = simulation.statuses()
        simulation.end_cycle()
        score = measures[1].score
        assert score is not None
        assert (score.score, score.visited_mask, score.arrival_time, score.collisions, score.collision) == (
            status.score,
            status.visited_mask,
            status.arrival_time,
            status.collisions,
            status.collision,
        )
        seen.append(score.visited_mask)
    assert seen == ["00", "00", "10", "10", "10", "10"], "of two targets the first counts"


# --- hearing -----------------------------------------------------------------------------------------


def test_what_a_robot_says_is_heard_nearer_than_8_units_by_itself_too(quiet: Parameters) -> None:
    lab = Lab(width=40, height=10)
    simulation, _ = simulate(lab, at((3, 5, 0), (10.99, 5, 0), (11, 5, 0)), quiet)
    heard = simulation.step({1: Actions(say="hello")})
    assert [measures.messages for measures in heard.values()] == [
        (HeardMessage(sender=1, text="hello"),),
        (HeardMessage(sender=1, text="hello"),),
        (),
    ]
    both = simulation.step({3: Actions(say="three"), 2: [Actions(say="zwei"), Actions(say="two")]})
    assert both[2].messages == (HeardMessage(sender=2, text="two"), HeardMessage(sender=3, text="three"))
    assert simulation.step()[1].messages == (), "it lasts one cycle"


def test_distance_is_that_after_the_move(quiet: Parameters) -> None:
    lab = Lab(width=40, height=10)
    simulation, _ = simulate(lab, at((3, 5, 0), (11, 5, 180)), quiet)
    heard = simulation.step({1: Actions(say="a", left_motor=0.1, right_motor=0.1)})
    assert len(heard[2].messages) == 1


def test_long_messages_are_dropped_and_the_one_before_stays(quiet: Parameters) -> None:
    simulation, _ = simulate(Lab(), at((3, 5, 0)), quiet)
    said = simulation.step({1: [Actions(say="x" * 100), Actions(say="y" * 101)]})
    assert said[1].messages == (HeardMessage(sender=1, text="x" * 100),)
    assert simulation.step({1: Actions(say="")})[1].messages == ()


def test_a_removed_robot_is_still_heard_and_hears_nothing(quiet: Parameters) -> None:
    simulation, _ = simulate(Lab(), at((3, 5, 0), (5, 5, 0)), quiet)
    simulation.remove(1)
    simulation.step()
    heard = simulation.step({1: Actions(say="ghost"), 2: Actions(say="boo")})
    assert list(heard) == [2]
    assert [message.text for message in heard[2].messages] == ["ghost", "boo"]


# --- requests ----------------------------------------------------------------------------------------

ASKED_FOR = replace(
    Parameters(),
    requests_per_cycle=3,
    obstacle_requestable=True,
    beacon_requestable=True,
    ground_requestable=True,
    compass_requestable=True,
    collision_requestable=True,
    beacon_sensor=True,
    gps=True,
)


@pytest.mark.parametrize(
    ("asked", "sent"),
    [
        ((), ()),
        (("Compass", "Ground", "Collision"), ("Collision", "Compass", "Ground")),
        (("Compass", "Compass", "Ground", "Collision"), ("Compass", "Ground")),
        (("Nonsense", "Beacon9", "IRSensor2", "Beacon1", "Ground", "Compass"), ("IR2", "Beacon1", "Ground")),
        (("GPS", "LineSensor", "Ground", "Compass"), ("Ground",)),
    ],
)
def test_only_what_was_asked_for_within_the_limit_is_sent(
    asked: tuple[str, ...], sent: tuple[str, ...]
) -> None:
    lab = Lab(beacons=(Beacon(x=1, y=1, height=9), Beacon(x=2, y=2, height=9)), targets=(Target(x=3, y=5),))
    simulation, first = simulate(lab, at((3, 5, 0)), ASKED_FOR)
    assert names(first[1]) == []
    assert names(simulation.step({1: Actions(requests=asked)})[1]) == sorted(sent)
    halves = [Actions(requests=asked[:2]), Actions(requests=asked[2:])]
    assert names(simulation.step({1: halves})[1]) == sorted(sent), "several messages add up"
    assert names(simulation.step()[1]) == [], "a request lasts one cycle"


def names(measures: Measures) -> list[str]:
    assert measures.line is not None
    assert measures.gps is not None
    found = [f"IR{number}" for number, reading in enumerate(measures.infrared) if reading is not None]
    found += [f"Beacon{reading.beacon}" for reading in measures.beacons]
    for name, value in (
        ("Collision", measures.collision),
        ("Compass", measures.compass),
        ("Ground", measures.ground),
    ):
        if value is not None:
            found.append(name)
    return sorted(found)


# --- the log sees everything -------------------------------------------------------------------------


def test_the_log_holds_what_was_not_asked_for() -> None:
    lab = Lab(beacons=(Beacon(x=1, y=1, height=9),))
    parameters = replace(ASKED_FOR, compass_sensor=False, score_sensor=True)
    simulation, measures = simulate(lab, at((3, 5, 90)), parameters)
    measures = simulation.step({1: Actions(say="x", requests=("Compass",))})
    assert measures[1].compass is None, "there is no compass"
    readings = simulation.readings(simulation.robots[0])
    assert readings.compass == pytest.approx(90, abs=10)
    assert None not in readings.infrared
    assert (readings.collision, readings.ground) == (False, -1)
    assert len(readings.beacons) == 1
    assert (readings.gps, readings.line) == (measures[1].gps, measures[1].line)
    assert (readings.messages, readings.score) == ((), None)


def test_ir_among_many_robots_is_the_least_of_walls_and_robots(quiet: Parameters) -> None:
    rng = np.random.default_rng(8)
    seen = 0
    for _ in range(40):
        lab = Lab(width=8, height=6)
        poses = rng.uniform((0.5, 0.5, -180), (7.5, 5.5, 180), (6, 3)).tolist()
        simulation, measures = simulate(lab, at(*map(tuple, poses)), quiet)  # type: ignore[arg-type]
        for robot in simulation.robots:
            directions = [robot.heading + math.radians(angle) for angle in robot.angles]
            walls = distances_at(simulation.world.walls, robot.x, robot.y, directions)
            for sensor, direction in enumerate(directions):
                others = [
                    other_robot_distance(robot.x, robot.y, direction, other.x, other.y)
                    for other in simulation.robots
                    if other is not robot
                ]
                seen += min(others) < walls[sensor]
                expected = round_reading(ideal_reading(min(walls[sensor], *others)))
                assert measures[robot.robot_id].infrared[sensor] == expected
    assert seen > 200
