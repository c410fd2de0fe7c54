"""A robot going round a circular hallway of 850 cm with three doors that look alike.

850 cm in cells of 5 cm; doors at 222, 326 and 611 cm, 90 cm = 4 sigma wide; 20 cm a step with an odometry
sigma of 5 cm; 500 steps; a reading only when a door is passed. All Gaussians wind round the circle.

A published solution of this exercise makes three mistakes, which `solve_literally` repeats to show what they
cost: it divides the prediction by a trace instead of its sum, it corrects the belief from before the
prediction, and it never tests the last door.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ciberrato.bayes import moments
from ciberrato.bayes.arraytypes import BoolArray, FloatArray, IntArray
from ciberrato.bayes.filtering import update
from ciberrato.bayes.motion.gaussian_shift import GaussianShift
from ciberrato.bayes.sensors.detector import DoorDetector
from ciberrato.bayes.spaces import line
from examples.figures import panels, save

TITLE = "Circular hallway with doors: 850 cm, three doors that look alike, 500 steps"

SPACE = line(170, cell=5.0, unit="cm", periodic=True)
CENTRES = SPACE.axes[0].centres
DOORS = (222.0, 326.0, 611.0)
SPEED, ODOMETRY_SIGMA, STEPS = 20.0, 5.0, 500
MOTION = GaussianShift(cell=5.0, sigma=ODOMETRY_SIGMA, edge="wrap")
# Never certain: a reading that the belief holds impossible would leave nothing.
DETECTOR = DoorDetector(doors=DOORS, sigma=90.0 / 4.0, seen=1.0, false_alarm=1e-3)


class Drive(NamedTuple):
    """Outcome of a walk.

    Attributes
    ----------
    truth : FloatArray, shape (500,)
        Place after each step, cm.
    odometry : FloatArray, shape (500,)
        Way measured in each step, cm.
    door : IntArray, shape (500,)
        Index of the door passed in the step, -1 for none.
    """

    truth: FloatArray
    odometry: FloatArray
    door: IntArray


class Filtered(NamedTuple):
    """Beliefs, shape (500, 170), each summing to 1, before and after the reading of a step."""

    predicted: FloatArray
    corrected: FloatArray


def drive(seed: int) -> Drive:
    """Drive round at 20 cm a step; odometry errs; a door is reported in the step that ends nearest to it."""
    rng = np.random.default_rng(seed)
    start = rng.uniform(0.0, 850.0)
    way = start + SPEED * np.arange(STEPS + 1)
    odometry: FloatArray = np.asarray(SPEED + ODOMETRY_SIGMA * rng.standard_normal(STEPS))
    doors = np.full(STEPS, -1, dtype=np.intp)
    for step in range(STEPS):
        for k, door in enumerate(DOORS):
            if -SPEED / 2.0 < SPACE.axes[0].difference(door, way[step + 1]) <= SPEED / 2.0:
                doors[step] = k
    truth: FloatArray = np.asarray(way[1:] % 850.0)
    return Drive(truth, odometry, doors)


def solve(run_: Drive) -> Filtered:
    """Filter as it should be."""
    belief = SPACE.uniform()
    seen = DETECTOR.log_likelihood(True, SPACE.axes[0])
    predicted, corrected = [], []
    for way, door in zip(run_.odometry, run_.door, strict=True):
        belief = MOTION.predict(belief, float(way))
        predicted.append(belief)
        if door >= 0:
            belief, _ = update(belief, seen)
        corrected.append(belief)
    return Filtered(np.array(predicted), np.array(corrected))


def solve_literally(run_: Drive) -> Filtered:
    """Filter with the three mistakes."""
    belief = SPACE.uniform()
    likelihood = np.exp(DETECTOR.log_likelihood(True, SPACE.axes[0]))
    predicted, corrected = [], []
    for way, door in zip(run_.odometry, run_.door, strict=True):
        matrix = motion_matrix(float(way))
        ahead = belief @ matrix / np.trace(matrix)  # mistake 1: any number, but not the sum
        tested = 0 <= door < len(DOORS) - 1  # mistake 3: not the last door
        without_motion = belief * likelihood / (belief * likelihood).sum()  # mistake 2: `ahead` is forgotten
        belief = without_motion if tested else ahead
        predicted.append(ahead / ahead.sum())
        corrected.append(belief / belief.sum())
    return Filtered(np.array(predicted), np.array(corrected))


def motion_matrix(way: float) -> FloatArray:
    """Return p(x | u, x before), shape (170 before, 170 after)."""
    # On a circle every row is the first one, rolled.
    first = MOTION.predict(SPACE.point_mass((0.0,)), way)
    cells = np.arange(SPACE.size)
    return np.asarray(first[(cells - cells[:, np.newaxis]) % SPACE.size])


def error(beliefs: FloatArray, truth: FloatArray) -> FloatArray:
    """Return the expected distance to the truth, the shorter one, cm, shape (steps,)."""
    away = np.abs(SPACE.axes[0].difference(CENTRES, truth[:, np.newaxis]))
    return np.asarray((beliefs * away).sum(axis=1))


def run(output: Path, seed: int) -> list[Path]:
    """Print both filters' errors and draw the eight figures."""
    path = drive(seed)
    good, bad = solve(path), solve_literally(path)
    readings = np.flatnonzero(path.door >= 0)
    print("reading  step  door/cm  true/cm  error/cm  of the literal code")
    good_error, bad_error = error(good.corrected, path.truth), error(bad.corrected, path.truth)
    for k in (0, 1, 2, 3, 5, 8, 11, 20, len(readings) - 1):
        t = readings[k]
        print(
            f"{k + 1:7}  {t:4}  {DOORS[path.door[t]]:7.0f}  {path.truth[t]:7.1f}  {good_error[t]:8.1f}  "
            f"{bad_error[t]:19.1f}"
        )
    ends = good_error[250:].mean(), bad_error[250:].mean()
    print(f"mean over the last 250 steps: {ends[0]:.1f} cm, literal {ends[1]:.1f} cm")
    last = moments(good.corrected[-1], SPACE)
    sigma = last.covariance[0, 0] ** 0.5
    print(f"at the end: mean {last.mean[0]:.1f} cm, sigma {sigma:.1f} cm, true {path.truth[-1]:.1f} cm")
    return [
        _draw_models(path, output / "hallway_models.png"),
        _draw_run(path, good, readings, output / "hallway_run.png"),
        _draw_errors(good_error, bad_error, path.door >= 0, output / "hallway_errors.png"),
    ]


def _draw_models(path: Drive, target: Path) -> Path:
    figure, axes = panels(2, 4, (17, 7.6))
    seen = np.exp(DETECTOR.log_likelihood(True, SPACE.axes[0]))
    axes[0, 0].plot(CENTRES, seen)
    axes[0, 0].set(title="measurement model", xlabel="x / cm", ylabel="p(door | x)")
    for k in range(5):
        axis = axes.flat[1 + k]
        image = axis.imshow(motion_matrix(float(path.odometry[k])), extent=(0, 850, 850, 0), cmap="magma")
        axis.set(
            title=f"p(x | u = {path.odometry[k]:.1f} cm, x before)", xlabel="x / cm", ylabel="x before / cm"
        )
        figure.colorbar(image, ax=axis, fraction=0.04, label="probability of the 5 cm cell")
    belief = SPACE.uniform()
    for repeat in range(1, 6):
        belief, _ = update(belief, np.log(seen))
        if repeat in (1, 2, 5):
            axes[1, 2].plot(CENTRES, belief, label=f"{repeat} reading{'s' * (repeat > 1)}")
    axes[1, 2].set(title="updates alone: mass piles up at the doors", xlabel="x / cm")
    axes[1, 2].set_ylabel("probability of the 5 cm cell")
    # The place that is left is the legend's.
    axes[1, 3].set_axis_off()
    axes[1, 3].legend(*axes[1, 2].get_legend_handles_labels(), title="after", loc="center left", fontsize=11)
    return save(figure, target)


def _draw_run(path: Drive, good: Filtered, readings: IntArray, target: Path) -> Path:
    figure, axes = panels(2, 3, (16, 8))
    first, second, third = (int(t) for t in readings[:3])
    between = second - 1
    late = int(readings[12])
    shown = (
        ("the first reading", good.corrected[first], first),
        (f"spreading between doors ({between - first} steps later)", good.predicted[between], between),
        ("the second reading", good.corrected[second], second),
        ("the third reading", good.corrected[third], third),
        ("the thirteenth reading", good.corrected[late], late),
    )
    for axis, (name, belief, step) in zip(axes.flat, shown, strict=False):
        axis.bar(CENTRES, belief, width=5.0)
        axis.axvline(path.truth[step], color="tab:red", label="truth")
        for door in DOORS:
            axis.axvline(door, color="0.3", lw=1.0, ls=":", label="door")
        axis.set(title=f"{name} (step {step})", ylim=(0.0, None), xlim=(0, 850))
        axis.set_ylabel("probability of the 5 cm cell")
    axis = axes[1, 2]
    turns = np.arange(0, 200)
    image = axis.pcolormesh(CENTRES, turns, good.corrected[:200], cmap="magma_r", vmax=0.1)
    axis.plot(path.truth[:200:4], turns[::4], ".", color="tab:cyan", ms=2.5)
    axis.set(title="all beliefs of 200 steps; cyan: truth", ylabel="step")
    figure.colorbar(image, ax=axis, label="probability of the 5 cm cell", extend="max")
    for axis in axes.flat:
        axis.set_xlabel("x / cm")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    once = dict(zip(labels, handles, strict=True))
    figure.legend(once.values(), once.keys(), loc="outside upper center", ncols=2)
    return save(figure, target)


def _draw_errors(good: FloatArray, bad: FloatArray, seen: BoolArray, target: Path) -> Path:
    figure, axes = panels(1, 1, (11, 4.4))
    axis = axes[0, 0]
    axis.plot(bad, label="literal code", color="tab:orange")
    axis.plot(good, label="correct filter", color="tab:blue")
    axis.plot(np.flatnonzero(seen), np.zeros(int(seen.sum())), "k|", label="a door is passed")
    axis.set(xlabel="step", ylabel="expected distance to the truth / cm", yscale="symlog", ylim=(0, 400))
    axis.set_yticks([0, 1, 10, 100], ["0", "1", "10", "100"])
    figure.legend(loc="outside upper center", ncols=3)
    return save(figure, target)
