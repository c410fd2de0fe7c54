"""The first reading of a robot that is known to start in a cell's centre, against the exact sensor model."""

from __future__ import annotations

import numpy as np
import pytest

from agent.offline.expected_readings import standable_cells
from ciberrato.infrared.model import cell_readings, reading_log_likelihood, round_reading
from ciberrato.localization.evidence.start_prior import parse_start
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.localization.records import FilterSettings
from ciberrato.protocol.messages import Measures
from ciberrato.world.parameters import Parameters

ANGLES = (0.0, 60.0, -60.0, 180.0)


def measures(readings) -> Measures:
    return Measures(time=0, infrared=tuple(float(reading) for reading in readings), collision=False)


def by_cell(pose_filter: GridFilter, lab) -> np.ndarray:
    belief = pose_filter.belief
    weights = np.bincount(belief.lattice.cell, belief.square_weights(), lab.rows * lab.columns)
    return weights.reshape(lab.rows, lab.columns) / weights.sum()


@pytest.mark.parametrize("cell", [(0, 0), (0, 3), (2, 1), (1, 3)])
def test_it_says_what_the_exact_model_says(small_lab, coarse_tables, cell):
    parameters = Parameters(compass_sensor=False, obstacle_noise=0.1)
    readings = cell_readings(small_lab, ANGLES)
    seen = round_reading(readings[cell] + np.array([0.1, -0.1, 0.05, 0.0]))
    pose_filter = GridFilter(small_lab, coarse_tables, parameters, start="centres:0")
    pose_filter.observe(measures(seen), None)
    exact = np.exp(reading_log_likelihood(seen, readings, 0.1).sum(axis=-1)) * standable_cells(small_lab)
    exact /= exact.sum()
    # Expected readings are kept in steps, and a small share of readings is allowed to be anything.
    assert by_cell(pose_filter, small_lab) == pytest.approx(exact, abs=0.08)
    assert by_cell(pose_filter, small_lab)[cell] > 0.9 * exact[cell]


def test_the_second_counts_less_as_it_repeats_the_first_ones_error(small_lab, coarse_tables):
    parameters = Parameters(compass_sensor=False, obstacle_noise=0.1)
    pose_filter = GridFilter(small_lab, coarse_tables, parameters, start="centres:0")
    exponents = []
    for time in range(3):
        seen = round_reading(cell_readings(small_lab, ANGLES)[0, 0])
        pose_filter.observe(Measures(time=time, infrared=tuple(map(float, seen)), collision=False), None)
        exponents.append(pose_filter.last_step.exponent)
    assert exponents[0] == 1.0
    assert exponents[1] < 0.1


@pytest.mark.parametrize(
    ("start", "exact"),
    [("centres", True), ("centres:-90", True), ("centres:1", False), ("anywhere", False), ("1,1,0", False)],
)
def test_only_centres_with_headings_along_the_axes_are_states(small_lab, coarse_tables, start, exact):
    assert parse_start(start).on_nodes is exact
    settings = FilterSettings(first_exponent=0.5)
    pose_filter = GridFilter(small_lab, coarse_tables, Parameters(), settings, start=start)
    pose_filter.observe(measures((1.0, 1.0, 1.0, 1.0)), None)
    assert (pose_filter.last_step.exponent == 1.0) is exact
