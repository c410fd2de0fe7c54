"""A robot with a laser scanner lost in a museum: (x, y, heading) over a hall of 42 m x 32 m.

An occupancy grid of 0.2 m cells with ten rooms alike, a hall with pillars at equal distances, and little that
tells one place from another; scans of 180 degrees in 46 beams; visitors who stand in the way of some. The
belief has 210 x 160 x 180 = 6 million states, begins uniform over the free space, and is predicted with the
odometry and corrected with the beam model (hit, short, max, random) at every stop. Beams share what the
cell's centre does not show, so their likelihood is weighed down (`WEIGHT`).
"""

from __future__ import annotations

import itertools
import math
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ciberrato.bayes import entropy_bits, marginal, most_likely_cell
from ciberrato.bayes.arraytypes import BoolArray, FloatArray
from ciberrato.bayes.filtering import update
from ciberrato.bayes.maps.occupancy import OccupancyGrid
from ciberrato.bayes.motion.odometry import OdometryNoise, OdometryReading
from ciberrato.bayes.motion.turn_drive_turn import TurnDriveTurn
from ciberrato.bayes.sensors.beam import BeamModel
from ciberrato.bayes.sensors.scan_table import ScanTable
from ciberrato.bayes.spaces import StateSpace, pose_grid
from ciberrato.bayes.summaries import modes
from examples.figures import panels, save

TITLE = "A laser in a museum: 6 million poses, passers-by, from a uniform belief"

WIDTH, DEPTH = 42.0, 32.0
MAX_RANGE = 8.0
NOISE = OdometryNoise(rotation=math.radians(3.0), translation=0.08, alpha1=0.01, alpha3=0.003)
BEAM = BeamModel(
    hit=0.72,
    short=0.16,
    longest=0.04,
    random=0.08,
    sigma=0.25,
    decay=0.2,
    max_range=MAX_RANGE,
    resolution=0.05,
)
WEIGHT = 0.12
SHOWN = (1, 2, 3, 13, 21)
# Way points of the tour; the robot stops every 1.1 m or so.
TOUR = (
    (10.6, 6.2),
    (13.0, 6.2),
    (13.0, 10.0),
    (22.4, 10.0),
    (22.4, 15.2),
    (28.6, 15.2),
    (28.6, 10.4),
    (38.0, 10.4),
)
STOP_EVERY = 1.0

# Of the figure: metres that the zoom shows, and which hypotheses are marked in the hall.
CMAP = "YlOrRd"
ZOOM = 6.0
MOST_MARKS = 12
LEAST_MARKED = 0.01


class Museum(NamedTuple):
    """The hall and what follows from its resolution.

    Attributes
    ----------
    grid : OccupancyGrid
    space : StateSpace
    free : BoolArray, shape (x, y)
    table : ScanTable
    motion : TurnDriveTurn
    """

    grid: OccupancyGrid
    space: StateSpace
    free: BoolArray
    table: ScanTable
    motion: TurnDriveTurn


class Tour(NamedTuple):
    """Outcome of a drive; poses are x / m, y / m, heading / rad.

    Attributes
    ----------
    truth : FloatArray, shape (stops, 3)
    controls : tuple of OdometryReading
    scans : FloatArray, shape (stops, beams)
    """

    truth: FloatArray
    controls: tuple[OdometryReading, ...]
    scans: FloatArray


class Stop(NamedTuple):
    """The filter at one stop; times in seconds."""

    belief_over_places: FloatArray
    best_pose: FloatArray
    mass_near_truth: float
    entropy: float
    predict_time: float
    update_time: float


def hall(cell: float) -> OccupancyGrid:
    """Build the map; lengths are multiples of 0.4 m, so that coarse and fine grids show the same hall."""
    x = (np.arange(round(WIDTH / cell)) + 0.5)[:, np.newaxis] * cell
    y = (np.arange(round(DEPTH / cell)) + 0.5) * cell
    occupied = (x < 0.4) | (x > WIDTH - 0.4) | (y < 0.4) | (y > DEPTH - 0.4)

    def box(x0: float, y0: float, x1: float, y1: float) -> None:
        nonlocal occupied
        occupied = occupied | ((x > x0) & (x < x1) & (y > y0) & (y < y1))

    # Five rooms alike on either side, each with a door to the hall and a show-case; on the far side half a
    # turn round.
    for k in range(5):
        left = 8.4 * k
        for room in (
            (left, 7.6, left + 3.2, 8.0), (left + 5.6, 7.6, left + 8.4, 8.0),
            (left + 8.0, 0.0, left + 8.4, 8.0), (left + 1.6, 2.0, left + 2.8, 4.8),
        ):  # fmt: skip
            box(*room)
            box(WIDTH - room[2], DEPTH - room[3], WIDTH - room[0], DEPTH - room[1])
    # Pillars in the hall at equal distances, and what tells its ends apart.
    for k in range(6):
        box(3.6 + 6.8 * k, 12.0, 4.4 + 6.8 * k, 12.8)
        box(3.6 + 6.8 * k, 19.2, 4.4 + 6.8 * k, 20.0)
    for odd in ((30.0, 14.4, 35.2, 15.6), (20.0, 16.4, 20.8, 18.8), (6.0, 16.0, 9.2, 16.4)):
        box(*odd)
    return OccupancyGrid(occupied=occupied, cell=cell)


def build(cell: float = 0.2, headings: int = 180) -> Museum:
    """Create map, space, range table and motion model."""
    grid = hall(cell)
    space = pose_grid((*grid.occupied.shape, headings), cell=cell)
    free = ~grid.occupied
    # From 88 degrees right to 92 left, 46 beams 4 degrees apart.
    spacing = max(1, headings // 90)
    table = ScanTable(
        space, free, grid.cast, beams=headings // 2 // spacing + 1, spacing=spacing, max_range=MAX_RANGE
    )
    return Museum(grid, space, free, table, TurnDriveTurn(space=space, noise=NOISE, free=free))


def visit(museum: Museum, seed: int) -> Tour:
    """Simulate the tour: noisy odometry, and visitors in some beams."""
    rng = np.random.default_rng(seed)
    poses = []
    for (x0, y0), (x1, y1) in itertools.pairwise(TOUR):
        way = math.hypot(x1 - x0, y1 - y0)
        stops = round(way / STOP_EVERY)
        poses += [
            (x0 + (x1 - x0) * k / stops, y0 + (y1 - y0) * k / stops, math.atan2(y1 - y0, x1 - x0))
            for k in range(stops)
        ]
    truth = np.array(poses)
    truth[:, 2] += math.radians(4.0) * rng.standard_normal(len(truth))
    controls = []
    for before, after in itertools.pairwise(truth):
        true = OdometryReading.between(before, after)
        rot1, trans, rot2 = NOISE.sigmas(true)
        controls.append(
            OdometryReading(
                rot1=true.rot1 + rot1 * rng.standard_normal(),
                trans=true.trans + trans * rng.standard_normal(),
                rot2=true.rot2 + rot2 * rng.standard_normal(),
            )
        )
    ranges = museum.grid.cast(truth[:, :1], truth[:, 1:2], truth[:, 2:] + museum.table.angles, MAX_RANGE)
    scans = np.clip(ranges + 0.05 * rng.standard_normal(ranges.shape), 0.0, MAX_RANGE)
    scans[ranges >= MAX_RANGE] = MAX_RANGE
    # Each visitor hides a fan of beams, nearer than whatever is behind.
    for scan in scans:
        for _ in range(rng.integers(2, 7)):
            first, width = int(rng.integers(0, len(scan))), int(rng.integers(2, 6))
            scan[first : first + width] = np.minimum(scan[first : first + width], rng.uniform(0.6, 5.0))
    return Tour(truth, tuple(controls), scans)


def localize(museum: Museum, tour: Tour) -> list[Stop]:
    """Filter from a belief that is uniform over the free space."""
    space = museum.space
    belief = np.where(museum.free[:, :, np.newaxis], 1.0, 0.0) * np.ones(space.shape[2])
    belief /= belief.sum()
    centres = [axis.centres for axis in space.axes]
    result = []
    for step, scan in enumerate(tour.scans):
        begin = time.perf_counter()
        if step:
            belief = museum.motion.predict(belief, tour.controls[step - 1])
        middle = time.perf_counter()
        scores = museum.table.log_likelihood(scan, BEAM.beam_log_likelihood, weight=WEIGHT)
        belief, _ = update(belief, scores, on_impossible="likelihood", out=belief)
        end = time.perf_counter()
        x, y, heading = tour.truth[step]
        near = (np.hypot(centres[0][:, np.newaxis] - x, centres[1] - y) <= 0.5)[:, :, np.newaxis] & (
            np.abs(space.axes[2].difference(centres[2], heading)) <= math.radians(10.0)
        )
        result.append(
            Stop(
                marginal(belief, space, "x", "y"),
                space.pose(most_likely_cell(belief)),
                float(belief[near].sum()),
                entropy_bits(belief),
                middle - begin,
                end - middle,
            )
        )
    return result


def run(output: Path, seed: int) -> list[Path]:
    """Print what the filter knows at each stop and draw stops 1, 2, 3, 13 and 21."""
    begin = time.perf_counter()
    museum = build()
    built = time.perf_counter() - begin
    tour = visit(museum, seed)
    stops = localize(museum, tour)
    free = int(museum.free.sum())
    print(f"{museum.space.size:,} states, {free:,} free places")
    print(f"range table of {museum.table.nbytes / 1e6:.0f} MB made in {built:.1f} s")
    print("scan  entropy/bits  mass within 0.5 m, 10 deg  best off by/m  predict/s  update/s")
    for step, stop in enumerate(stops):
        off = math.hypot(*(stop.best_pose[:2] - tour.truth[step, :2]))
        print(
            f"{step + 1:4}  {stop.entropy:12.2f}  {stop.mass_near_truth:25.3f}  {off:13.2f}  "
            f"{stop.predict_time:9.3f}  {stop.update_time:8.3f}"
        )
    return [_draw(museum, tour, stops, output / "museum.png")]


def _draw(museum: Museum, tour: Tour, stops: list[Stop], path: Path) -> Path:
    from matplotlib.colors import LogNorm
    from matplotlib.patches import Rectangle

    figure, axes = panels(
        len(SHOWN), 3, (15, 4.05 * len(SHOWN)), layout="compressed", width_ratios=(1.31, 1.0, 1.31)
    )
    extent = (0.0, WIDTH, 0.0, DEPTH)
    walls = np.where(museum.grid.occupied.T, 1.0, np.nan)
    norm = LogNorm(1e-5, 1.0)
    for (hall_axis, near, seen), number in zip(axes, SHOWN, strict=True):
        stop, (x, y) = stops[number - 1], tour.truth[number - 1, :2]
        for axis in (hall_axis, near):
            image = axis.imshow(
                stop.belief_over_places.T + 1e-12, origin="lower", extent=extent, cmap=CMAP, norm=norm
            )
            axis.imshow(walls, origin="lower", extent=extent, cmap="Greys", vmin=0.0, vmax=1.4)
            axis.plot(x, y, "o", mfc="none", mec="tab:red", mew=1.5, ms=9 if axis is hall_axis else 22)
        corner = _window(x, WIDTH), _window(y, DEPTH)
        hall_axis.add_patch(Rectangle(corner, ZOOM, ZOOM, fill=False, ec="tab:red", lw=1.0))
        _mark_hypotheses(hall_axis, stop.belief_over_places)
        hall_axis.set_title(f"scan {number}: belief over places, {stop.entropy:.1f} bits", fontsize=10)
        near.set_title(f"near the truth: {stop.mass_near_truth:.3f} within 0.5 m and 10°", fontsize=10)
        near.set(xlim=(corner[0], corner[0] + ZOOM), ylim=(corner[1], corner[1] + ZOOM))
        _draw_scan(seen, museum, tour, number, walls)
        for axis in (hall_axis, near, seen):
            axis.set(xlabel="x / m", ylabel="y / m", aspect="equal")
    figure.colorbar(
        image,
        ax=axes,
        location="bottom",
        fraction=0.012,
        pad=0.01,
        label="probability of the place (0.2 m x 0.2 m)",
    )
    figure.suptitle("red ring: true place; blue numbers: hypotheses in percent", fontsize=11)
    return save(figure, path)


def _window(middle: float, length: float) -> float:
    """Return where a window of `ZOOM` metres round a place begins; it does not leave the hall."""
    return min(max(middle - ZOOM / 2, 0.0), length - ZOOM)


def _mark_hypotheses(axis: Any, belief: FloatArray) -> None:
    cell = WIDTH / belief.shape[0]
    for hill in modes(belief)[:MOST_MARKS]:
        if hill.mass < LEAST_MARKED:
            break
        place = (np.array(hill.peak) + 0.5) * cell
        axis.plot(*place, "o", mfc="none", mec="tab:blue", mew=1.2, ms=15)
        axis.annotate(
            f"{100 * hill.mass:.0f}",
            place,
            textcoords="offset points",
            xytext=(0, 10),
            ha="center",
            fontsize=9,
            color="tab:blue",
            weight="bold",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5},
        )


def _draw_scan(axis: Any, museum: Museum, tour: Tour, number: int, walls: FloatArray) -> None:
    (x, y, heading), scan = tour.truth[number - 1], tour.scans[number - 1]
    axis.imshow(walls, origin="lower", extent=(0.0, WIDTH, 0.0, DEPTH), cmap="Greys", vmin=0.0, vmax=1.4)
    directions = heading + museum.table.angles
    ends = np.column_stack([x + scan * np.cos(directions), y + scan * np.sin(directions)])
    for end in ends:
        axis.plot([x, end[0]], [y, end[1]], color="tab:orange", lw=0.4)
    axis.plot(*ends.T, ".", color="tab:red", ms=3)
    axis.plot(*tour.truth[:number, :2].T, "-", color="tab:green", lw=2)
    axis.quiver(x, y, math.cos(heading), math.sin(heading), color="tab:green", scale=25)
    axis.set(xlim=(0, WIDTH), ylim=(0, DEPTH))
    axis.set_title("scan (orange) and way so far (green), visitors included", fontsize=10)
