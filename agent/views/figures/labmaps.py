"""The lab as the agent stores it: walls, the sensors' cones in a cell, what they should read everywhere."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from agent.offline.summary import cell_name
from agent.views.figures.canvas import save_figure
from ciberrato import plot
from ciberrato.plaintext import plain
from ciberrato.plot.canvas import add_legend, label_outer, new_figure, set_title
from ciberrato.plot.labs import reading_bar, reading_scale
from ciberrato.world.coordinates import Cell
from ciberrato.world.lab import CELL_SIZE, Lab

if TYPE_CHECKING:
    from agent.offline.expected_readings import ExpectedReadings


def wall_map(lab: Lab, path: str | os.PathLike[str]) -> None:
    """Draw a lab: walls coloured by height, lines dotted, beacons, targets, and the grid of cells.

    Parameters
    ----------
    lab : Lab
    path : path-like
        The ending chooses the format.

    Raises
    ------
    UsageError
        If the figure cannot be written.
    """
    figure = new_figure(10.0, 10.0 * lab.height / lab.width + 0.8)
    plot.lab(lab, figure.subplots(), legend=True)
    save_figure(figure, Path(path))


def sensor_cones(
    lab: Lab,
    cell: Cell,
    angles: Sequence[float],
    path: str | os.PathLike[str],
    *,
    model: Literal["sensor", "cone"] = "sensor",
    heading: float = 0.0,
) -> None:
    """Draw the robot in a cell, the cone of each sensor, and the wall point that its distance belongs to.

    Parameters
    ----------
    lab : Lab
    cell : (row, column)
    angles : sequence of float
        Mounting angles in degrees.
    path : path-like
        The ending chooses the format.
    model : {"sensor", "cone"}
        Sensor model: the real sensor's beams, or the nearest point of the whole cone.
    heading : float
        The robot's, degrees.

    Raises
    ------
    UsageError
        If the figure cannot be written.
    """
    figure = new_figure(9.0, 9.0 * lab.height / lab.width + 0.9)
    row, column = cell
    pose = ((column + 0.5) * CELL_SIZE, (row + 0.5) * CELL_SIZE, math.radians(heading))
    axis = plot.cones(lab, pose, figure.subplots(), angles=angles, model=model)
    sees = "nearest points of the whole cones" if model == "cone" else "what the simulator's sensors look at"
    set_title(axis, f"{plain(lab.name, 40)}, cell {cell_name(cell)}, heading {heading:g}°; dots: {sees}")
    add_legend(axis)
    save_figure(figure, Path(path))


def expected_readings_maps(
    lab: Lab, expected: ExpectedReadings, angles: Sequence[float], path: str | os.PathLike[str]
) -> None:
    """Draw what each sensor should read in every cell: one map a sensor, the value in each cell.

    Parameters
    ----------
    lab : Lab
    expected : ExpectedReadings
    angles : sequence of float
        Mounting angles in degrees.
    path : path-like
        The ending chooses the format.

    Raises
    ------
    UsageError
        If the figure cannot be written.
    """
    rows, columns, sensors = expected.readings.shape
    width = 7.0 if columns <= 16 else 12.0
    down = math.ceil(sensors / 2)
    figure = new_figure(2 * width + 1.2, down * (width * rows / columns + 0.6), layout="compressed")
    axes = figure.subplots(down, 2, squeeze=False)
    norm = reading_scale(expected.readings)
    for axis in axes.flat[sensors:]:
        axis.set_axis_off()
    for sensor, axis in enumerate(axes.flat[:sensors]):
        plot.readings(expected.readings[..., sensor], axis, lab=lab, norm=norm)
        axis.set_title(f"sensor {sensor} at {angles[sensor]:g}°, robot's heading 0°", fontsize=10)
    label_outer(axes, sensors)
    if sensors:
        reading_bar(figure, axes.flat[0].images[-1], axes)
    save_figure(figure, Path(path))
