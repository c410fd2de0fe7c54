"""The lab as the agent stores it: walls, the sensors' cones in a cell, what they should read everywhere."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from agent.offline.summary import cell_name
from agent.views.figures.canvas import (
    LINE_COLOURS,
    draw_walls,
    label_outer,
    new_figure,
    save_figure,
    set_lab_axes,
    set_title,
)
from agent.views.figures.conepoint import nearest_point, sensor_point
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import HALF_APERTURE, ideal_reading
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.plaintext import plain
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
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.patches import Circle, Polygon

    figure = new_figure(10.0, 10.0 * lab.height / lab.width + 0.8)
    axis = figure.subplots()
    for column in range(1, lab.columns):
        axis.axvline(column * CELL_SIZE, color="0.9", linewidth=0.6, zorder=0)
    for row in range(1, lab.rows):
        axis.axhline(row * CELL_SIZE, color="0.9", linewidth=0.6, zorder=0)
    box = {
        "facecolor": "white",
        "alpha": 0.75,
        "edgecolor": "none",
        "pad": 0.8,
    }  # names stay legible on lines
    for number, target in enumerate(lab.targets):
        axis.add_patch(Circle((target.x, target.y), target.radius, facecolor="#d5ebf7", edgecolor="#56B4E9"))
        axis.annotate(
            f"T{number}", (target.x, target.y - 0.5), ha="center", va="center", fontsize=9, bbox=box
        )
    heights = [wall.height for wall in lab.walls if wall.height > 0]
    norm = Normalize(0.0, max([*heights, 4.0]))
    draw_walls(axis, lab)
    scale = ScalarMappable(norm=norm, cmap="cividis_r")
    for wall in lab.walls:
        if wall.height > 0:
            colour = scale.to_rgba(np.array([wall.height]))[0]
            axis.add_patch(
                Polygon(wall.corners, closed=True, facecolor=colour, edgecolor="black", lw=0.4, zorder=3)
            )
    for number, beacon in enumerate(lab.beacons):
        axis.plot(beacon.x, beacon.y, "*", color=LINE_COLOURS[5], markersize=11, zorder=4)
        label = f"B{number} (height {beacon.height:g})"
        axis.annotate(
            label, (beacon.x, beacon.y + 0.5), ha="center", va="center", fontsize=9, zorder=5, bbox=box
        )
    set_lab_axes(axis, lab.width, lab.height)
    size = f"{lab.width:g} x {lab.height:g} units, {lab.rows} x {lab.columns} cells"
    set_title(axis, f"{plain(lab.name, 40)}: {size}, {len(lab.walls)} walls")
    if len(set(heights)) > 1:
        figure.colorbar(scale, ax=axis, shrink=0.7, fraction=0.03, pad=0.01).set_label("wall height (units)")
    save_figure(figure, Path(path))


def sensor_cones(
    lab: Lab,
    cell: Cell,
    angles: Sequence[float],
    path: str | os.PathLike[str],
    *,
    model: str = "sensor",
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
        What the real sensor looks at, or the nearest point of the whole cone.
    heading : float
        The robot's, degrees.

    Raises
    ------
    UsageError
        If the figure cannot be written.
    """
    figure = new_figure(9.0, 9.0 * lab.height / lab.width + 0.9)
    axis = figure.subplots()
    draw_walls(axis, lab, colour="0.35")
    row, column = cell
    x, y = (column + 0.5) * CELL_SIZE, (row + 0.5) * CELL_SIZE
    draw_robot(axis, x, y, math.radians(heading))
    walls = WallMap.from_lab(lab)
    for number, angle in enumerate(angles):
        direction = math.radians(heading + angle)
        colour = LINE_COLOURS[number % len(LINE_COLOURS)]
        point = nearest_point(walls, x, y, direction, every_point=model == "cone")
        start = sensor_point(x, y, direction)
        if point is None:
            axis.plot([], [], "o", color=colour, label=f"sensor {number} at {angle:g}°: sees no wall")
            continue
        distance = math.dist(point, start)
        draw_cone(axis, start, direction, distance, colour)
        axis.plot([start[0], point[0]], [start[1], point[1]], color=colour, linewidth=1.2, zorder=5)
        label = (
            f"sensor {number} at {angle:g}°: distance {distance:.3f} units, "
            f"reading {ideal_reading(distance):.2f}"
        )
        axis.plot(*point, "o", color=colour, markersize=5, zorder=6, label=label)
    set_lab_axes(axis, lab.width, lab.height)
    sees = "nearest points of the whole cones" if model == "cone" else "what the simulator's sensors look at"
    set_title(axis, f"{plain(lab.name, 40)}, cell {cell_name(cell)}, heading {heading:g}°; dots: {sees}")
    figure.legend(loc="outside lower center", ncols=2, fontsize=9)
    save_figure(figure, Path(path))


def draw_robot(axis: Any, x: float, y: float, heading: float, *, colour: str = "#D55E00") -> list[Any]:
    """Draw a robot as a disc with a line to its front.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
    x, y : float
        Units.
    heading : float
        Radians.
    colour : str

    Returns
    -------
    list of matplotlib artists
    """
    from matplotlib.patches import Circle

    disc = axis.add_patch(Circle((x, y), ROBOT_RADIUS, facecolor=colour, edgecolor="black", lw=0.8, zorder=7))
    front = (x + ROBOT_RADIUS * math.cos(heading), y + ROBOT_RADIUS * math.sin(heading))
    (line,) = axis.plot([x, front[0]], [y, front[1]], color="black", linewidth=1.2, zorder=8)
    return [disc, line]


def draw_cone(axis: Any, start: tuple[float, float], direction: float, distance: float, colour: str) -> Any:
    """Draw a sensor's cone as far as it sees.

    Parameters
    ----------
    axis : matplotlib.axes.Axes
    start : (float, float)
        Place of the sensor.
    direction : float
        Its axis, radians.
    distance : float
        To the wall, units.
    colour : str

    Returns
    -------
    matplotlib.patches.Wedge
    """
    from matplotlib.patches import Wedge

    middle, half = math.degrees(direction), math.degrees(HALF_APERTURE)
    wedge = Wedge(
        start,
        distance,
        middle - half,
        middle + half,
        facecolor=colour,
        edgecolor=colour,
        alpha=0.4,
        lw=0.8,
        zorder=4,
    )
    return axis.add_patch(wedge)


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
    from matplotlib.colors import LogNorm

    rows, columns, sensors = expected.readings.shape
    width = 7.0 if columns <= 16 else 12.0
    down = math.ceil(sensors / 2)
    figure = new_figure(2 * width + 1.2, down * (width * rows / columns + 0.6), layout="compressed")
    axes = figure.subplots(down, 2, squeeze=False)
    low, high = max(float(expected.readings.min()), 0.02), min(float(expected.readings.max()), 10.0)
    norm = LogNorm(low, high, clip=True)
    image = None
    for sensor, axis in enumerate(axes.flat):
        if sensor >= sensors:
            axis.set_axis_off()
            continue
        values = expected.readings[..., sensor]
        extent = (0, columns * CELL_SIZE, 0, rows * CELL_SIZE)
        image = axis.imshow(values, origin="lower", extent=extent, cmap="cividis", norm=norm)
        draw_walls(axis, lab)
        for row in range(rows):
            for column in range(columns):
                value = values[row, column]
                axis.text(
                    (column + 0.5) * CELL_SIZE,
                    (row + 0.5) * CELL_SIZE,
                    f"{value:.2f}" if value < 9.995 else f"{value:.0f}",
                    ha="center",
                    va="center",
                    fontsize=8 if columns <= 16 else 6,
                    color="black" if norm(value) > 0.55 else "white",
                )
        set_lab_axes(axis, lab.width, lab.height)
        axis.set_title(f"sensor {sensor} at {angles[sensor]:g}°, robot's heading 0°", fontsize=10)
    label_outer(axes, sensors)
    if image is not None:
        bar = figure.colorbar(image, ax=axes, shrink=0.8, fraction=0.02, pad=0.01)
        bar.set_label("ideal reading, 1/distance (1/units)")
        ticks = [tick for tick in (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 1, 2, 3, 5, 10) if low <= tick <= high]
        bar.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
        bar.minorticks_off()
    save_figure(figure, Path(path))
