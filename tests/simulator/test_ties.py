"""What robots are told at ties, and before they move with a heading of several turns."""

from __future__ import annotations

import pytest

from ciberrato.files.lab import read_lab, read_lab_with_warnings
from ciberrato.files.start_grid import read_grid
from ciberrato.labs import find_lab
from ciberrato.protocol import RobotRegistration
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation
from tests.recordings import LABS, needs


def first_readings(lab: Lab, grid: StartGrid, parameters: Parameters) -> tuple[float | None, ...]:
    simulation = Simulation(lab, grid, parameters)
    simulation.register(RobotRegistration())
    return simulation.step()[1].infrared


def test_a_tie_is_rounded_up(quiet: Parameters) -> None:
    lab = Lab(width=28.0, height=14.0)
    grid = StartGrid(positions=(GridPosition(x=24.0, y=2.0),))
    assert first_readings(lab, grid, quiet)[3] == 0.3


@needs("CIBERRATO_LABS")
def test_the_lab_in_which_it_was_met(quiet: Parameters) -> None:
    assert LABS is not None
    lab, _ = read_lab_with_warnings(LABS / "rmi-2223/C2a-lab.xml")
    assert first_readings(lab, read_grid(LABS / "rmi-2223/C2a-grid.xml"), quiet)[3] == 0.3


@pytest.mark.parametrize(
    ("degrees", "behind"),
    [(0, 0.5), (360, 0.5), (-360, 0.5), (720, 1.0), (270, 2.5), (-270, 2.0), (-450, 2.5)],
)
def test_headings_of_several_turns(degrees: float, behind: float, quiet: Parameters) -> None:
    lab = read_lab(find_lab("maze"))
    grid = StartGrid(positions=(GridPosition(x=17.0, y=1.0, direction_deg=degrees),))
    assert first_readings(lab, grid, quiet)[3] == behind


def test_two_turns_are_gone_after_two_cycles(quiet: Parameters) -> None:
    lab = read_lab(find_lab("maze"))
    grids = [
        StartGrid(positions=(GridPosition(x=17.0, y=1.0, direction_deg=degrees),)) for degrees in (0.0, 720.0)
    ]
    turned, plain = (Simulation(lab, grid, quiet) for grid in reversed(grids))
    for simulation in (turned, plain):
        simulation.register(RobotRegistration())
        simulation.launch()
        simulation.step()
    assert turned.step()[1].infrared == plain.step()[1].infrared
