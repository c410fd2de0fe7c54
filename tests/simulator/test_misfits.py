"""Scoring modes in labs and from starts that they were not made for: no crash, no hang, and a note."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from ciberrato.files.lab import read_lab
from ciberrato.files.start_grid import read_grid
from ciberrato.geometry.walls import WallMap
from ciberrato.labs import find_grid, find_lab, names
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.world.lab import Beacon, Lab, Target, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.scoring.tours import MOST_PLACES
from simulator_stub.service.session import Session
from simulator_stub.simulation import Simulation

ODD_STARTS = [(4.3, 9.71), (0.0, 0.0), (-3.0, 5.0), (28.0, 14.0), (27.99, 13.99), (40.0, -7.0), (1e9, -1e9)]
FIT = {2: (1.0, 1.0), 3: (1.0, 1.0), 5: (2.0, 2.0), 6: (2.0, 2.0)}
FILES = {2: "mapping.out", 3: "planning.out", 5: "mapping.out", 6: "planning.out"}


def begun(lab: Lab, mode: int, parameters: Parameters, *starts: tuple[float, float]) -> Simulation:
    grid = StartGrid(positions=tuple(GridPosition(x=x, y=y) for x, y in starts))
    simulation = Simulation(lab, grid, parameters, scoring=mode)
    for _ in starts:
        simulation.register(RobotRegistration())
    simulation.launch()
    return simulation


@pytest.mark.parametrize("mode", range(8))
@pytest.mark.parametrize("name", ["maze", "lines", "wide"])
def test_every_mode_gets_through_every_lab_from_anywhere(name: str, mode: int, quiet: Parameters) -> None:
    lab = read_lab(find_lab(name))
    simulation = begun(lab, mode, replace(quiet, score_sensor=True), *ODD_STARTS)
    robots = range(1, len(ODD_STARTS) + 1)
    for actions in (
        Actions(left_motor=0.1, right_motor=0.1, visiting_led=True),
        Actions(visiting_led=False, returning_led=True),
        Actions(end_led=True),
        Actions(),
    ):
        measures = simulation.step(dict.fromkeys(robots, actions))
        assert all(math.isfinite(measures[robot].score.score) for robot in robots)  # type: ignore[union-attr]
    if mode in FILES:
        lines = simulation.scoring.documents[FILES[mode]].splitlines()
        wide, high = 4 * lab.columns, 4 * lab.rows
        size = (wide - 1, high - 1) if mode < 4 else (wide - 7, high - 7)
        assert [len(line) for line in lines[: size[1]]] == [size[0]] * size[1]


@pytest.mark.parametrize("mode", [1, 4, 7])
def test_where_no_circuit_begins_people_are_told(mode: int, quiet: Parameters) -> None:
    lab = read_lab(find_lab("maze"))
    # In the last column the second place of the circuit lies beyond the border, where nothing ends a way.
    simulation = begun(lab, mode, quiet, (27.0, 13.0))
    assert simulation.scoring.notes == ["robot 1: no circuit begins at its start; only collisions count"]


@pytest.mark.parametrize("mode", sorted(FIT))
def test_a_start_that_fits_needs_no_note_and_one_that_does_not_gets_one(mode: int, quiet: Parameters) -> None:
    lab = read_lab(find_lab("lines" if mode > 4 else "maze"))
    assert begun(lab, mode, quiet, FIT[mode]).scoring.notes == []
    x, y = FIT[mode]
    (note,) = begun(lab, mode, quiet, (x + 1.0, y)).scoring.notes
    assert note.startswith(f"robot 1: its start ({x + 1:g}, {y:g}) is not ")
    (note,) = begun(lab, mode, quiet, (-x, y)).scoring.notes
    assert note.startswith(f"robot 1: its start ({-x:g}, {y:g}) is outside the lab")


def test_labs_of_the_other_kind_are_noted(quiet: Parameters) -> None:
    maze, lines = (read_lab(find_lab(name)) for name in ("maze", "lines"))
    for mode, lab, note in ((2, lines, "no walls"), (3, lines, "no walls"), (5, maze, "no painted lines")):
        assert [note in line for line in begun(lab, mode, quiet, FIT[mode]).scoring.notes] == [True]


def test_a_session_tells_each_note_once(quiet: Parameters, newcomer: Any) -> None:
    notes: list[str] = []
    lab = read_lab(find_lab("maze"))
    grid = StartGrid(positions=(GridPosition(x=2.0, y=1.0),))
    session = Session(Simulation(lab, grid, quiet, scoring=2), autostart=1, notify=notes.append)
    session.welcome(newcomer(), b'<Robot Name="r"/>')
    for _ in range(6):
        session.cycle()
    assert sum("is not the centre of a cell" in note for note in notes) == 1


STROKES = {(1, 0): "-", (1, 1): "/", (0, 1): "|", (-1, 1): "\\"}


@pytest.mark.parametrize(
    ("name", "x", "y"), [("maze", 2, 2), ("maze", 14, 6), ("lines", 2, 12), ("rooms", 26, 2)]
)
def test_maps_of_lines_show_walls_too(name: str, x: int, y: int, quiet: Parameters) -> None:
    """By the written rule, from scratch: a stroke where the point 0.5 along it is inside any polygon."""
    lab = read_lab(find_lab(name))
    text = begun(lab, 5, quiet, (x, y)).scoring.documents["mapping.out"]
    walls = WallMap.from_lab(lab, at_least=-math.inf)
    marks: dict[tuple[int, int], set[str]] = {}
    for node_x in range(2, 2 * lab.columns, 2):
        for node_y in range(2, 2 * lab.rows, 2):
            for (dx, dy), stroke in STROKES.items():
                for sign in (1, -1):
                    step = sign * 0.5 / math.hypot(dx, dy)
                    if walls.point_in_polygons(node_x + step * dx, node_y + step * dy):
                        place = node_x - x + sign * dx, node_y - y + sign * dy
                        marks.setdefault(place, set()).add(stroke)
    lines = text.splitlines()
    assert (len(lines), {len(line) for line in lines}) == (4 * lab.rows - 7, {4 * lab.columns - 7})
    middle_line, middle_column = len(lines) // 2, len(lines[0]) // 2
    drawn = 0
    for line, row in enumerate(lines):
        for column, character in enumerate(row):
            place = column - middle_column, middle_line - line
            if place == (0, 0):
                assert character == "I"
            else:
                # Where two lines cross half way, the rule does not say which is drawn.
                assert character in marks.get(place, {" "})
                drawn += character != " "
    assert drawn > 20


def ring(count: int) -> Lab:
    places = [(2.0 * (number % 14) + 1.0, 2.0 * (number // 14) + 1.0) for number in range(count)]
    return Lab(
        width=28.0,
        height=14.0,
        walls=(Wall(corners=((9.0, 9.0), (9.2, 9.0), (9.2, 9.2))),),
        beacons=tuple(Beacon(x=x, y=y) for x, y in places),
        targets=tuple(Target(x=x, y=y) for x, y in places),
    )


def test_a_tour_through_too_many_places_is_left_out_with_a_note(quiet: Parameters) -> None:
    most = begun(ring(MOST_PLACES), 3, quiet, (1.0, 1.0))
    lines = most.scoring.documents["planning.out"].splitlines()
    assert (len(lines), most.scoring.notes) == (27 + 2, [])
    assert lines[-1] == f"{2.0 * 2 * (MOST_PLACES - 1):f}", "out and back in one row"
    more = begun(ring(40), 3, quiet, (1.0, 1.0))
    assert len(more.scoring.documents["planning.out"].splitlines()) == 27
    (note,) = more.scoring.notes
    assert note.startswith(f"robot 1: no tour is written: 40 places are more than {MOST_PLACES}")
    fewer = replace(ring(5), targets=ring(3).targets)
    simulation = begun(fewer, 3, quiet, (1.0, 1.0))
    assert "5 beacons and 3 targets" in simulation.scoring.notes[0]
    assert simulation.scoring.documents["planning.out"].splitlines()[-2] == " 0 1 2 0"


def test_all_shipped_labs_are_mapped_from_all_their_starts(quiet: Parameters) -> None:
    for name in names("lab"):
        grid = read_grid(find_grid(name))
        starts = [(place.x, place.y) for place in grid.positions[:3]]
        for mode, file in FILES.items():
            simulation = begun(read_lab(find_lab(name)), mode, quiet, *starts)
            assert "I" in simulation.scoring.documents[file] or file == "planning.out"
