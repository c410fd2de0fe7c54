"""Differences of two belief files: the places, the amounts, and the distance of the beliefs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agent.offline.summary import cell_name
from ciberrato.arrays import Floats
from ciberrato.errors import UsageError
from ciberrato.world.coordinates import Cell


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Two runs, block by block.

    Attributes
    ----------
    differences : ndarray, shape (blocks, rows, columns)
        Second minus first, over the blocks that both have.
    greatest : ndarray, shape (blocks,)
        Greatest absolute difference of a block.
    cells : tuple of (row, column)
        Cell of that difference, by block.
    divergence : ndarray, shape (blocks,)
        Jensen-Shannon divergence in bits: 0 = equal, 1 = no cell in common; nan where a block is undefined.
    surplus : (int, int)
        Blocks that only the first, and only the second, has.
    """

    differences: Floats
    greatest: Floats
    cells: tuple[Cell, ...]
    divergence: Floats
    surplus: tuple[int, int]


def compare_beliefs(first: Floats, second: Floats) -> Comparison:
    """Compare two runs block by block.

    Parameters
    ----------
    first, second : ndarray, shape (blocks, rows, columns)
        The prior first; the numbers of blocks may differ.

    Returns
    -------
    Comparison

    Raises
    ------
    UsageError
        If they are not of the same lab.
    """
    if first.shape[1:] != second.shape[1:]:
        sizes = " and ".join(f"{rows} x {columns}" for _, rows, columns in (first.shape, second.shape))
        raise UsageError(f"the beliefs have {sizes} cells: they are not of the same lab")
    common = min(len(first), len(second))
    a, b = first[:common], second[:common]
    differences = b - a
    sizes_ = np.where(np.isnan(differences), -1.0, np.abs(differences)).reshape(common, -1)
    places = sizes_.argmax(axis=1)
    cells = [np.unravel_index(int(place), first.shape[1:]) for place in places]
    greatest = sizes_.max(axis=1)
    return Comparison(
        differences=differences,
        greatest=np.where(greatest < 0, np.nan, greatest),
        cells=tuple((int(row), int(column)) for row, column in cells),
        divergence=np.array([jensen_shannon(p, q) for p, q in zip(a, b, strict=True)]),
        surplus=(len(first) - common, len(second) - common),
    )


def jensen_shannon(p: Floats, q: Floats) -> float:
    """Return the Jensen-Shannon divergence of two beliefs.

    Parameters
    ----------
    p, q : ndarray
        The same shape; normalized here, as files round.

    Returns
    -------
    float
        Bits, 0 to 1; nan if either is undefined.
    """
    if np.isnan(p).any() or np.isnan(q).any():
        return float("nan")
    p, q = p / p.sum(), q / q.sum()
    middle = (p + q) / 2

    def relative_entropy(r: Floats) -> float:
        seen = r > 0
        return float((r[seen] * np.log2(r[seen] / middle[seen])).sum())

    return max(0.0, (relative_entropy(p) + relative_entropy(q)) / 2)


def comparison_table(comparison: Comparison) -> str:
    """Tabulate a comparison, a line a block.

    Parameters
    ----------
    comparison : Comparison

    Returns
    -------
    str
    """
    lines = [" step  greatest difference  in cell     divergence/bits"]
    for index, greatest in enumerate(comparison.greatest):
        label = "prior" if index == 0 else str(index - 1)
        place = "" if np.isnan(greatest) else cell_name(comparison.cells[index])
        lines.append(f"{label:>5}  {greatest:19.3f}  {place:10}  {comparison.divergence[index]:15.4f}")
    for count, which in zip(comparison.surplus, ("first", "second"), strict=True):
        if count:
            lines.append(f"{count} more block{'s' if count > 1 else ''} only in the {which} file")
    return "\n".join(lines)
