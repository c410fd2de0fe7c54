"""Cues from walls, against the sensor model on real walls."""

import math

import numpy as np
import pytest

from agent.drives.right.row_ekf import Pose
from agent.drives.right.wall_cues import WallAhead, reading_variance, side_explanations
from ciberrato.files.lab import read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import cell_openings, ideal_reading, sensor_distances
from ciberrato.labs import find_lab
from ciberrato.world.lab import Lab


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("lateral", [-0.2, -0.05, 0.0, 0.1, 0.25])
@pytest.mark.parametrize("degrees", [-10.0, 0.0, 4.0])
def test_a_wall_between_cells_is_explained(standard: Lab, side: int, lateral: float, degrees: float) -> None:
    # Row y = 7 of the standard lab has walls on both sides of x = 17, far from their ends.
    pose = Pose(0.0, lateral, math.radians(degrees))
    direction = pose.heading + side * math.pi / 2
    reading = float(
        ideal_reading(sensor_distances(WallMap.from_lab(standard), 17.0, 7.0 + lateral, direction))
    )
    explanations = side_explanations(reading, side, pose, reading_variance(0.1))
    if reading < 1.2:
        assert explanations == []
        return
    innovations = [explanation.innovation for explanation in explanations]
    assert min(abs(innovation) for innovation in innovations) < 2e-3
    # The slope is the derivative of the distance.
    shifted = sensor_distances(WallMap.from_lab(standard), 17.0, 7.0 + lateral + 1e-4, direction)
    assert explanations[0].slope[1] == pytest.approx((float(shifted) - 1.0 / reading) / 1e-4, rel=0.02)


def test_the_border_is_explained(standard: Lab) -> None:
    reading = float(ideal_reading(sensor_distances(WallMap.from_lab(standard), 9.0, 1.0, -math.pi / 2)))
    assert reading == pytest.approx(2.0)
    face, border = side_explanations(reading, -1, Pose(), reading_variance(0.1))
    assert abs(border.innovation) < 1e-9
    assert face.innovation == pytest.approx(0.1)


def test_nothing_is_explained_where_there_is_no_wall_or_no_telling() -> None:
    variance = reading_variance(0.1)
    assert side_explanations(0.6, 1, Pose(), variance) == []
    assert side_explanations(1.7, 1, Pose(), reading_variance(0.4)) == []
    assert side_explanations(2.5, 1, Pose(0.0, 0.0, math.radians(20.0)), variance) == []


@pytest.mark.parametrize("noise", [0.1, 0.4])
@pytest.mark.parametrize("name", ["standard", "corridors", "maze", "diagonals", "twins"])
def test_the_wall_ahead_is_told_in_every_cell(name: str, noise: float) -> None:
    """Approach the centre of every cell that can be entered from the left, with noisy readings."""
    lab = read_lab(find_lab(name))
    walls = WallMap.from_lab(lab)
    east, _ = cell_openings(lab)
    generator = np.random.default_rng(5)
    approach = np.arange(-0.9, 0.05, 0.1)
    wrong = []
    cells = 0
    for row in range(lab.rows):
        for column in range(1, lab.columns):
            x, y = 2.0 * column + 1.0 + approach, 2.0 * row + 1.0
            if not east[row, column - 1] or (walls.distance(x, np.full_like(x, y)) < 0.5).any():
                continue
            readings = ideal_reading(sensor_distances(walls, x, y, 0.0))
            readings = readings + noise * generator.standard_normal(readings.shape)
            ahead = WallAhead(noise)
            for place, reading in zip(approach, readings, strict=True):
                ahead.observe(float(reading), Pose(2.0 + place, 0.0, 0.0), (0.03, 0.02, 0.01))
            cells += 1
            closed = column == lab.columns - 1 or not east[row, column]
            if ahead.certain != closed:
                wrong.append((row, column, closed))
    assert cells > 15
    # A wall that is missed is told a few cycles later, one that is dreamt up is found out at rest.
    assert len(wrong) <= (0 if noise < 0.2 else 0.05 * cells)


def test_evidence_is_about_one_cell() -> None:
    ahead = WallAhead(0.1)
    for _ in range(3):
        ahead.observe(2.5, Pose(0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert ahead.certain
    assert ahead.cell == 0
    ahead.observe(0.6, Pose(1.2, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert not ahead.certain
    assert ahead.cell == 1


def test_evidence_can_be_withdrawn() -> None:
    ahead = WallAhead(0.4)
    for _ in range(10):
        ahead.observe(2.5, Pose(), (0.0, 0.0, 0.0))
    assert ahead.certain
    for _ in range(10):
        ahead.observe(0.5, Pose(), (0.0, 0.0, 0.0))
    assert not ahead.certain
