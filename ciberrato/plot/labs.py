"""The lab: its walls and what is in it, the cones of the sensors, what they should read everywhere."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import HALF_APERTURE, ideal_reading
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.plaintext import plain
from ciberrato.plot.canvas import LINE_COLOURS, add_legend, draw_walls, set_lab_axes, set_title, start_map
from ciberrato.plot.conepoint import nearest_point, sensor_point
from ciberrato.world.coordinates import Point, Pose
from ciberrato.world.lab import CELL_SIZE, Lab
from ciberrato.world.start_grid import StartGrid

_BOX = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.8}  # names stay legible on lines
_START_COLOUR = "#009E73"
_MOST_CELLS = 200  # along one side; the lines between more would be a grey area


def lab(lab: Lab, ax: Any = None, *, grid: StartGrid | None = None, legend: bool | None = None) -> Any:
    """Draw a lab: walls coloured by height, lines dotted, beacons, targets, starts, the grid of cells.

    Parameters
    ----------
    lab : Lab
    ax : matplotlib.axes.Axes, optional
        Default: those of a new figure.
    grid : StartGrid, optional
        Start positions to draw, with their numbers from 1.
    legend : bool, optional
        Whether to add a colour bar of the walls' heights, if they differ; default: in a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        In units, x to the right, y up.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import Normalize
    from matplotlib.patches import Circle

    ax, new = start_map(ax, lab.width, lab.height)
    if max(lab.columns, lab.rows) <= _MOST_CELLS:
        for column in range(1, lab.columns):
            ax.axvline(column * CELL_SIZE, color="0.9", linewidth=0.6, zorder=0)
        for row in range(1, lab.rows):
            ax.axhline(row * CELL_SIZE, color="0.9", linewidth=0.6, zorder=0)
    for number, target in enumerate(lab.targets):
        ax.add_patch(Circle((target.x, target.y), target.radius, facecolor="#d5ebf7", edgecolor="#56B4E9"))
        ax.annotate(f"T{number}", (target.x, target.y - 0.5), ha="center", va="center", fontsize=9, bbox=_BOX)
    heights = [wall.height for wall in lab.walls if wall.height > 0]
    draw_walls(ax, lab)
    scale = ScalarMappable(norm=Normalize(0.0, max([*heights, 4.0])), cmap="cividis_r")
    solid = [wall.corners for wall in lab.walls if wall.height > 0]
    colours = scale.to_rgba(np.array(heights, np.float64))
    polygons = PolyCollection(solid, facecolors=colours, edgecolors="black", linewidths=0.4, zorder=3)
    polygons.set_joinstyle("miter")
    ax.add_collection(polygons)
    for number, beacon in enumerate(lab.beacons):
        ax.plot(beacon.x, beacon.y, "*", color=LINE_COLOURS[5], markersize=11, zorder=4)
        label = f"B{number} (height {beacon.height:g})"
        place = (beacon.x, beacon.y + 0.5)
        ax.annotate(label, place, ha="center", va="center", fontsize=9, zorder=5, bbox=_BOX)
    for number, position in enumerate(() if grid is None else grid.positions, 1):
        _draw_start(ax, number, (position.x, position.y, math.radians(position.direction_deg)))
    set_lab_axes(ax, lab.width, lab.height)
    size = f"{lab.width:g} x {lab.height:g} units, {lab.rows} x {lab.columns} cells"
    set_title(ax, f"{plain(lab.name, 40)}: {size}, {len(lab.walls)} walls")
    if (new if legend is None else legend) and len(set(heights)) > 1:
        bar = ax.figure.colorbar(scale, ax=ax, shrink=0.7, fraction=0.03, pad=0.01)
        bar.set_label("wall height (units)")
    return ax


def cones(
    lab: Lab,
    pose: Pose,
    ax: Any = None,
    *,
    angles: Sequence[float] = (0.0, 60.0, -60.0, 180.0),
    model: Literal["sensor", "cone"] = "sensor",
    legend: bool | None = None,
) -> Any:
    """Draw a robot, the cone of each IR sensor, and the wall point that its distance belongs to.

    Parameters
    ----------
    lab : Lab
    pose : (x, y, heading)
        Units and radians.
    ax : matplotlib.axes.Axes, optional
        Default: those of a new figure.
    angles : sequence of float
        Mounting angles of the sensors in degrees, counter-clockwise from the front.
    model : {"sensor", "cone"}
        Sensor model: the real sensor's beams, or the nearest point of the whole cone.
    legend : bool, optional
        Whether to add distances and readings below; default: in a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        In units; a line with a label for each sensor.
    """
    ax, new = start_map(ax, lab.width, lab.height)
    draw_walls(ax, lab, colour="0.35")
    x, y, heading = pose
    draw_robot(ax, x, y, heading)
    walls = WallMap.from_lab(lab)
    for number, angle in enumerate(angles):
        direction = heading + math.radians(angle)
        colour = LINE_COLOURS[number % len(LINE_COLOURS)]
        point = nearest_point(walls, x, y, direction, every_point=model == "cone")
        start = sensor_point(x, y, direction)
        if point is None:
            ax.plot([], [], "o", color=colour, label=f"sensor {number} at {angle:g}°: sees no wall")
            continue
        distance = math.dist(point, start)
        draw_cone(ax, start, direction, distance, colour)
        ax.plot([start[0], point[0]], [start[1], point[1]], color=colour, linewidth=1.2, zorder=5)
        label = (
            f"sensor {number} at {angle:g}°: distance {distance:.3f} units, "
            f"reading {ideal_reading(distance):.2f}"
        )
        ax.plot(*point, "o", color=colour, markersize=5, zorder=6, label=label)
    set_lab_axes(ax, lab.width, lab.height)
    if new if legend is None else legend:
        add_legend(ax)
    return ax


def readings(
    values: Floats, ax: Any = None, *, lab: Lab | None = None, norm: Any = None, legend: bool | None = None
) -> Any:
    """Draw what one sensor should read in every cell: a colour and a number in each.

    Parameters
    ----------
    values : ndarray, shape (rows, columns)
        Ideal readings, 1/units, positive; row 0 is the bottom row of the lab. One sensor's of
        `ciberrato.infrared.model.cell_readings`.
    ax : matplotlib.axes.Axes, optional
        Default: those of a new figure.
    lab : Lab, optional
        Whose walls to draw.
    norm : matplotlib.colors.Normalize, optional
        Scale of the colours; default: `reading_scale` of the values.
    legend : bool, optional
        Whether to add a colour bar; default: in a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        In units; its last image is that of the readings.
    """
    values = np.asarray(values, np.float64)
    if values.ndim != 2:
        raise ValueError(f"values: shape {values.shape}; the readings of one sensor have (rows, columns)")
    rows, columns = values.shape
    ax, new = start_map(ax, columns, rows)
    norm = reading_scale(values) if norm is None else norm
    extent = (0, columns * CELL_SIZE, 0, rows * CELL_SIZE)
    image = ax.imshow(values, origin="lower", extent=extent, cmap="cividis", norm=norm)
    if lab is not None:
        draw_walls(ax, lab)
    for row in range(rows):
        for column in range(columns):
            value = values[row, column]
            ax.text(
                (column + 0.5) * CELL_SIZE,
                (row + 0.5) * CELL_SIZE,
                f"{value:.2f}" if value < 9.995 else f"{value:.0f}",
                ha="center",
                va="center",
                fontsize=8 if columns <= 16 else 6,
                color="black" if norm(value) > 0.55 else "white",
            )
    set_lab_axes(ax, *((extent[1], extent[3]) if lab is None else (lab.width, lab.height)))
    if new if legend is None else legend:
        reading_bar(ax.figure, image, ax)
    return ax


def reading_scale(values: Floats) -> Any:
    """Create the logarithmic colour scale of readings: from 0.02 to 10 at most.

    Returns
    -------
    matplotlib.colors.Normalize
    """
    from matplotlib.colors import LogNorm

    low, high = max(float(values.min()), 0.02), min(float(values.max()), 10.0)
    return LogNorm(low, max(high, 1.001 * low), clip=True)


def reading_bar(figure: Any, image: Any, axes: Any) -> None:
    """Add the colour bar of readings beside axes."""
    bar = figure.colorbar(image, ax=axes, shrink=0.8, fraction=0.02, pad=0.01)
    bar.set_label("ideal reading, 1/distance (1/units)")
    low, high = image.norm.vmin, image.norm.vmax
    ticks = [tick for tick in (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 1, 2, 3, 5, 10) if low <= tick <= high]
    bar.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    bar.minorticks_off()


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


def draw_cone(axis: Any, start: Point, direction: float, distance: float, colour: str) -> Any:
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


def _draw_start(axis: Any, number: int, pose: Pose) -> None:
    """Draw a start position as a ring with a line to its front, and its number."""
    from matplotlib.patches import Circle

    x, y, heading = pose
    axis.add_patch(Circle((x, y), ROBOT_RADIUS, facecolor="none", edgecolor=_START_COLOUR, lw=1.2, zorder=6))
    front = (x + ROBOT_RADIUS * math.cos(heading), y + ROBOT_RADIUS * math.sin(heading))
    axis.plot([x, front[0]], [y, front[1]], color=_START_COLOUR, lw=1.2, zorder=6)
    axis.annotate(str(number), (x, y), ha="center", va="center", fontsize=7, color=_START_COLOUR, zorder=7)
