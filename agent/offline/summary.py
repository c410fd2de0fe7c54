"""Summary of a belief, in words: the table of steps and the heat map for the terminal.

Cells are named by their centre in units, as everywhere in what people read: (5, 7) is the cell of 2 x 2 units
whose centre is at x = 5, y = 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.bayes.summaries import entropy_bits, most_likely_cells
from ciberrato.world.coordinates import Cell
from ciberrato.world.lab import CELL_SIZE


@dataclass(frozen=True, slots=True)
class Peak:
    """The most likely cells of a belief.

    Attributes
    ----------
    cells : tuple of (row, column)
        All cells that share the greatest probability, left to right, bottom row first.
    probability : float
        Probability of each one of them.
    """

    cells: tuple[Cell, ...]
    probability: float


def peak(belief: Floats) -> Peak:
    """Find the most likely cells.

    Parameters
    ----------
    belief : ndarray, shape (rows, columns)
        Row 0 at the bottom. Must not hold nan.

    Returns
    -------
    Peak
    """
    cells = tuple((int(row), int(column)) for row, column in most_likely_cells(belief))
    return Peak(cells, float(belief.max()))


def cell_name(cell: Cell) -> str:
    """Name a cell by its centre, as the lab file counts: ``(5, 7)``.

    Parameters
    ----------
    cell : (row, column)

    Returns
    -------
    str
    """
    row, column = cell
    return f"({(column + 0.5) * CELL_SIZE:g}, {(row + 0.5) * CELL_SIZE:g})"


def normalized_entropy(belief: Floats) -> float:
    """Return the entropy of a belief that rounding may have left with another sum than 1.

    Parameters
    ----------
    belief : ndarray
        Not negative, with some mass.

    Returns
    -------
    float
        Bits.
    """
    return entropy_bits(belief / belief.sum())


def step_table(
    beliefs: Floats, true_cells: Sequence[Cell | None] | None = None, *, notes: Sequence[str] = ()
) -> str:
    """Tabulate beliefs, a line each.

    Parameters
    ----------
    beliefs : ndarray, shape (blocks, rows, columns)
        The prior first. Blocks of nan are said to be undefined.
    true_cells : sequence of (row, column) or None
        Cell of the robot at each block, if it is known (None for the prior).
    notes : sequence of str
        A remark for each block, at the end of its line.

    Returns
    -------
    str
        Columns: step, most likely cell (its centre), probability, entropy in bits, true cell.
    """
    header = ["step", "most likely cell", "probability", "entropy/bits"]
    if true_cells is not None:
        header += ["true cell", ""]
    table = [header]
    for index, belief in enumerate(beliefs):
        label = "prior" if index == 0 else str(index - 1)
        if np.isnan(belief).any():
            line = [label, "undefined (nan)", "nan", "nan"]
            cells: tuple[Cell, ...] = ()
        else:
            best = peak(belief)
            cells = best.cells
            name = cell_name(cells[0])
            if len(cells) > 1:
                name += f" and {len(cells) - 1} more" if len(cells) < belief.size else " and all others"
            line = [label, name, f"{best.probability:.3f}", f"{normalized_entropy(belief):.2f}"]
        if true_cells is not None:
            truth = true_cells[index]
            line.append("" if truth is None else cell_name(truth))
            line.append("" if truth is None else _verdict(truth, cells))
        if index < len(notes) and notes[index]:
            line.append(notes[index])
        table.append(line)
    return _aligned(table)


def _verdict(truth: Cell, cells: tuple[Cell, ...]) -> str:
    if truth not in cells:
        return "wrong"
    return "right" if len(cells) == 1 else f"1 of {len(cells)}"


def _aligned(table: list[list[str]]) -> str:
    widths = [0] * max(len(line) for line in table)
    for line in table:
        for index, word in enumerate(line):
            widths[index] = max(widths[index], len(word))
    numeric = {0, 2, 3}
    return "\n".join(
        "  ".join(
            word.rjust(width) if index in numeric else word.ljust(width)
            for index, (word, width) in enumerate(zip(line, widths, strict=False))
        ).rstrip()
        for line in table
    )


SHADES = " .:-=+*#%@"
_RAMP = (17, 18, 19, 25, 31, 37, 71, 107, 143, 221)  # 256-colour codes, dark blue to yellow


def heat_map(belief: Floats, *, width: int = 80, colour: bool = False) -> str:
    """Draw a belief for a terminal, top row first: percentages, or shades where there is no room.

    Parameters
    ----------
    belief : ndarray, shape (rows, columns)
        Row 0 at the bottom.
    width : int
        Columns of the terminal. A lab too wide even for one character a cell is cut into bands.
    colour : bool
        Colour the background by probability (256-colour codes); without it the text says it all.

    Returns
    -------
    str
        The y of each row's centre on the left, the x of the columns' centres below.
    """
    rows, columns = belief.shape
    margin = len(f"{(rows - 0.5) * CELL_SIZE:g}") + 2
    space = max(width - margin - 1, 1)
    cell = max(1, min(5, space // columns))
    bands = [range(start, min(start + space, columns)) for start in range(0, columns, max(1, space // cell))]
    return "\n".join(_band(belief, band, cell, margin, colour) for band in bands)


def _band(belief: Floats, band: range, cell: int, margin: int, colour: bool) -> str:
    greatest = np.nanmax(belief) if not np.isnan(belief).all() else np.nan
    lines = []
    for row in range(belief.shape[0] - 1, -1, -1):
        words = [_painted(belief[row, column], greatest, cell, colour) for column in band]
        lines.append(f"{(row + 0.5) * CELL_SIZE:{margin - 2}g} |" + "".join(words) + "|")
    ticks = ""
    for column in band:
        tick = f"{(column + 0.5) * CELL_SIZE:g}"
        position = (column - band.start) * cell + cell // 2
        if position >= len(ticks) + (1 if ticks else 0):
            ticks = ticks.ljust(position) + tick
    lines.append(" " * margin + ticks)
    return "\n".join(lines)


def _painted(probability: float, greatest: float, cell: int, colour: bool) -> str:
    text = _cell_text(probability, greatest, cell)
    if not colour or not probability > 0:
        return text
    level = min(int(probability / greatest * len(_RAMP)), len(_RAMP) - 1)
    ink = 16 if level >= 5 else 231
    return f"\x1b[48;5;{_RAMP[level]};38;5;{ink}m{text}\x1b[0m"


def _cell_text(probability: float, greatest: float, cell: int) -> str:
    if np.isnan(probability):
        return "?".rjust(cell)
    if cell < 3:  # no room for a percentage: a shade relative to the peak
        level = int(probability / greatest * (len(SHADES) - 1) + 0.5) if greatest > 0 else 0
        return SHADES[level] * cell
    percent = probability * 100
    if percent < 0.05:
        return ".".rjust(cell)
    if percent < 9.95 and cell >= 4:
        return f"{percent:.1f}".rjust(cell)
    return f"{percent:.0f}".rjust(cell)
