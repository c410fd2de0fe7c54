"""The cases in which `benchmarks.motion_exactness` compares motion models with samples of them."""

from __future__ import annotations

import itertools
import math
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
from ciberrato.bayes.spaces import StateSpace

STEPS = 10
WAYS = (0.001, 0.03, 0.3, 1.0, 5.0, 30.0)
NOISES = (0.001, 0.03, 0.3, 1.0, 10.0)
MOTIONS = ("forward", "backward", "turning", "still")
CELLS = (0.1, 0.125)
"""Widths in x and y, in metres."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One run; way and noise in cells."""

    model: str
    motion: str
    way: float
    noise: float

    def __str__(self) -> str:
        return f"{self.model}, {self.motion}, way {self.way:g}, noise {self.noise:g}"


class Model(NamedTuple):
    """A case made ready.

    Attributes
    ----------
    sample : callable
        (poses, generator, widened) to poses one step on.
    run : callable
        Space and belief to the belief after all steps, and the places of its cells, (*shape, axes).
    headings : int
        Heading cells; 0 for models along a line.
    carried : bool
        Whether fractions of cells are carried, or there are none.
    apart : float
        Distance of the ends of two neighbouring headings' paths, in cells.
    """

    sample: Callable[[np.ndarray, np.random.Generator, bool], np.ndarray]
    run: Callable[[StateSpace, np.ndarray], tuple[np.ndarray, np.ndarray]]
    headings: int
    carried: bool
    apart: float = 0.0


def least(turn: float, sigma: float, width: float) -> float:
    """Return the least standard deviation that a turn between heading cells has on the grid."""
    rest = abs(turn / width - round(turn / width))
    return max(sigma, width * math.sqrt(rest * (1.0 - rest)))


def places(space: StateSpace, carry: Any = None) -> np.ndarray:
    """Return where the cells are, (*shape, axes)."""
    found = space.centres()
    if carry is not None:
        found[..., 2] += carry.turn
        found[..., :2] += carry.offset
    return found


def pose_model(case: Case) -> Model:
    """Prepare a model over poses."""
    carried = case.model.endswith("carried") or case.model == "DifferentialWheels"
    headings = 12 if case.noise >= 10.0 else 24
    width = 2.0 * math.pi / headings
    way, sigma = case.way * CELLS[0], case.noise * CELLS[0]
    way *= {"backward": -1.0, "still": 0.0}.get(case.motion, 1.0)
    turn = {"turning": 0.57 * width}.get(case.motion, 0.0)
    spin = min(0.5 * case.noise * width, 0.5 / case.way, 0.2)
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

    return Model(sample, run, headings, carried, case.way * width)


def line_model(case: Case) -> Model:
    """Prepare a model along a line: the steps of whole-cell models are drawn from their own kernels."""
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


def selection(models: Sequence[str] = MODELS) -> list[Case]:
    """Return one noise for each model, motion and method, so that noises meet methods and motions in turn.

    Wide grids, of the greatest noise and the longest ways, are there once for each model, twice for
    `TurnDriveTurn`, and not for the carried models that are made of its passes and take longest.
    """
    slowest = ("GaussianOdometry, carried", "VelocityMotion, carried")
    longest = {"TurnDriveTurn": ("forward", "turning"), "TurnDriveTurn, carried": ("backward",)}
    kept = []
    for case in cases(models):
        shift = WAYS.index(case.way) + 2 * MOTIONS.index(case.motion) + MODELS.index(case.model)
        chosen = case.noise == NOISES[shift % (len(NOISES) - 1)]
        if case.noise == NOISES[-1]:
            chosen = case.motion == "forward" and case.way == 0.3 and case.model not in slowest
        elif case.way == WAYS[-1] and case.model not in LINES:
            motions = longest.get(case.model, ("forward",))
            chosen = chosen and case.motion in motions and case.model not in slowest
        if chosen or case.model == "Shift":
            kept.append(case)
    return kept
