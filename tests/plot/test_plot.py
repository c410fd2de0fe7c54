"""Plots: axes that show what was handed in, at the right place, with names, units and limits."""

from __future__ import annotations

import itertools
import subprocess
import sys

import matplotlib as mpl
import numpy as np
import pytest

mpl.use("Agg")
from matplotlib import pyplot
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb

from ciberrato import find_grid, find_lab, plot, read_grid, read_lab
from ciberrato.infrared.model import cell_readings
from ciberrato.plot.canvas import LINE_COLOURS
from ciberrato.plot.outcomes import STYLES

MAZE = read_lab(find_lab("maze"))
SHAPE = (MAZE.rows, MAZE.columns)
BELIEFS = np.random.default_rng(1).dirichlet(np.ones(MAZE.rows * MAZE.columns), 4).reshape(4, *SHAPE)
POSES = np.random.default_rng(2).uniform((1, 1, -3), (20, 10, 3), (50, 3))
TIMES = np.arange(50)
COUNTS = np.random.default_rng(3).integers(0, 3, (12, 10, 1)) * np.array([2, 1])
MAPS = {
    "lab": lambda **more: plot.lab(MAZE, grid=read_grid(find_grid("maze")), **more),
    "cones": lambda **more: plot.cones(MAZE, (5.0, 7.0, 0.3), **more),
    "readings": lambda **more: plot.readings(cell_readings(MAZE, [0.0])[..., 0], lab=MAZE, **more),
    "cells": lambda **more: plot.cells(BELIEFS[0], lab=MAZE, truth=(2, 3), **more),
    "poses": lambda **more: plot.poses(POSES, np.arange(50.0), lab=MAZE, **more),
    "track": lambda **more: plot.track(POSES, lab=MAZE, label="driven", **more),
}
CURVES = {
    "series": lambda **more: plot.series(
        TIMES, POSES[:, :2], name="place (units)", labels=("x", "y"), **more
    ),
    "probabilities": lambda **more: plot.probabilities(BELIEFS, truth=[None, (0, 0), (0, 1), (0, 2)], **more),
    "entropies": lambda **more: plot.entropies(BELIEFS, **more),
    "times_to_localize": lambda **more: plot.times_to_localize([3, 20, np.nan], 100, **more),
    "truth_probabilities": lambda **more: plot.truth_probabilities([[0.1, 1.0], [0.2]], 100, 10, **more),
    "place_errors": lambda **more: plot.place_errors([0.1, 0.02], **more),
    "calibration": lambda **more: plot.calibration(COUNTS, **more),
    "collisions": lambda **more: plot.collisions(2.5, label="explore", **more),
}


@pytest.fixture(autouse=True)
def _closed():
    yield
    pyplot.close("all")


@pytest.mark.parametrize("name", sorted({**MAPS, **CURVES}))
def test_it_draws_into_the_axes_it_is_handed_and_nowhere_else(name):
    figure, (left, right) = pyplot.subplots(1, 2)
    assert ({**MAPS, **CURVES})[name](ax=left) is left
    assert left.has_data()
    assert not right.has_data()
    assert figure.axes == [left, right]  # no colour bar
    assert not figure.legends
    assert pyplot.get_fignums() == [1]


@pytest.mark.parametrize("name", sorted({**MAPS, **CURVES}))
def test_without_axes_it_makes_a_figure_with_names_on_its_axes(name):
    ax = ({**MAPS, **CURVES})[name]()
    assert pyplot.get_fignums() == [1]
    assert ax.get_xlabel()
    assert ax.get_ylabel()
    ax.figure.canvas.draw()


@pytest.mark.parametrize("name", sorted(MAPS))
def test_a_map_has_the_limits_of_the_lab_and_equal_scales(name):
    ax = MAPS[name]()
    assert (*ax.get_xlim(), *ax.get_ylim()) == (0.0, MAZE.width, 0.0, MAZE.height)
    assert ax.get_aspect() == 1.0
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x (units)", "y (units)")


@pytest.mark.parametrize("name", ["lab", "cones", "track", "series", "probabilities"])
def test_a_new_figure_has_its_legend_beside_the_data(name):
    figure = ({**MAPS, **CURVES})[name]().figure
    if name == "lab":
        heights = {wall.height for wall in MAZE.walls}
        assert len(figure.axes) == (2 if len(heights) > 1 else 1)
        return
    figure.canvas.draw()
    (legend,) = figure.legends
    box = legend.get_window_extent()
    assert not any(axis.get_window_extent().overlaps(box) for axis in figure.axes)


def test_a_cell_is_where_its_probability_is():
    belief = np.zeros(SHAPE)
    belief[1, 3] = 1.0
    image = plot.cells(belief).images[-1]
    left, right, low, high = image.get_extent()
    across = np.linspace(left, right, SHAPE[1] + 1)
    up = np.linspace(low, high, SHAPE[0] + 1)
    shown = np.argwhere(np.asarray(image.get_array()) == 1.0)
    assert image.origin == "lower"
    assert shown.tolist() == [[1, 3]]
    assert (across[3], across[4], up[1], up[2]) == (6.0, 8.0, 2.0, 4.0)


def test_arrows_stand_on_the_poses_and_point_along_their_headings():
    ax = plot.poses(POSES)
    (arrows,) = ax.collections
    order = np.lexsort(POSES[:, :2].T)
    drawn = np.lexsort(arrows.XY.T)
    np.testing.assert_allclose(arrows.XY[drawn], POSES[order, :2])
    np.testing.assert_allclose(np.arctan2(arrows.V, arrows.U)[drawn], POSES[order, 2])
    assert ax.get_xlim()[0] < POSES[:, 0].min()
    assert ax.get_ylim()[1] > POSES[:, 1].max()


def test_many_poses_are_thinned_out_without_a_change_of_the_belief():
    rng = np.random.default_rng(5)
    many = rng.uniform(0, 10, (50_000, 3))
    weights = rng.exponential(size=50_000) * (many[:, 0] < 3)
    (arrows,) = plot.poses(many, weights, most=800).collections
    shares = np.asarray(arrows.get_array())
    assert len(shares) <= 800
    assert shares.sum() == pytest.approx(1.0)
    assert arrows.XY[:, 0].max() < 3.0
    # 800 independent draws would be off by 0.03 (standard deviation of the mean)
    assert shares @ arrows.XY[:, 0] == pytest.approx(np.average(many[:, 0], weights=weights), abs=0.1)


def test_no_poses_are_an_empty_map():
    assert plot.poses(np.empty((0, 3)), np.empty(0), lab=MAZE).get_xlim() == (0.0, MAZE.width)


def test_a_second_track_leaves_the_map_as_it_is(caplog):
    ax = plot.track(POSES, lab=MAZE)
    plot.track(POSES[:, :2] + 0.1, ax)
    ax.figure.canvas.draw()
    assert (*ax.get_xlim(), *ax.get_ylim()) == (0.0, MAZE.width, 0.0, MAZE.height)
    assert not caplog.records


def test_the_colour_of_a_track_goes_with_the_cycle_and_gaps_stay():
    poses = [(1, 1), (2, 1), (np.nan, np.nan), (4, 2), (4, 3)]
    figure, ax = pyplot.subplots()
    plot.track(poses, ax, lab=MAZE, by_cycle=True, legend=True)
    (line,) = [one for one in ax.collections if isinstance(one, LineCollection)]
    assert [part.tolist() for part in line.get_segments()] == [[[1, 1], [2, 1]], [[4, 2], [4, 3]]]
    assert line.get_array().tolist() == [0, 3]
    _, bar = figure.axes
    assert bar.get_ylabel() == "cycle"
    plot.track(poses[:1], pyplot.subplots()[1], by_cycle=True, legend=True)  # one pose: no line, no bar
    assert len(pyplot.gcf().axes) == 1


def test_the_share_of_runs_that_know_their_pose_is_counted():
    times = np.array([3.0, 20.0, np.inf, np.nan, 7.0])
    line = plot.times_to_localize(times, 100).lines[0]
    for cycle in (0.0, 5.0, 7.5, 50.0, 100.0):
        height = line.get_ydata()[np.searchsorted(line.get_xdata(), cycle, side="right") - 1]
        assert height == pytest.approx(np.count_nonzero(times <= cycle) / 5)


def test_calibration_is_the_mean_over_the_runs_that_claimed():
    line = plot.calibration(COUNTS).lines[-1]
    expected = {}
    for tenth in range(10):
        shares = [right / claims for claims, right in COUNTS[:, tenth] if claims]
        if len(shares) >= 5:
            expected[round(0.05 + 0.1 * tenth, 2)] = sum(shares) / len(shares)
    drawn = zip(line.get_xdata(), line.get_ydata(), strict=True)
    assert {round(x, 2): y for x, y in drawn} == pytest.approx(expected)


def test_a_run_that_ended_keeps_its_last_probability():
    line = plot.truth_probabilities([[0.1, 1.0], [0.2], []], 30, 10).lines[0]
    np.testing.assert_allclose(line.get_ydata(), [0.15, 0.6, 0.6, 0.6])


def test_groups_of_runs_in_the_same_axes_differ():
    _, ax = pyplot.subplots()
    for label in ("one", "two", "three"):
        plot.place_errors([0.1], ax, label=label)
    lines = [line for line in ax.lines if not line.get_label().startswith("_")]
    assert [line.get_color() for line in lines] == [style[0] for style in STYLES[:3]]
    assert len({line.get_linestyle() for line in lines}) == 3


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: plot.cells(BELIEFS), "belief: shape"),
        (lambda: plot.poses(POSES[:, :2]), "poses have"),
        (lambda: plot.poses(POSES, [1.0]), "weights: shape"),
        (lambda: plot.poses(POSES, -np.ones(50)), "weights: they are finite, not negative"),
        (lambda: plot.poses(POSES, most=0), "most: 0 arrows"),
        (lambda: plot.track(POSES[0]), "a track has"),
        (lambda: plot.series(TIMES[1:], POSES[:, 0], name="x"), "values: shape"),
        (lambda: plot.series(TIMES, POSES[:, 0], name="x", labels="ab"), "labels: 2 for 1 series"),
        (lambda: plot.readings(BELIEFS), "readings of one sensor"),
    ],
)
def test_what_cannot_be_drawn_is_refused_by_name(call, message):
    with pytest.raises(ValueError, match=message):
        call()
    assert not pyplot.get_fignums()


def test_something_else_than_axes_is_refused():
    with pytest.raises(TypeError, match="ax: 3 is not an Axes"):
        plot.lab(MAZE, 3)


@pytest.mark.parametrize(
    "seen",
    [
        # Machado, Oliveira, Fernandes (2009), severity 1: protanopia and deuteranopia, of linear RGB
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    ],
    ids=["protanopia", "deuteranopia"],
)
def test_lines_differ_for_colour_blind_readers_too(seen):
    for palette in (LINE_COLOURS, [style[0] for style in STYLES]):
        linear = np.array([to_rgb(colour) for colour in palette]) ** 2.2
        shown = np.clip(linear @ np.transpose(seen), 0.0, 1.0) ** (1 / 2.2)
        for one, other in itertools.combinations(shown, 2):
            assert np.linalg.norm(one - other) > 0.12


def test_matplotlib_is_loaded_by_the_first_plot():
    program = "import ciberrato.plot, sys; print('matplotlib' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
