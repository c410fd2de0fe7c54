"""Exactness of the motion models: `python -m benchmarks.motion_exactness` prints a table.

Each model makes ten steps from a point mass, for ways of 1/1000 to 30 cells and noise of 1/1000 to 10 cells,
forward, backward, turning and still. The same model is sampled 100,000 times in continuous space, from the
centre of the same cell. Compared are mass, mean, covariance, and the total variation over blocks of cells.

What a belief over cells can have: a step whose mean is between cells has at least the variance r (1 - r)
square cells along each axis, r being its fraction, however little noise there is, and as much in the heading.
A drive that slants across the grid with a cell of noise or more has up to 1/4 across, carried or not. So ten
steps may add 2.5 square cells to the variance in any direction. What the heading's excess does to the ways
after it is computed: the samples "widened" turn with at least the noise r (1 - r). Motion that is carried
adds no r (1 - r); there 1/4 square cell is allowed, because headings mix whose cells are off by different
parts of a cell.
"""

from __future__ import annotations

import argparse
import itertools
import math
import sys
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from benchmarks.motion_cases import (
    CELLS,
    LINES,
    MODELS,
    STEPS,
    WAYS,
    Case,
    Model,
    cases,
    line_model,
    pose_model,
    selection,
)
from ciberrato.bayes.spaces import Axis, StateSpace

SAMPLES = 100_000
BLOCK = 8
"""Cells of x and y in a block of the total variation."""


class Deviation(NamedTuple):
    """Distance of a belief from the samples.

    Attributes
    ----------
    mass : float
        Difference of what is on the grid.
    mean : float
        Greatest along an axis, in cells, beyond four standard errors of the samples.
    missing, added : float
        In the direction where it is greatest, the share of the samples' variance that the belief lacks, and
        that it has beyond the samples widened and what cells add.
    variation : float
        Half the sum of the absolute differences over blocks of cells.
    """

    mass: float
    mean: float
    missing: float
    added: float
    variation: float


class Samples(NamedTuple):
    """Poses at the end, (n, axes), and the box of all poses on the way, (2, axes)."""

    poses: np.ndarray
    box: np.ndarray


def deviation(case: Case, seed: int = 1) -> Deviation:
    """Run a case and compare."""
    model = line_model(case) if case.model in LINES else pose_model(case)
    axes = 3 if model.headings else 1
    start = np.array([0.0, 0.0, 0.3])[:axes]
    true = wide = _drawn(model, start, seed, False)
    if case.motion == "turning" and not model.carried:
        wide = _drawn(model, start, seed, True)
    space = _space(model, start, np.concatenate([true.box, wide.box]))
    belief, where = model.run(space, space.point_mass(start))
    allowed = 0.25 if model.carried else 0.25 * STEPS
    if model.headings and model.carried and (case.noise > 0.7 or model.apart > 1.0):
        # Across the ways; or headings that mix have offsets that have nothing to do with each other.
        allowed += 0.25 * STEPS
    return _compared(space, belief, where, true.poses, wide.poses, allowed)


def limits(case: Case) -> Deviation:
    """Return what a case may deviate by.

    6 % of a variance of 100,000 samples are a dozen standard errors; heading cells of 15 degrees make 1 % of
    it. Where the ways of neighbouring headings end more than a cell apart, and the noise of the turns is
    finer than half a heading cell, the belief has rays there: nothing between them, and rare turns by a whole
    heading cell in the place of many small ones, which shorten the way more and so spread it along.
    """
    model = line_model(case) if case.model in LINES else pose_model(case)
    rays = max(0.0, model.apart - 1.0)
    return Deviation(1e-4, 0.05 + 0.05 * rays, 0.06, 0.06 + 0.3 * rays, 0.08 + 0.1 * rays)


def _drawn(model: Model, start: np.ndarray, seed: int, widened: bool) -> Samples:
    rng = np.random.default_rng(seed)
    poses = np.tile(start, (SAMPLES, 1))
    low, high = start.copy(), start.copy()
    for _ in range(STEPS):
        poses = model.sample(poses, rng, widened)
        low, high = np.minimum(low, poses.min(axis=0)), np.maximum(high, poses.max(axis=0))
    return Samples(poses, np.stack([low, high]))


def _space(model: Model, start: np.ndarray, box: np.ndarray) -> StateSpace:
    """Create a grid that holds all samples and what cells add; `start` is the centre of a cell."""
    # Rays may go where no sample does.
    margin = 10 + math.ceil(1.3 * STEPS * max(0.0, model.apart - 1.0))
    axes = []
    for k, (name, cell) in enumerate(zip("xy", CELLS[: len(start)], strict=False)):
        before, after = (
            math.ceil(abs(end - start[k]) / cell) + margin for end in (box[:, k].min(), box[:, k].max())
        )
        axes.append(
            Axis(name=name, size=before + after + 1, cell=cell, origin=start[k] - (before + 0.5) * cell)
        )
    if model.headings:
        width = 2.0 * math.pi / model.headings
        axes.append(
            Axis(
                name="heading", size=model.headings, cell=width, origin=start[2] - 0.5 * width, periodic=True
            )
        )
    return StateSpace(tuple(axes))


def _compared(
    space: StateSpace,
    belief: np.ndarray,
    where: np.ndarray,
    true: np.ndarray,
    wide: np.ndarray,
    allowed: float,
) -> Deviation:
    cells = np.array([axis.cell for axis in space.axes])
    mass = float(belief.sum())
    points, weights = where.reshape(-1, len(cells)), belief.ravel() / mass
    middle = wide.mean(axis=0)

    def moments(points: np.ndarray, weights: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        off = points - middle
        if len(cells) == 3:  # the short way round
            off[:, 2] -= 2.0 * math.pi * np.rint(off[:, 2] / (2.0 * math.pi))
        off /= cells
        mean = np.average(off, axis=0, weights=weights)
        return mean, np.cov(off.T, aweights=weights, bias=True).reshape(len(cells), -1)

    (mean_b, cov_b), (_, cov_s), (mean_w, cov_w) = (
        moments(p, w) for p, w in ((points, weights), (true, None), (wide, None))
    )
    errors = 4.0 * np.sqrt(np.diag(cov_w) / len(wide))
    eye = np.eye(len(cells))
    floor = 0.05 * eye
    missing = 1.0 - np.linalg.eigvals(np.linalg.solve(cov_s + floor, cov_b + floor)).real.min()
    added = np.linalg.eigvals(np.linalg.solve(cov_w + floor + allowed * eye, cov_b + floor)).real.max() - 1.0
    return Deviation(
        abs(mass - 1.0),
        float(np.maximum(np.abs(mean_b - mean_w) - errors, 0.0).max()),
        float(max(missing, 0.0)),
        float(max(added, 0.0)),
        _variation(points, weights, wide, cells),
    )


def _variation(points: np.ndarray, weights: np.ndarray, samples: np.ndarray, cells: np.ndarray) -> float:
    """Compare over blocks of x and y about the mean."""
    axes = min(2, len(cells))
    middle = samples.mean(axis=0)

    def blocks(points: np.ndarray) -> np.ndarray:
        return np.asarray(np.floor((points - middle)[:, :axes] / cells[:axes] / BLOCK + 0.5), dtype=int)

    ours, theirs = blocks(points), blocks(samples)
    low = np.minimum(ours.min(axis=0), theirs.min(axis=0))
    shape = np.maximum(ours.max(axis=0), theirs.max(axis=0)) - low + 1
    one, two = (np.ravel_multi_index(tuple((b - low).T), tuple(shape)) for b in (ours, theirs))
    size = int(np.prod(shape))
    difference = np.bincount(one, weights, size) - np.bincount(two, minlength=size) / len(samples)
    return float(0.5 * np.abs(difference).sum())


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the worst of each model and method."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.motion_exactness", description=__doc__.split("\n")[0]
    )
    parser.add_argument("model", nargs="*", help="any of the models' names (all)")
    parser.add_argument("--ways", type=float, nargs="+", default=WAYS, help="in cells (all)")
    parser.add_argument("--every", action="store_true", help="every noise with every way, not one each")
    parser.add_argument("--all", action="store_true", help="print every case, not the worst of each way")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.model if name not in MODELS]
    if unknown:
        print(f"no model {unknown[0]!r}: there are {'; '.join(MODELS)}", file=sys.stderr)
        return 2
    print("worst over noise and motions; mean in cells, variance missing and added beyond what cells add,")
    print(f"total variation over blocks of {BLOCK} cells")
    print(
        f"{'model':34}{'way/cell':>9}{'mass':>9}{'mean':>8}{'missing':>9}{'added':>8}{'TV':>7}{'cases':>7}{'s':>7}"
    )
    listed = (cases if options.every else selection)(options.model or MODELS)
    chosen = [case for case in listed if case.way in options.ways]
    for (model, way), group in itertools.groupby(
        sorted(chosen, key=lambda c: (MODELS.index(c.model), c.way)), key=lambda c: (c.model, c.way)
    ):
        begin, found = time.perf_counter(), []
        for case in group:
            found.append(deviation(case))
            if options.all:
                print(f"  {case!s:70}" + "".join(f"{v:9.3g}" for v in found[-1]), flush=True)
        mass, mean, missing, added, variation = np.max(found, axis=0)
        print(
            f"{model:34}{way:9g}{mass:9.0e}{mean:8.3f}{missing:9.1%}{added:8.1%}{variation:7.3f}"
            f"{len(found):7}{time.perf_counter() - begin:7.1f}",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
