"""(x, y, heading) grids: 12 x 9 x 18 and a museum of 6 million states."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.measure import Row, absent, best_time
from ciberrato.bayes import GridFilter, compiled
from ciberrato.bayes.filtering import update
from ciberrato.bayes.motion.odometry import GaussianOdometry, OdometryNoise, OdometryReading
from ciberrato.bayes.motion.turn_drive_turn import TurnDriveTurn
from ciberrato.bayes.sensors.gaussian import GaussianSensor
from ciberrato.bayes.spaces import pose_grid

if TYPE_CHECKING:
    from examples import museum

SPACE = pose_grid((12, 9, 18), cell=0.3048, origin=(-1.6764, -1.3716, -math.pi))
NOISE = OdometryNoise(rotation=math.radians(15.0), translation=0.45)
CONTROL = OdometryReading(rot1=0.3, trans=0.6, rot2=-0.2)
UNIFORM, PEAKED, UPDATE = (
    "12x9x18 predict, uniform",
    "12x9x18 predict, peaked, cells < 1e-4 skipped",
    "12x9x18 update, 18 ranges",
)


def _gauss(x: float, sigma: float) -> float:
    return math.exp(-0.5 * (x / sigma) ** 2) / (sigma * math.sqrt(2.0 * math.pi))


def _wrap(angle: float) -> float:
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def loops(belief: np.ndarray, starts: list[tuple[int, ...]]) -> np.ndarray:
    """Predict by table 5.5 with a loop over pairs of cells, as a student writes it."""
    result = np.zeros(SPACE.shape)
    centres = [axis.centres.tolist() for axis in SPACE.axes]
    for i, j, k in starts:
        x, y, heading = centres[0][i], centres[1][j], centres[2][k]
        for a in range(12):
            for b in range(9):
                for c in range(18):
                    dx, dy = centres[0][a] - x, centres[1][b] - y
                    rot1 = _wrap(math.atan2(dy, dx) - heading)
                    trans = math.hypot(dx, dy)
                    rot2 = _wrap(centres[2][c] - heading - rot1)
                    p = _gauss(_wrap(rot1 - CONTROL.rot1), NOISE.rotation)
                    p *= _gauss(trans - CONTROL.trans, NOISE.translation)
                    p *= _gauss(_wrap(rot2 - CONTROL.rot2), NOISE.rotation)
                    result[a, b, c] += p * belief[i, j, k]
    return np.asarray(result / result.sum())


def all_pairs(belief: np.ndarray) -> np.ndarray:
    """Compute the same for all pairs with whole arrays."""
    centres = SPACE.centres().reshape(-1, 3)
    dx, dy = (centres[:, k] - centres[:, k, np.newaxis] for k in (0, 1))
    heading = centres[:, 2, np.newaxis]
    rot1 = np.arctan2(dy, dx) - heading
    rot2 = centres[:, 2] - heading - rot1
    scores = ((np.mod(rot1 - CONTROL.rot1 + np.pi, 2 * np.pi) - np.pi) / NOISE.rotation) ** 2
    scores += ((np.hypot(dx, dy) - CONTROL.trans) / NOISE.translation) ** 2
    scores += ((np.mod(rot2 - CONTROL.rot2 + np.pi, 2 * np.pi) - np.pi) / NOISE.rotation) ** 2
    result = belief.ravel() @ np.exp(-0.5 * scores)
    return np.asarray((result / result.sum()).reshape(SPACE.shape))


def course_grid() -> Iterator[Row]:
    """Yield predictions and the update of the course's grid."""
    rng = np.random.default_rng(1)
    uniform = SPACE.uniform()
    cells = list(np.ndindex(*SPACE.shape))
    some = [cells[k] for k in rng.choice(len(cells), 24, replace=False)]
    per_start = best_time(lambda: loops(uniform, some), repeats=2) / len(some)
    yield Row(
        group=UNIFORM,
        who="nested loops over pairs",
        seconds=per_start * len(cells),
        reference=True,
        note="24 of 1,944 start cells, scaled up",
    )
    yield Row(
        group=UNIFORM,
        who="numpy, all pairs at once",
        seconds=best_time(lambda: all_pairs(uniform)),
        megabytes=30.2 * 6,
    )
    exact, book = (
        GaussianOdometry(SPACE, NOISE),
        GaussianOdometry(SPACE, NOISE, density="book", normalized=False),
    )
    ours = book.predict(uniform, CONTROL)
    worst = np.abs(ours / ours.sum() - all_pairs(uniform)).max() / all_pairs(uniform).max()
    yield Row(
        group=UNIFORM,
        who="ours, table 5.5 density, new control",
        ours=True,
        target=1e-3,
        seconds=best_time(lambda: book.predict(uniform, CONTROL)),
        megabytes=4.4,
        note=f"exact: differs from all pairs by {worst:.0e}",
    )
    yield Row(
        group=UNIFORM,
        who="ours, right in mean and variance, new control",
        ours=True,
        target=1e-3,
        seconds=best_time(lambda: exact.predict(uniform, CONTROL)),
        megabytes=4.6,
        note="three passes with exact moments",
    )
    peaked = SPACE.point_mass((0.1, 0.1, 0.5))
    for _ in range(2):
        peaked = exact.predict(peaked, OdometryReading(trans=0.05))
        peaked, _ = update(peaked, -2.0 * np.square(SPACE.centres() - [0.1, 0.1, 0.5]).sum(axis=-1) / 0.09)
    heavy = [cell for cell in cells if peaked[cell] >= 1e-4]
    seconds = best_time(lambda: loops(peaked, heavy[:24]), repeats=2) / 24 * len(heavy)
    yield Row(
        group=PEAKED,
        who="nested loops over pairs",
        seconds=seconds,
        reference=True,
        note=f"{len(heavy)} cells hold more; 24 of them, scaled up",
    )
    skipping = GaussianOdometry(SPACE, NOISE, skip_below=1e-4)
    for model, name in ((exact, "ours, nothing skipped"), (skipping, "ours, skipping")):
        dropped = model.predict_with_losses(peaked, CONTROL).skipped
        yield Row(
            group=PEAKED,
            who=name,
            ours=True,
            seconds=best_time(partial(model.predict, peaked, CONTROL)),
            target=18e-3,
            note=f"{dropped:.1e} of the mass skipped",
        )
    mean, scan = rng.uniform(0.1, 3.0, (*SPACE.shape, 18)), rng.uniform(0.1, 3.0, 18)

    def course_update() -> np.ndarray:
        likelihood = np.prod(
            np.exp(-0.5 * ((mean - scan) / 0.6) ** 2) / (0.6 * math.sqrt(2 * math.pi)), axis=-1
        )
        posterior = uniform * likelihood
        return np.asarray(posterior / posterior.sum())

    sensor = GaussianSensor(sigma=0.6, normalized=False)
    expected = course_update()
    ours = update(uniform, sensor.log_likelihood(scan, mean)).posterior
    yield Row(
        group=UPDATE, who="numpy, product of densities", seconds=best_time(course_update), reference=True
    )
    yield Row(
        group=UPDATE,
        who="ours, logarithms",
        ours=True,
        target=0.25e-3,
        megabytes=mean.nbytes / 1e6,
        moved=float(mean.nbytes),
        seconds=best_time(lambda: update(uniform, sensor.log_likelihood(scan, mean))),
        note=f"differs by {np.abs(ours - expected).max():.0e}, and does not underflow",
    )
    prepared = sensor.prepare(mean)
    ours = update(uniform, prepared.log_likelihood(scan)).posterior
    yield Row(
        group=UPDATE,
        who="ours, prepared for the map",
        ours=True,
        target=0.25e-3,
        megabytes=mean.nbytes / 1e6,
        moved=float(mean.nbytes),
        seconds=best_time(lambda: update(uniform, prepared.log_likelihood(scan))),
        note=f"differs by {np.abs(ours - expected).max():.0e}",
    )


def museum_grid() -> Iterator[Row]:
    """Yield the museum's prediction, scan and update."""
    from examples import museum

    begin = time.perf_counter()
    hall = museum.build()
    built = time.perf_counter() - begin
    tour = museum.visit(hall, 1)
    belief = np.where(hall.free[:, :, np.newaxis], 1.0, 0.0) * np.ones(hall.space.shape[2])
    belief /= belief.sum()
    states = hall.space.size
    control, scan = tour.controls[0], tour.scans[1]
    size = belief.nbytes
    group = f"museum, {states / 1e6:.1f} million states"
    motion = TurnDriveTurn(space=hall.space, noise=museum.NOISE, free=hall.free)

    def look() -> np.ndarray:
        return hall.table.log_likelihood(scan, museum.BEAM.beam_log_likelihood, weight=museum.WEIGHT)

    fast_loops, plain = compiled.kernels(states), None
    compiled.use(plain)
    scores = look()
    # A beam model by plain loops, for a few states.
    places = np.argwhere(hall.free)[::3000]
    start = time.perf_counter()
    for i, j in places:
        x, y = hall.space.axes[0].centres[i], hall.space.axes[1].centres[j]
        for angle, reading in zip(hall.table.angles, scan, strict=True):
            expected = min(museum.MAX_RANGE, math.hypot(x, y) + angle)
            total = museum.BEAM.hit * _gauss(reading - expected, museum.BEAM.sigma)
            total += museum.BEAM.short * math.exp(-reading) + museum.BEAM.random / museum.MAX_RANGE
            math.log(total)
    per_state = (time.perf_counter() - start) / len(places)
    yield Row(
        group=group,
        who="nested loops, scan of 46 beams",
        seconds=per_state * states,
        reference=True,
        note=f"{len(places)} states, scaled up; ranges taken as known",
    )
    parts = {
        "ours, predict": (lambda: motion.predict(belief, control), 2 * size, 5 * size),
        "ours, scan of 46 beams": (
            look,
            hall.table.nbytes + scores.nbytes,
            hall.table.nbytes + 3 * scores.nbytes,
        ),
        "ours, update": (lambda: update(belief, scores), 2 * size + scores.nbytes, 3 * size),
    }
    other = np.empty_like(belief)
    copying = best_time(lambda: np.copyto(other, belief))
    yield Row(group=group, who="a belief read and written once", seconds=copying, moved=2.0 * size)
    for loops, name in ((plain, ""), (fast_loops, ", machine code")):
        if loops is None and name:
            yield from absent(group, f"ours{name}", "numba")
            continue
        compiled.use(loops)
        whole = 0.0
        for who, (work, moved, held) in parts.items():
            seconds = best_time(work, budget=3.0, repeats=4)
            whole += seconds
            yield Row(
                group=group,
                who=who + name,
                ours=True,
                seconds=seconds,
                megabytes=held / 1e6,
                moved=float(moved),
                note=f"{seconds / copying:.1f} times read and written",
            )
        yield Row(
            group=group,
            who=f"ours, all three{name}",
            ours=True,
            seconds=whole,
            target=(5.0 if name else 20.0) * copying,
            moved=float(sum(p[1] for p in parts.values())),
            megabytes=(5 * size + hall.table.nbytes) / 1e6,
            note=f"{whole / copying:.1f} times read and written; the table is made once, in {built:.1f} s",
        )
        for kind in (np.float64, np.float32) if name else (np.float64,):
            seconds = one_pass(GridFilter(belief, motion, dtype=kind), hall, tour)
            single = ", float32" if kind == np.float32 else ""
            yield Row(
                group=group,
                who=f"ours, GridFilter{name}{single}",
                ours=True,
                seconds=seconds,
                target=(5.0 if name else 20.0) * copying,
                note=f"{seconds / copying:.1f} times read and written; a step of a tour",
            )
    compiled.use(fast_loops)


def one_pass(robot: GridFilter, hall: museum.Museum, tour: museum.Tour) -> float:
    """Return the least time of a prediction and a scan's update, of the first ones of a tour but one."""
    from examples import museum

    best = math.inf
    for stop in range(8):
        begin = time.perf_counter()
        robot.predict(tour.controls[stop])
        robot.update(
            hall.table.scan(tour.scans[stop + 1], museum.BEAM.beam_log_likelihood, weight=museum.WEIGHT)
        )
        if stop:
            best = min(best, time.perf_counter() - begin)
    return best


def rows() -> Iterator[Row]:
    """Yield all rows."""
    yield from course_grid()
    yield from museum_grid()
