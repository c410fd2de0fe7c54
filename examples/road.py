"""A car on a road of 100 cells of 1 m, with landmarks whose distance ahead it measures.

Map, controls and observations come from CSV files in `examples/data` (`python -m examples.road DIRECTORY`
writes new ones); the start is unknown. Each step moves 1 m with a standard deviation of 1 m, then ranges to
the landmarks ahead, up to a maximum, are matched in order.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ciberrato.bayes import entropy_bits, most_likely_cell
from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.filtering import predict, update
from ciberrato.bayes.motion.gaussian_shift import GaussianShift
from ciberrato.bayes.sensors.landmarks import OrderedRanges
from ciberrato.bayes.spaces import line
from examples.figures import panels, save

TITLE = "1-D road with landmarks: ranges matched in order, unknown start"

DATA = Path(__file__).parent / "data"
SPACE = line(100, unit="m")
LANDMARKS = (9.0, 15.0, 25.0, 31.0, 59.0, 77.0, 88.0, 96.0)
STEPS = 40
CONTROL_SIGMA = 1.0
RANGE_SIGMA = 1.0
MAX_RANGE = 30.0
# A landmark at the end of the range may be missed, and one beyond it seen, by the noise of the range.
UNREAD = 0.05
UNEXPECTED = 0.001


class Road(NamedTuple):
    """The files' contents.

    Attributes
    ----------
    landmarks : tuple of float
    controls : FloatArray, shape (steps,)
        Metres commanded.
    observations : tuple of tuple of float
        Ranges read after each step.
    """

    landmarks: tuple[float, ...]
    controls: FloatArray
    observations: tuple[tuple[float, ...], ...]


class Localized(NamedTuple):
    """Beliefs over the road.

    Attributes
    ----------
    predicted, corrected : FloatArray, shape (steps, 100)
    """

    predicted: FloatArray
    corrected: FloatArray


def simulate(directory: Path, seed: int) -> FloatArray:
    """Drive with noise, write map, controls, observations and truth, and return the true places, (steps,)."""
    rng = np.random.default_rng(seed)
    place, truth, observations = 20.3, [], []
    for step in range(STEPS):
        # The true step varies less than the filter believes: it is the controls that are rough.
        place += 1.0 + 0.2 * rng.standard_normal()
        truth.append(place)
        for landmark in LANDMARKS:
            ahead = landmark - place
            if 0.0 <= ahead <= MAX_RANGE:
                observations.append((step, round(abs(ahead + RANGE_SIGMA * rng.standard_normal()), 2)))
    directory.mkdir(parents=True, exist_ok=True)
    _write(directory / "road_map.csv", ["landmark", "x"], enumerate(LANDMARKS))
    _write(directory / "road_controls.csv", ["step", "control"], ((k, 1.0) for k in range(STEPS)))
    _write(directory / "road_observations.csv", ["step", "range"], observations)
    _write(directory / "road_truth.csv", ["step", "x"], ((k, f"{x:.4f}") for k, x in enumerate(truth)))
    return np.array(truth)


def read(directory: Path) -> Road:
    """Read map, controls and observations."""
    landmarks = tuple(float(row["x"]) for row in _rows(directory / "road_map.csv"))
    controls = np.array([float(row["control"]) for row in _rows(directory / "road_controls.csv")])
    observations: list[list[float]] = [[] for _ in controls]
    for row in _rows(directory / "road_observations.csv"):
        observations[int(row["step"])].append(float(row["range"]))
    return Road(landmarks, controls, tuple(tuple(o) for o in observations))


def localize(road: Road) -> Localized:
    """Predict and correct, from a uniform belief."""
    motion = GaussianShift(cell=1.0, sigma=CONTROL_SIGMA, edge="lose")
    sensor = OrderedRanges(
        landmarks=road.landmarks, sigma=RANGE_SIGMA, max_range=MAX_RANGE, unread=UNREAD, unexpected=UNEXPECTED
    )
    places = SPACE.axes[0].centres
    belief = SPACE.uniform()
    predicted, corrected = [], []
    for control, ranges in zip(road.controls, road.observations, strict=True):
        belief, _ = predict(motion.predict, belief, float(control))
        predicted.append(belief)
        belief, _ = update(belief, sensor.log_likelihood(ranges, places), on_impossible="likelihood")
        corrected.append(belief)
    return Localized(np.array(predicted), np.array(corrected))


def run(output: Path, seed: int) -> list[Path]:
    """Print how the belief becomes certain, write beliefs and the figure; the data are in the files."""
    del seed
    road = read(DATA)
    truth = np.array([float(row["x"]) for row in _rows(DATA / "road_truth.csv")])
    result = localize(road)
    print("step  ranges  most likely / m  probability  entropy/bits  true x / m")
    for step, belief in enumerate(result.corrected):
        if step < 8 or step % 8 == 7:
            best = most_likely_cell(belief)
            print(
                f"{step:4}  {len(road.observations[step]):6}  {best[0] + 0.5:15.1f}  {belief[best]:11.3f}  "
                f"{entropy_bits(belief):12.3f}  {truth[step]:10.2f}"
            )
    text = output / "road_beliefs.txt"
    with text.open("w", encoding="utf-8") as file:
        for step in range(len(road.controls)):
            for name, belief in (
                ("predicted", result.predicted[step]),
                ("corrected", result.corrected[step]),
            ):
                file.write(f"step {step} {name}\n" + " ".join(f"{p:.5f}" for p in belief) + "\n")
    figure, axes = panels(2, 1, (12, 8))
    for axis, name, beliefs in zip(axes.flat, ("prediction", "correction"), result, strict=True):
        image = axis.imshow(
            beliefs, aspect="auto", cmap="viridis", extent=(0, 100, STEPS - 0.5, -0.5), vmin=0.0, vmax=0.4
        )
        axis.plot(truth, np.arange(STEPS), "w--", lw=1, label="truth")
        for landmark in road.landmarks:
            axis.axvline(landmark, color="tab:red", lw=0.9, label="landmark")
        axis.set(title=f"belief after each {name}", ylabel="step", xlabel="x / m")
        figure.colorbar(image, ax=axis, label="probability of the 1 m cell", extend="max")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    once = dict(zip(labels, handles, strict=True))
    # White on dark, as in the picture.
    figure.legend(once.values(), once.keys(), loc="outside upper center", ncols=2, facecolor="0.75")
    return [text, save(figure, output / "road.png")]


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _write(path: Path, header: list[str], rows: object) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)  # type: ignore[arg-type]  # any iterable of tuples


if __name__ == "__main__":
    simulate(Path(sys.argv[1]), 1)
