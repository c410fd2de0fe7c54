"""The belief file ``localization.out``: one block a step, top row first, a blank line after each block.

In memory a belief is (rows, columns) with row 0 at the bottom, as in the lab file. The file shows the
top row first; this module is the one place where the two meet.
"""

from __future__ import annotations

import io
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.errors import LabError
from ciberrato.files.atomic import replace_file
from ciberrato.reprs import html_repr, short_repr
from ciberrato.system.opening import open_patiently

MIN_PRECISION, MAX_PRECISION = 2, 17
_VALUE = re.compile(r"\S+")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?nan", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class BeliefRun:
    """The beliefs of one run, as read from a file.

    Attributes
    ----------
    beliefs : ndarray, shape (steps + 1, rows, columns)
        The prior first; row 0 is the bottom row of the lab. A block may be nan.
    first_line : int
        The line on which the run begins, from 1.
    decimals : int
        The most decimals of any value: the resolution of its probabilities.
    """

    __repr__ = short_repr
    _repr_html_ = html_repr

    beliefs: Floats
    first_line: int
    decimals: int


@dataclass(frozen=True, slots=True)
class _Block:
    rows: tuple[tuple[float, ...], ...]  # top row first, as in the file
    lines: tuple[int, ...]
    decimals: int

    @property
    def shape(self) -> tuple[int, int]:
        return len(self.rows), len(self.rows[0])

    def looks_like_prior(self) -> bool:
        """Return whether all possible cells are equally likely, and most cells are possible."""
        values = np.array(self.rows)
        possible = values[values > 0]
        return bool(2 * possible.size > values.size > 1 and np.all(possible == possible[0]))


def format_beliefs(beliefs: Floats, precision: int = 3) -> str:
    """Write beliefs as the text of a belief file.

    Parameters
    ----------
    beliefs : ndarray, shape (blocks, rows, columns)
        Row 0 is the bottom row of the lab.
    precision : int
        Decimals of each probability.

    Returns
    -------
    str
        For each block one line per row, top row first, then an empty line.
    """
    lines: list[str] = []
    for belief in np.asarray(beliefs, dtype=float):
        lines.extend(" ".join(f"{value:.{precision}f}" for value in row) for row in belief[::-1])
        lines.append("")
    return "".join(line + "\n" for line in lines)


def write_beliefs(path: str | os.PathLike[str], beliefs: Floats, precision: int = 3) -> None:
    """Write a belief file so that it is there whole or not at all.

    Parameters
    ----------
    path : path-like
        Written under a temporary name beside it, then renamed.
    beliefs : ndarray, shape (blocks, rows, columns)
        Row 0 is the bottom row of the lab.
    precision : int
        Decimals of each probability.

    Raises
    ------
    UsageError
        If the file cannot be written.
    """
    replace_file(Path(path), format_beliefs(beliefs, precision).encode("ascii"))


def read_beliefs(path: str | os.PathLike[str]) -> tuple[BeliefRun, ...]:
    """Read a belief file of any writer: 2 to 17 decimals, any blanks, nan, several runs in a row.

    A run begins at a prior: a block in which all possible cells, most of the lab, are equally likely. (A
    filter that has lost everything and begun again writes the same; the file does not distinguish the two.)

    Parameters
    ----------
    path : path-like

    Returns
    -------
    tuple of BeliefRun
        At least one.

    Raises
    ------
    LabError
        With line and column of the first fault: something that is not a number, a row or block of another
        size, a negative value or one above 1, a block that does not add up to 1 within its rounding.
    """
    source = os.fspath(path)
    try:
        with io.TextIOWrapper(open_patiently(Path(path)), encoding="utf-8") as file:
            text = file.read()
    except FileNotFoundError:
        raise LabError("no such file; check the path", source=source) from None
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not a text file"
        raise LabError(f"cannot be read: {reason}", source=source) from None
    return parse_beliefs(text, source)


def parse_beliefs(text: str, source: str = "localization.out") -> tuple[BeliefRun, ...]:
    """Return the beliefs in a text, as `read_beliefs` does for a file.

    Parameters
    ----------
    text : str
    source : str
        Name for error messages.

    Returns
    -------
    tuple of BeliefRun

    Raises
    ------
    LabError
        See `read_beliefs`.
    """
    runs: list[list[_Block]] = []
    for block in _blocks(text, source):
        if not runs or block.looks_like_prior():
            runs.append([])
        elif block.shape != runs[-1][0].shape:
            wanted = "{} rows of {} values".format(*runs[-1][0].shape)
            found = "{} rows of {}".format(*block.shape)
            raise LabError(
                f"column 1: this block has {found}, the run began with {wanted}",
                source=source,
                line=block.lines[0],
            )
        _check_sum(block, source)
        runs[-1].append(block)
    if not runs:
        raise LabError("holds no belief: it is empty", source=source)
    return tuple(
        BeliefRun(
            beliefs=np.array([block.rows[::-1] for block in blocks], dtype=float),
            first_line=blocks[0].lines[0],
            decimals=max(block.decimals for block in blocks),
        )
        for blocks in runs
    )


def _blocks(text: str, source: str) -> Iterator[_Block]:
    rows: list[tuple[float, ...]] = []
    lines: list[int] = []
    decimals = 0
    for number, line in enumerate([*text.splitlines(), ""], start=1):
        if line.strip():
            row, row_decimals = _row(line, number, source)
            if rows and len(row) != len(rows[0]):
                column = len(line.rstrip()) if len(row) < len(rows[0]) else _column_of(line, len(rows[0]))
                raise LabError(
                    f"column {column}: this row has {len(row)} values, "
                    f"the first of its block has {len(rows[0])}",
                    source=source,
                    line=number,
                )
            rows.append(row)
            lines.append(number)
            decimals = max(decimals, row_decimals)
        elif rows:
            yield _Block(tuple(rows), tuple(lines), decimals)
            rows, lines, decimals = [], [], 0


def _column_of(line: str, index: int) -> int:
    return [match.start() for match in _VALUE.finditer(line)][index] + 1


def _row(line: str, number: int, source: str) -> tuple[tuple[float, ...], int]:
    values = []
    decimals = 0
    for match in _VALUE.finditer(line):
        word = match.group()
        place = f"column {match.start() + 1}"
        if not _NUMBER.fullmatch(word):
            shown = word if len(word) <= 20 else word[:20] + "..."
            raise LabError(f"{place}: {shown!r} is not a probability", source=source, line=number)
        value = float(word)
        if value < 0:
            raise LabError(f"{place}: {word} is negative", source=source, line=number)
        if value > 1:
            raise LabError(f"{place}: {word} is above 1", source=source, line=number)
        values.append(value)
        mantissa, _, exponent = word.lower().partition("e")
        decimals = max(decimals, len(mantissa.partition(".")[2]) - int(exponent or 0))
    return tuple(values), decimals


def _check_sum(block: _Block, source: str) -> None:
    values = np.array(block.rows)
    if np.isnan(values).any():
        if not np.isnan(values).all():
            raise LabError("column 1: this block mixes nan with numbers", source=source, line=block.lines[0])
        return
    # Each value is off by at most half a unit of its last decimal.
    tolerance = values.size * 0.5 * 10.0**-block.decimals + 1e-9
    total = float(values.sum())
    if abs(total - 1) > tolerance:
        raise LabError(
            f"column 1: this block adds up to {total:.6g}, not to 1 (rounding explains {tolerance:.2g})",
            source=source,
            line=block.lines[0],
        )
