"""The 16-cell lecture problem: one prediction and one correction, by hand and by the library.

Cells are (x, y) with x the column, 1 to 4 from the left, and y the row, 1 to 4 from the bottom. The prior,
top row first:

    .02 .05 .05 .05 / .02 .05 .18 .05 / .05 .05 .18 .05 / .05 .05 .05 .05

Odometry says (-1, 0). The four terms of P(x = (2, 3) | o) = 0.09 + 0.005 + 0.036 + 0.01 = 0.141, which come
from (3, 3), (2, 3), (3, 2) and (3, 4), fix the kernel, because the priors there are .18, .05, .18 and .05:

    0.5 arrives as commanded (-1, 0);  0.1 does not move (0, 0);  0.2 drifts up (-1, 1);  0.2 drifts down (-1,
    -1).

These sum to 1. What would leave the grid stays in the border cell; no such mass reaches (2, 3).
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.filtering import update
from ciberrato.bayes.motion.kernel import CommandKernel, KernelMotion
from examples.figures import panels, save

TITLE = "The 16-cell lecture problem: P(x = (2, 3) | o) = 0.141"

# [x - 1, y - 1]: the rows as printed are top first.
PRIOR = np.array(
    [[0.02, 0.05, 0.05, 0.05], [0.02, 0.05, 0.18, 0.05], [0.05, 0.05, 0.18, 0.05], [0.05, 0.05, 0.05, 0.05]]
)[::-1].T
KERNEL: dict[tuple[int, ...], float] = {(-1, 0): 0.5, (0, 0): 0.1, (-1, 1): 0.2, (-1, -1): 0.2}
READING_PROBABILITY = 0.04
QUERY = (2, 3)
DARK = 0.13
"""Probability from which on the figure's blue needs white letters."""


class Solution(NamedTuple):
    """The numbers.

    Attributes
    ----------
    terms : dict
        Part of each cell (x, y) in P(x = (2, 3) | o).
    predicted, posterior, posterior_if_nearer : FloatArray, shape (4, 4)
        [x - 1, y - 1]. `posterior` is for p(z = 1.2 | x) = 0.04 in every cell, `posterior_if_nearer` for a
        sensor that gives 0.04 in column 2 and 0.01 elsewhere.
    evidence : float
        P(z = 1.2 | o) for the former.
    """

    terms: dict[tuple[int, int], float]
    predicted: FloatArray
    posterior: FloatArray
    posterior_if_nearer: FloatArray
    evidence: float


def solve() -> Solution:
    """Predict and correct."""
    kernel = CommandKernel.from_displacements(KERNEL)
    motion = KernelMotion(kernels={(-1, 0): kernel}, edges=("stay", "stay"))
    predicted = motion.predict(PRIOR, (-1, 0))
    terms = {}
    for step, weight in KERNEL.items():
        x, y = QUERY[0] - step[0], QUERY[1] - step[1]
        terms[x, y] = weight * float(PRIOR[x - 1, y - 1])
    constant = np.full((4, 4), READING_PROBABILITY)
    posterior, log_evidence = update(predicted, np.log(constant))
    nearer = np.full((4, 4), 0.01)
    nearer[QUERY[0] - 1] = READING_PROBABILITY
    return Solution(
        terms, predicted, posterior, update(predicted, np.log(nearer)).posterior, float(np.exp(log_evidence))
    )


def run(output: Path, seed: int) -> list[Path]:
    """Print the terms and the posterior, and draw the three beliefs. The seed has no effect."""
    del seed
    solution = solve()
    print("kernel:", ", ".join(f"{weight} to {step}" for step, weight in KERNEL.items()))
    for cell, term in solution.terms.items():
        print(f"from {cell}: {term:.3f}")
    at = QUERY[0] - 1, QUERY[1] - 1
    print(f"P(x = {QUERY} | o) = {solution.predicted[at]:.3f}")
    print(
        f"p(z = 1.2 | x) = 0.04 in every cell: 0.04 * {solution.predicted[at]:.3f} = "
        f"{READING_PROBABILITY * solution.predicted[at]:.5f}, over all cells {solution.evidence:.3f}, "
        f"so P(x = {QUERY} | o, z) = {solution.posterior[at]:.3f}"
    )
    print(
        f"0.04 in column 2 and 0.01 elsewhere: P(x = {QUERY} | o, z) = {solution.posterior_if_nearer[at]:.4f}"
    )
    figure, axes = panels(1, 3, (13, 4.6), layout="compressed", sharex=True, sharey=True)
    pictures = (
        (f"prior (red: the cell asked for, {QUERY})", PRIOR),
        ("after odometry (-1, 0)", solution.predicted),
        ("after z = 1.2 (0.04 in column 2, else 0.01)", solution.posterior_if_nearer),
    )
    for axis, (name, belief) in zip(axes.flat, pictures, strict=True):
        image = axis.imshow(
            belief.T, origin="lower", extent=(0.5, 4.5, 0.5, 4.5), cmap="Blues", vmin=0.0, vmax=0.25
        )
        for (i, j), value in np.ndenumerate(belief):
            ink = "white" if value > DARK else "black"
            axis.text(i + 1, j + 1, f"{value:.3f}", ha="center", va="center", fontsize=11, color=ink)
        axis.add_patch(_frame())
        axis.set(title=name, xlabel="x (cells)", xticks=range(1, 5), yticks=range(1, 5))
    axes[0, 0].set_ylabel("y (cells)")
    figure.colorbar(image, ax=axes, label="probability of the cell", fraction=0.03)
    return [save(figure, output / "lecture.png")]


def _frame() -> object:
    from matplotlib.patches import Rectangle

    return Rectangle((QUERY[0] - 0.5, QUERY[1] - 0.5), 1, 1, fill=False, ec="tab:red", lw=2)
