"""How right the motion models are: `python -m benchmarks.motion_exactness` prints a table.

Each model makes ten steps from a point mass, for ways of 1/1000 to 30 cells and noise of 1/1000 to 10 cells,
forward, backward, turning and still. The same model is sampled 100,000 times in continuous space, from the
centre of the same cell. Compared are mass, mean, covariance, and the total variation over blocks of cells.

What a belief over cells can have: a step whose mean is between cells has at least the variance r (1 - r)
square cells along each axis, r being its fraction, however little noise there is, and as much in the heading.
A drive that slants across the grid with a cell of noise or more has up to 1/4 across. So ten steps may add
2.5 square cells to the variance in any direction. What the heading's excess does to the ways after it is
computed: the samples "widened" turn with at least the noise r (1 - r). Motion that is carried adds neither;
there 1/4 square cell is allowed, because headings mix whose cells are off by different parts of a cell.
"""

from __future__ import annotations

import argparse
import itertools
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ciberrato.bayes.convolution import gaussian_kernel
from ciberrato.bayes.motion.blocked_shift import BlockedShift, Openings
from ciberrato.bayes.motion.gaussian_shift import GaussianShift
from ciberrato.bayes.motion.kernel import CommandKernel, KernelMotion
from ciberrato.bayes.motion.odometry import GaussianOdometry, OdometryNoise, OdometryReading
from ciberrato.bayes.motion.omnidirectional import (
    OmnidirectionalNoise,
    OmnidirectionalOdometry,
    OmnidirectionalReading,
)
from ciberrato.bayes.motion.passes import PoseCarry
from ciberrato.bayes.motion.shift import Shift
from ciberrato.bayes.motion.transition_matrix import TransitionMatrix, transition_matrix
from ciberrato.bayes.motion.turn_drive_turn import TurnDriveTurn
from ciberrato.bayes.motion.velocity import VelocityCommand, VelocityMotion, VelocityNoise
from ciberrato.bayes.motion.wheels import DifferentialWheels
from ciberrato.bayes.spaces import Axis, StateSpace

STEPS = 10
SAMPLES = 100_000
WAYS = (0.001, 0.03, 0.3, 1.0, 5.0, 30.0)
NOISES = (0.001, 0.03, 0.3, 1.0, 10.0)
MOTIONS = ("forward", "backward", "turning", "still")
CELLS = (0.1, 0.125)
"""Widths in x and y, in metres."""
BLOCK = 8
"""Cells of x and y in a block of the total variation."""

Move = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One run; way and noise in cells."""

    model: str
    motion: str
    way: float
    noise: float

    def __str__(self) -> str:
        return f"{self.model}, {self.motion}, way {self.way:g}, noise {self.noise:g}"


class Deviation(NamedTuple):
    """How far a belief is from the samples.

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


class Model(NamedTuple):
    """A case made ready.

    Attributes
    ----------
    sample : callable
        (poses, generator, widened) to poses one step on.
    start : callable
        Space to belief to belief, a step; the second gives the places of the cells, (*shape, axes).
    size : int
        Heading cells; 0 for models along a line.
    """

    sample: Callable[[np.ndarray, np.random.Generator, bool], np.ndarray]
    run: Callable[[StateSpace, np.ndarray], tuple[np.ndarray, np.ndarray]]
    headings: int
    carried: bool


def least(turn: float, sigma: float, width: float) -> float:
    """Give the least standard deviation that a turn between heading cells has on the grid."""
    rest = abs(turn / width - round(turn / width))
    return max(sigma, width * math.sqrt(rest * (1.0 - rest)))


def places(space: StateSpace, carry: Any = None) -> np.ndarray:
    """Give where the cells are, (*shape, axes)."""
    found = space.centres()
    if carry is not None:
        found[..., 2] += carry.turn
        found[..., :2] += carry.offset
    return found


def pose_model(case: Case) -> Model:
    """Make a model over poses ready."""
    carried = case.model.endswith("carried") or case.model == "DifferentialWheels"
    headings = 24 if case.way <= 1.0 else 72
    width = 2.0 * math.pi / headings
    way, sigma = case.way * CELLS[0], case.noise * CELLS[0]
    way *= {"backward": -1.0, "still": 0.0}.get(case.motion, 1.0)
    turn = {"turning": 0.57 * width}.get(case.motion, 0.0)
    spin = min(0.5 * case.noise * width, 2.0 / case.way, 0.5)
    control: Any

    if case.model.startswith(("GaussianOdometry", "TurnDriveTurn")):
        first = 0.37 * turn
        control = OdometryReading(rot1=first, trans=way, rot2=turn - first)
        noise = OdometryNoise(rotation=spin, translation=sigma)
        rest = turn - round(first / width) * width

        def sample(poses: np.ndarray, rng: np.random.Generator, widened: bool) -> np.ndarray:
            z = rng.standard_normal((3, len(poses)))
            ahead = poses[:, 2] + control.rot1 + spin * z[0]
            gone = way + sigma * z[1]
            last = least(rest, spin, width) if widened else spin
            return np.stack(
                [
                    poses[:, 0] + gone * np.cos(ahead),
                    poses[:, 1] + gone * np.sin(ahead),
                    ahead + control.rot2 + last * z[2],
                ],
                axis=1,
            )

        def make(space: StateSpace) -> Any:
            if case.model.startswith("GaussianOdometry"):
                return GaussianOdometry(space, noise)
            return TurnDriveTurn(space=space, noise=noise, window=6.1)

    elif case.model.startswith("VelocityMotion"):
        control = VelocityCommand(speed=way / 0.5, turning=turn / 0.5, duration=0.5)
        speeds = VelocityNoise(speed=sigma / 0.5, turning=spin / 0.5, final=spin / 0.5)

        def sample(poses: np.ndarray, rng: np.random.Generator, widened: bool) -> np.ndarray:
            z = rng.standard_normal((3, len(poses)))
            turned = turn + spin * z[0]
            chord = (way + sigma * z[1]) * np.sinc(0.5 * turned / np.pi)
            ahead = poses[:, 2] + 0.5 * turned
            last = least(turn, spin, width) if widened else spin
            return np.stack(
                [
                    poses[:, 0] + chord * np.cos(ahead),
                    poses[:, 1] + chord * np.sin(ahead),
                    poses[:, 2] + turned + last * z[2],
                ],
                axis=1,
            )

        def make(space: StateSpace) -> Any:
            return VelocityMotion(space=space, noise=speeds)

    elif case.model.startswith("OmnidirectionalOdometry"):
        left = 0.4 * way
        control = OmnidirectionalReading(forward=way, left=left, turn=turn)
        three = OmnidirectionalNoise(rotation=spin, translation=sigma, strafe=0.5 * sigma)
        bearing = math.atan2(left, way)

        def sample(poses: np.ndarray, rng: np.random.Generator, widened: bool) -> np.ndarray:
            z = rng.standard_normal((3, len(poses)))
            along, across = math.hypot(way, left) + sigma * z[0], 0.5 * sigma * z[1]
            ahead = poses[:, 2] + bearing
            last = least(turn, spin, width) if widened else spin
            return np.stack(
                [
                    poses[:, 0] + along * np.cos(ahead) - across * np.sin(ahead),
                    poses[:, 1] + along * np.sin(ahead) + across * np.cos(ahead),
                    poses[:, 2] + turn + last * z[2],
                ],
                axis=1,
            )

        def make(space: StateSpace) -> Any:
            return OmnidirectionalOdometry(space=space, noise=three)

    else:
        base = 0.4
        control = (way - 0.5 * turn * base, way + 0.5 * turn * base)
        # Noise in proportion to the wheels' ways: given sigma, as far as that does not turn too much.
        power = max(abs(control[0]), abs(control[1]), 1e-12)
        share = min(sigma / power, spin * base / power, 0.5)

        def sample(poses: np.ndarray, rng: np.random.Generator, widened: bool) -> np.ndarray:
            z = rng.standard_normal((2, len(poses)))
            one, two = (c * (1.0 + share * z[k]) for k, c in enumerate(control))
            gone = 0.5 * (one + two)
            return np.stack(
                [
                    poses[:, 0] + gone * np.cos(poses[:, 2]),
                    poses[:, 1] + gone * np.sin(poses[:, 2]),
                    poses[:, 2] + (two - one) / base,
                ],
                axis=1,
            )

        def make(space: StateSpace) -> Any:
            return DifferentialWheels(space=space, base=base, response=1.0, noise=share)

    def run(space: StateSpace, belief: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        model = make(space)
        if not carried:
            for _ in range(STEPS):
                belief = model.predict(belief, control)
            return belief, places(space)
        wheels = isinstance(model, DifferentialWheels)
        carry: Any = model.at_rest() if wheels else PoseCarry.none(space)
        for _ in range(STEPS):
            belief, carry = (model.predict if wheels else model.predict_carried)(belief, control, carry)
        return belief, places(space, carry)

    return Model(sample, run, headings, carried)


def line_model(case: Case) -> Model:
    """Make a model along a line ready: the steps of whole-cell models are drawn from their own kernels."""
    way = case.way * {"backward": -1.0, "still": 0.0}.get(case.motion, 1.0)
    whole = case.model in ("Shift", "BlockedShift", "KernelMotion", "TransitionMatrix")
    kernel = gaussian_kernel(way, case.noise**2)
    chances = {kernel.first + k: float(w) for k, w in enumerate(kernel.weights) if w > 0.0}
    slips = {-1: 0.1, 0: 0.8, 1: 0.1}
    made = round(abs(way))
    if case.model == "Shift":
        chances = {round(way): 1.0}
    elif case.model == "BlockedShift":
        made = max(made, 1)
        chances = {int(math.copysign(made + slip, way)): p for slip, p in slips.items()}
    cells, weights = np.array(list(chances)), np.array(list(chances.values()))

    def sample(poses: np.ndarray, rng: np.random.Generator, widened: bool) -> np.ndarray:
        if whole:
            return poses + CELLS[0] * rng.choice(cells, (len(poses), 1), p=weights / weights.sum())
        return poses + CELLS[0] * (way + case.noise * rng.standard_normal((len(poses), 1)))

    def run(space: StateSpace, belief: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        size, carry = len(belief), 0.0
        mixed = KernelMotion(kernels={"go": CommandKernel.from_displacements(chances)}, edges=("lose",))
        matrix = None
        if case.model == "TransitionMatrix":
            matrix = transition_matrix(mixed.predict, (size,), "go", sparse=True)
        shift = GaussianShift(cell=CELLS[0], sigma=case.noise * CELLS[0], edge="lose")
        blocked = BlockedShift(openings=Openings.free(1, size), arrival=slips)
        for _ in range(STEPS):
            if case.model == "Shift":
                belief = Shift(edges=("lose",)).predict(belief, round(way))
            elif case.model == "BlockedShift":
                belief = blocked.predict(belief[np.newaxis], ("west" if way < 0.0 else "east", made))[0]
            elif case.model == "KernelMotion":
                belief = mixed.predict(belief, "go")
            elif matrix is not None:
                belief = TransitionMatrix(matrices={"go": matrix}).predict(belief, "go")
            elif case.model == "GaussianShift, carried":
                belief, carry = shift.predict_carried(belief, way * CELLS[0], carry)
            else:
                belief = shift.predict(belief, way * CELLS[0])
        return belief, (space.axes[0].centres + carry)[:, np.newaxis]

    return Model(sample, run, 0, case.model.endswith("carried") or whole)


MODELS = (
    "GaussianOdometry",
    "GaussianOdometry, carried",
    "TurnDriveTurn",
    "TurnDriveTurn, carried",
    "VelocityMotion",
    "VelocityMotion, carried",
    "OmnidirectionalOdometry",
    "OmnidirectionalOdometry, carried",
    "DifferentialWheels",
    "GaussianShift",
    "GaussianShift, carried",
    "KernelMotion",
    "TransitionMatrix",
    "BlockedShift",
    "Shift",
)
LINES = MODELS[9:]


def cases(models: Sequence[str] = MODELS) -> list[Case]:
    """List what there is to try; a robot that stands still has only noise."""
    made = []
    for model, motion, way, noise in itertools.product(models, MOTIONS, WAYS, NOISES):
        if motion == "still" and way != WAYS[0]:
            continue
        if model in LINES and motion == "turning":
            continue
        if model == "Shift" and (noise != NOISES[0] or 0.0 < way < 1.0):
            continue
        made.append(Case(model=model, motion=motion, way=way, noise=noise))
    return made


def deviation(case: Case, seed: int = 1) -> Deviation:
    """Run a case and compare."""
    model = line_model(case) if case.model in LINES else pose_model(case)
    axes = 3 if model.headings else 1
    start = np.array([0.0, 0.0, 0.3])[:axes]
    true, wide = (_drawn(model, start, seed, widened) for widened in (False, True))
    if model.carried:
        wide = true
    space = _space(model, start, np.concatenate([true.box, wide.box]))
    belief, where = model.run(space, space.point_mass(start))
    return _compared(space, belief, where, true.poses, wide.poses, 0.25 if model.carried else 0.25 * STEPS)


def _drawn(model: Model, start: np.ndarray, seed: int, widened: bool) -> Samples:
    rng = np.random.default_rng(seed)
    poses = np.tile(start, (SAMPLES, 1))
    low, high = start.copy(), start.copy()
    for _ in range(STEPS):
        poses = model.sample(poses, rng, widened)
        low, high = np.minimum(low, poses.min(axis=0)), np.maximum(high, poses.max(axis=0))
    return Samples(poses, np.stack([low, high]))


def _space(model: Model, start: np.ndarray, box: np.ndarray) -> StateSpace:
    """Make a grid that holds all samples and what cells add; `start` is the centre of a cell."""
    axes = []
    for k, (name, cell) in enumerate(zip("xy", CELLS[: len(start)], strict=False)):
        before, after = (
            math.ceil(abs(end - start[k]) / cell) + 10 for end in (box[:, k].min(), box[:, k].max())
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

    (mean_b, cov_b), (mean_s, cov_s), (mean_w, cov_w) = (
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
        return np.floor((points - middle)[:, :axes] / cells[:axes] / BLOCK + 0.5).astype(int)

    ours, theirs = blocks(points), blocks(samples)
    low = np.minimum(ours.min(axis=0), theirs.min(axis=0))
    shape = np.maximum(ours.max(axis=0), theirs.max(axis=0)) - low + 1
    one, two = (np.ravel_multi_index(tuple((b - low).T), tuple(shape)) for b in (ours, theirs))
    size = int(np.prod(shape))
    difference = np.bincount(one, weights, size) - np.bincount(two, minlength=size) / len(samples)
    return float(0.5 * np.abs(difference).sum())


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the worst of each model and way."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.motion_exactness", description=__doc__.split("\n")[0]
    )
    parser.add_argument("model", nargs="*", help="any of the models' names (all)")
    parser.add_argument("--ways", type=float, nargs="+", default=WAYS, help="in cells (all)")
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
    chosen = [case for case in cases(options.model or MODELS) if case.way in options.ways]
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
