"""Scores: the recorded runs again, and what they do not show, rule by rule."""

from __future__ import annotations

import copy
import gzip
import itertools
import math
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.conformance import scoring
from ciberrato.files.lab import read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import cell_openings
from ciberrato.labs import find_lab
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.world.lab import Beacon, Lab, Target, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.recording.reference_files import ReferenceFiles
from simulator_stub.scoring import SCORINGS
from simulator_stub.scoring.cellmap import CellMap
from simulator_stub.scoring.circuits import Progress
from simulator_stub.scoring.tours import best_tour
from simulator_stub.simulation import Simulation
from simulator_stub.world.robot_state import RobotState
from tests.recordings import GOLDEN, LABS, OWN, needs


def test_recorded_runs_that_come_with_the_tests_give_the_recorded_scores() -> None:
    rows = list(scoring.rows(OWN, None))
    assert [row for row in rows if not row.passed] == []
    assert {row.check: row.cases for row in rows} == {"scoring: mode 0": 902}


@needs("CIBERRATO_GOLDEN", "CIBERRATO_LABS")
def test_all_recorded_runs_give_the_recorded_scores() -> None:
    rows = {row.check: row for row in scoring.rows(GOLDEN, LABS)}
    assert [row for row in rows.values() if not row.passed] == []
    assert all(rows[f"scoring: mode {mode}"].cases > 60 for mode in (0, 1, 2, 3, 5, 6, 7))
    assert rows["scoring: circuits"].cases >= 728
    assert rows["scoring: reference files"].cases >= 152


def test_a_score_that_differs_is_found(tmp_path: Path) -> None:
    shutil.copytree(OWN / "scoring", tmp_path / "scoring")
    path = tmp_path / "scoring/s0_competitive.csv.gz"
    text = gzip.decompress(path.read_bytes()).decode()
    path.write_bytes(gzip.compress(text.replace(",104,1,", ",103,1,", 1).encode()))
    (row,) = scoring.rows(tmp_path, None)
    assert not row.passed
    assert "score 104 not 103" in row.note


# --- rules, one by one ---------------------------------------------------------------------------------

NO_WALLS = Lab(
    width=20.0, height=10.0, targets=(Target(x=3.0, y=5.0, radius=1.5), Target(x=9.0, y=5.0, radius=1.5))
)
BEFORE_TARGETS = StartGrid(positions=(GridPosition(x=3.0, y=5.0), GridPosition(x=9.0, y=5.0)))


def launched(
    lab: Lab, grid: StartGrid, quiet: Parameters, mode: int, robots: int = 1, **changes: int
) -> Simulation:
    simulation = Simulation(lab, grid, replace(quiet, **changes), scoring=mode)
    for _ in range(robots):
        simulation.register(RobotRegistration())
    simulation.launch()
    return simulation


def score_after(simulation: Simulation, **leds: bool) -> int:
    simulation.step({1: Actions(**leds)})
    return simulation.robots[0].score


def test_a_score_shows_from_the_first_running_cycle_on(quiet: Parameters) -> None:
    simulation = launched(NO_WALLS, BEFORE_TARGETS, quiet, 0)
    assert simulation.robots[0].score == 0
    assert score_after(simulation) == 300
    assert simulation.robots[0].arrival_time == 1


def test_a_target_counts_once_and_the_display_is_100_higher_while_the_led_is_on(quiet: Parameters) -> None:
    simulation = launched(NO_WALLS, BEFORE_TARGETS, quiet, 0)
    assert [score_after(simulation, visiting_led=True) for _ in range(3)] == [300, 300, 300]
    assert score_after(simulation, visiting_led=False) == 200
    assert simulation.robots[0].visited == {0}
    assert simulation.robots[0].arrival_time == 0, "it stays what it was before the first visit"


def visit_both(quiet: Parameters, **changes: int) -> Simulation:
    """Drive from the first target to the second, visiting both."""
    simulation = launched(NO_WALLS, BEFORE_TARGETS, quiet, 0, **changes)
    simulation.step({1: Actions(left_motor=0.15, right_motor=0.15, visiting_led=True)})
    simulation.step({1: Actions(visiting_led=False)})
    while simulation.robots[0].x < 9.0:
        simulation.step()
    simulation.step({1: Actions(left_motor=0.0, right_motor=0.0, visiting_led=True)})
    assert score_after(simulation, visiting_led=False) == 100
    for _ in range(60):
        simulation.step()
    return simulation


def test_the_way_home_is_shown_as_a_share(quiet: Parameters) -> None:
    simulation = visit_both(quiet)
    robot = simulation.robots[0]
    there = robot.x - 3.0
    assert score_after(simulation, returning_led=True) in (99, 100), "less the reward, and the whole way"
    assert robot.state is RobotState.RETURNING
    simulation.step({1: Actions(left_motor=-0.15, right_motor=-0.15)})
    for _ in range(30):
        simulation.step()
        assert robot.score == math.floor(100 * (robot.x - 3.0) / there)
    assert robot.returning_time == 31


def test_the_end_of_time_costs_15_who_is_still_returning(quiet: Parameters) -> None:
    early = visit_both(quiet, sim_time=200)
    late = copy.deepcopy(early)
    for simulation, led in ((early, False), (late, True)):
        simulation.step({1: Actions(returning_led=True)})
        while simulation.time < 199:
            simulation.step()
        before = simulation.robots[0].score
        assert score_after(simulation, end_led=led) == before + (0 if led else 15)


def test_a_new_signal_begins_the_return_again(quiet: Parameters) -> None:
    simulation = visit_both(quiet)
    simulation.step({1: Actions(returning_led=True)})
    for _ in range(9):
        simulation.step({1: Actions(left_motor=-0.02, right_motor=-0.02)})
    robot = simulation.robots[0]
    assert (robot.returning_time, robot.score) == (9, 97)
    simulation.step({1: Actions(returning_led=True, left_motor=0.0, right_motor=0.0)})
    simulation.step()
    assert robot.returning_time == 1
    assert robot.score in (99, 100), "single precision decides"


def test_the_end_led_at_the_target_ends_the_run_at_once(quiet: Parameters) -> None:
    simulation = visit_both(quiet)
    assert score_after(simulation, end_led=True) in (199, 200)
    assert simulation.robots[0].arrival_time == simulation.time
    assert simulation.robots[0].state is RobotState.FINISHED


@pytest.mark.parametrize("mode", [0, 2])
def test_the_returning_led_at_the_wrong_place_ends_the_run_in_mode_0_alone(
    quiet: Parameters, mode: int
) -> None:
    simulation = launched(NO_WALLS, BEFORE_TARGETS, quiet, mode)
    simulation.step({1: Actions(returning_led=True)})
    finished = simulation.robots[0].state is RobotState.FINISHED
    assert finished == (mode == 0)


def test_a_robot_that_is_finished_loses_nothing_more(quiet: Parameters) -> None:
    simulation = launched(NO_WALLS, BEFORE_TARGETS, quiet, 0)
    simulation.step({1: Actions(end_led=True, left_motor=0.1, right_motor=0.1)})
    assert [score_after(simulation, visiting_led=True) for _ in range(3)] == [300, 300, 300]
    assert simulation.robots[0].visited == set()


def test_returning_to_where_one_is_costs_nothing(quiet: Parameters) -> None:
    lab = replace(NO_WALLS, targets=NO_WALLS.targets[:1])
    simulation = launched(lab, BEFORE_TARGETS, quiet, 0)
    simulation.step({1: Actions(visiting_led=True)})
    assert score_after(simulation, visiting_led=False, returning_led=True) == 0
    assert score_after(simulation) == 0


def test_both_robots_of_a_collision_may_pay(quiet: Parameters) -> None:
    grid = StartGrid(positions=(GridPosition(x=5, y=5), GridPosition(x=6.3, y=5, direction_deg=180)))
    simulation = launched(NO_WALLS, grid, quiet, 0, robots=2, collision_robot_penalty=7)
    for _ in range(10):
        simulation.step({number: Actions(left_motor=0.1, right_motor=0.1) for number in (1, 2)})
    assert [robot.score for robot in simulation.robots] == [307, 307], "once each, however long they push"


def test_no_circuit_no_points(quiet: Parameters) -> None:
    # Turning right after the first step ends in a corner from which the way never meets the start again.
    lab = Lab(width=8.0, height=2.0)
    simulation = launched(lab, StartGrid(positions=(GridPosition(x=1, y=1),)), quiet, 1)
    for _ in range(40):
        simulation.step({1: Actions(left_motor=0.15, right_motor=0.15)})
    assert simulation.robots[0].score == 0


def drive_to(simulation: Simulation, x: float, y: float) -> None:
    """Put the robot there and let a cycle pass."""
    simulation.place(1, x, y, 0.0)
    simulation.step()


def test_cells_of_the_circuit_count_in_their_turn_alone(quiet: Parameters) -> None:
    walls = tuple(Wall(corners=((a, b), (c, b), (c, d), (a, d))) for a, b, c, d in ((1.9, 1.9, 4.1, 4.1),))
    lab = Lab(width=6.0, height=6.0, walls=walls)
    simulation = launched(lab, StartGrid(positions=(GridPosition(x=1, y=1),)), quiet, 1)
    ring = [(3, 1), (5, 1), (5, 3), (5, 5), (3, 5), (1, 5), (1, 3), (1, 1)]
    scores = []
    for place in (*ring, (1, 3), (3, 1), (3, 1), (5, 3), (5, 1)):
        drive_to(simulation, *place)
        scores.append(simulation.robots[0].score)
    assert scores == [10, 20, 30, 40, 50, 60, 70, 80, 80, 90, 90, 90, 100]
    assert score_after(simulation, end_led=True) == 0, "finishing early loses the rewards"


def test_lines_of_the_first_kind_cost_when_left(quiet: Parameters) -> None:
    lab = read_lab(find_lab("lines"))
    simulation = launched(lab, StartGrid(positions=(GridPosition(x=2, y=12),)), quiet, 4)
    circuit = SCORINGS[4](simulation.world).find_circuit(2, 12)  # type: ignore[attr-defined]
    assert circuit[:3] == ((2, 12), (3, 12), (4, 12))
    assert len(set(circuit)) == len(circuit)
    scores = []
    for x, y in ((3.0, 12.0), (4.49, 11.51), (4.51, 12.0), (4.0, 13.0), (9.0, 12.0), (0.9, 0.9)):
        drive_to(simulation, x, y)
        scores.append(simulation.robots[0].score)
    assert scores == [10, 20, 30, 20, 20, 10]


def test_lines_of_the_second_kind_cost_when_left(quiet: Parameters) -> None:
    lab = read_lab(find_lab("lines"))
    simulation = launched(lab, StartGrid(positions=(GridPosition(x=2, y=12),)), quiet, 7)
    scores = []
    for x, y in ((2.05, 12.0), (2.4, 12.0), (2.7, 12.0), (2.4, 12.6), (2.2, 11.6)):
        drive_to(simulation, x, y)
        scores.append(simulation.robots[0].score)
    assert scores == [10, 10, 20, 10, 10], "0.6 beside the line is not within 0.5 of any node"


@pytest.mark.parametrize(
    ("circuit", "score", "coming"),
    [
        # Out to (4, 4) and back along the diagonal: the node after the corner is beside the one before it.
        (((2, 4), (3, 4), (4, 4), (3, 5), (2, 5)), 10, 4),
        # A right angle.
        (((2, 4), (3, 4), (4, 4), (4, 6), (2, 6)), 0, 2),
    ],
)
def test_sharp_corners_of_lines_may_be_cut(
    quiet: Parameters, circuit: tuple[tuple[int, int], ...], score: int, coming: int
) -> None:
    simulation = launched(NO_WALLS, BEFORE_TARGETS, quiet, 7)
    robot = simulation.robots[0]
    robot.x, robot.y = 1.45, 2.45
    progress = Progress(circuit, coming=2)
    simulation.scoring.follow(robot, progress)  # type: ignore[attr-defined]
    assert (progress.reward, progress.penalty, progress.coming) == (score, 0, coming)


def test_off_the_lines_the_counter_rises_and_collisions_take_away(quiet: Parameters) -> None:
    lab = read_lab(find_lab("lines"))
    simulation = launched(
        lab, StartGrid(positions=(GridPosition(x=2, y=12),)), quiet, 5, collision_wall_penalty=3
    )
    scores = []
    for x, y in ((4, 12), (4.0, 12.6), (4.0, 12.65), (8.0, 12.0), (13.0, 13.4)):
        drive_to(simulation, x, y)
        scores.append(simulation.robots[0].score)
    assert scores == [0, 0, 10, 10, 20]
    simulation.place(1, 5.0, 13.49, math.pi / 2)
    simulation.step({1: Actions(left_motor=0.15, right_motor=0.15)})
    assert simulation.robots[0].collisions == 1
    assert simulation.robots[0].score == 20 + 10 - 3


# --- reference files ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["maze", "standard", "corridors", "twins"])
def test_the_map_shows_the_openings_that_a_robot_can_drive_through(name: str, quiet: Parameters) -> None:
    lab = read_lab(find_lab(name))
    simulation = launched(lab, StartGrid(positions=(GridPosition(x=13, y=5),)), quiet, 2)
    lines = simulation.scoring.documents["mapping.out"].splitlines()
    assert [len(line) for line in lines] == [55] * 27
    assert lines[13][27] == "I"
    east, north = cell_openings(lab)

    def mark(column: float, row: float) -> str:
        return lines[13 - round(2 * (row - 2))][27 + round(2 * (column - 6))]

    reached = {(6, 2)}
    waiting = [(6, 2)]
    while waiting:
        column, row = waiting.pop()
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            inside = 0 <= column + dx < 14 and 0 <= row + dy < 7
            passages = east[row, min(column, column + dx)] if dx and inside else None
            if dy and inside:
                passages = north[min(row, row + dy), column]
            expected = "X" if passages else "|" if dx else "-"
            assert mark(column + dx / 2, row + dy / 2) == expected
            if passages and (column + dx, row + dy) not in reached:
                reached.add((column + dx, row + dy))
                waiting.append((column + dx, row + dy))
    for row in range(7):
        for column in range(14):
            expected = "I" if (column, row) == (6, 2) else "X" if (column, row) in reached else " "
            assert mark(column, row) == expected


def test_the_best_tour_is_the_first_of_the_shortest() -> None:
    distances = [
        [0.0, 3.0, 4.0, 2.0, 7.0],
        [3.0, 0.0, 4.0, 6.0, 3.0],
        [4.0, 4.0, 0.0, 5.0, 8.0],
        [2.0, 6.0, 5.0, 0.0, 6.0],
        [7.0, 3.0, 8.0, 6.0, 0.0],
    ]
    lengths = {
        (0, *order, 0): sum(distances[a][b] for a, b in itertools.pairwise((0, *order, 0)))
        for order in itertools.permutations(range(1, 5))
    }
    shortest = min(lengths.values())
    assert best_tour(distances) == (min(t for t, length in lengths.items() if length == shortest), shortest)


def test_a_target_that_cannot_be_reached_makes_the_tour_endless() -> None:
    lab = Lab(
        width=8.0,
        height=2.0,
        walls=(Wall(corners=((3.9, 0.0), (4.1, 0.0), (4.1, 2.0), (3.9, 2.0))),),
        beacons=(Beacon(), Beacon()),
        targets=(Target(x=1, y=1), Target(x=7, y=1)),
    )
    lines = CellMap(lab, WallMap.from_lab(lab), 1, 1).planning().splitlines()
    assert lines[-2:] == [" 0 1 0", "inf"]
    assert lines[1] == "      |0XX|  1 ", "the wall, and what lies behind it, is not drawn but for the target"


def test_files_are_written_when_the_run_begins(tmp_path: Path, quiet: Parameters) -> None:
    simulation = Simulation(
        read_lab(find_lab("maze")), StartGrid(positions=(GridPosition(x=1, y=1),)), quiet, scoring=3
    )
    files = ReferenceFiles(tmp_path)
    simulation.register(RobotRegistration())
    files.actions_read(simulation)
    assert list(tmp_path.iterdir()) == []
    simulation.launch()
    files.actions_read(simulation)
    lines = (tmp_path / "planning.out").read_text().splitlines()
    assert lines[-2] == " 0 1 0"
    assert len(lines) == 29


def test_a_snapshot_keeps_its_own_score(quiet: Parameters) -> None:
    simulation = visit_both(quiet)
    simulation.step({1: Actions(returning_led=True)})
    saved = copy.deepcopy(simulation)
    simulation.step({1: Actions(visiting_led=True, left_motor=0.1, right_motor=0.1)})
    for _ in range(20):
        simulation.step()
    assert saved.robots[0].score == 100
    for actions in (Actions(visiting_led=True, left_motor=0.1, right_motor=0.1), *[Actions()] * 20):
        saved.step({1: actions})
    assert saved.robots[0].score == simulation.robots[0].score


def test_a_reset_forgets_all_scores(quiet: Parameters) -> None:
    simulation = launched(NO_WALLS, BEFORE_TARGETS, quiet, 0)
    simulation.step({1: Actions(visiting_led=True)})
    simulation.reset()
    simulation.register(RobotRegistration())
    simulation.launch()
    assert score_after(simulation) == 300


def test_every_mode_of_the_real_simulator_is_there() -> None:
    assert sorted(SCORINGS) == list(range(8))
    assert [mode for mode in sorted(SCORINGS) if SCORINGS[mode].has_documents] == [2, 3, 5, 6]
