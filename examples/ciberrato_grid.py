"""The published method on CiberRato's standard lab: 98 cells, four IR sensors, driving right from (5, 7).

Santos, "Markov localization in the CiberRato simulation environment": uniform prior; the likelihood of a
reading is the product over the sensors of a Gaussian of variance 0.1 around the inverse distance at the
cell's centre; each move shifts the belief one column to the right and ignores walls; mass shifted out of the
lab is lost.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from agent.views.figures.panelchoice import telling_blocks
from ciberrato.bayes import entropy_bits, most_likely_cell
from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.filtering import update
from ciberrato.bayes.motion.shift import Shift
from ciberrato.bayes.sensors.gaussian import GaussianSensor
from ciberrato.files.lab import default_lab
from ciberrato.infrared.model import cell_readings, round_reading
from ciberrato.plot.canvas import label_outer, set_lab_axes, set_title
from examples.figures import panels, save

TITLE = "CiberRato grid: the published method on the standard lab, from (5, 7), start and 11 cells"

ANGLES = (0.0, 90.0, -90.0, 180.0)
START = (3, 2)  # row, column of (5, 7)
CELLS_ENTERED = 11
NOISE = 0.1


class Run(NamedTuple):
    """Readings and conclusions of the filter.

    Attributes
    ----------
    beliefs : FloatArray, shape (13, 7, 14)
        Prior, start cell, and one for each cell entered.
    true_cells : tuple of (row, column)
        One for each reading.
    readings : FloatArray, shape (12, 4)
    ideal : FloatArray, shape (7, 14, 4)
    """

    beliefs: FloatArray
    true_cells: tuple[tuple[int, int], ...]
    readings: FloatArray
    ideal: FloatArray


def solve(seed: int) -> Run:
    """Drive through the lab with noisy readings and localize."""
    rng = np.random.default_rng(seed)
    ideal = np.asarray(cell_readings(default_lab(), ANGLES), dtype=float)
    rows, columns, sensors = ideal.shape
    cells = tuple((START[0], START[1] + k) for k in range(CELLS_ENTERED + 1))
    noisy = np.array([ideal[cell] for cell in cells]) + NOISE * rng.standard_normal((len(cells), sensors))
    readings = np.asarray(round_reading(noisy), dtype=float)
    sensor = GaussianSensor(sigma=math.sqrt(0.1), normalized=False, signed=True)
    motion = Shift(edges=("lose", "lose"))
    beliefs = [np.full((rows, columns), 1.0 / (rows * columns))]
    for step, reading in enumerate(readings):
        predicted = beliefs[-1] if step == 0 else motion.predict(beliefs[-1], (0, 1))
        beliefs.append(
            update(predicted, sensor.log_likelihood(reading, ideal), on_impossible="likelihood").posterior
        )
    return Run(np.array(beliefs), cells, readings, ideal)


def run(output: Path, seed: int) -> list[Path]:
    """Print step, most likely cell, its probability, entropy and true cell; draw the belief panels."""
    result = solve(seed)
    print("step  most likely  probability  entropy/bits  true cell")
    for step, (belief, true) in enumerate(zip(result.beliefs[1:], result.true_cells, strict=True)):
        best = most_likely_cell(belief)
        print(f"{step:4}  {best!s:>11}  {belief[best]:11.3f}  {entropy_bits(belief):12.3f}  {true!s:>9}")
    return [_draw(result, output / "ciberrato_grid.png")]


def _draw(result: Run, path: Path) -> Path:
    true_cells = [None, *result.true_cells]
    choice = telling_blocks(result.beliefs, true_cells)
    across = 3
    down = math.ceil(len(choice.blocks) / across)
    from matplotlib.colors import PowerNorm

    figure, axes = panels(down, across, (14, 2.6 * down + 1.0), layout="compressed")
    names = ["prior", "step 0, start cell", *(f"step {k}" for k in range(1, CELLS_ENTERED + 1))]
    for axis in axes.flat[len(choice.blocks) :]:
        axis.set_visible(False)
    for axis, k in zip(axes.flat, choice.blocks, strict=False):
        belief = result.beliefs[k]
        image = axis.imshow(
            belief, origin="lower", extent=(0, 28, 0, 14), cmap="Greys", norm=PowerNorm(0.5, 0.0, 1.0)
        )
        _draw_walls(axis)
        true = true_cells[k]
        if true is not None:
            axis.plot(2 * true[1] + 1, 2 * true[0] + 1, "o", mfc="none", mec="tab:red", mew=1.8, ms=9)
        set_lab_axes(axis, 28.0, 14.0)
        axis.set_title(f"{names[k]}: p = {belief.max():.3f}, {entropy_bits(belief):.2f} bits", fontsize=10)
    label_outer(axes, len(choice.blocks))
    bar = figure.colorbar(image, ax=axes, fraction=0.03, pad=0.015, label="probability of the cell")
    bar.set_ticks([0, 0.01, 0.05, 0.1, 0.25, 0.5, 0.75, 1])
    title = "The published method on the standard lab, from (5, 7); red ring: true cell"
    set_title(figure, title, size=11, note=choice.note)
    return save(figure, path)


def _draw_walls(axis: Any) -> None:
    for wall in default_lab().walls:
        x, y = zip(*wall.corners, strict=True)
        axis.fill(x, y, color="tab:blue", lw=0)
