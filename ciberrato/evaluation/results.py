"""Outcomes as a table, a row a run: from the file of outcomes, to CSV and Parquet, and back."""

from __future__ import annotations

import csv
import importlib
import io
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ciberrato.errors import LabError, UsageError
from ciberrato.evaluation.attempt import Failure, Result
from ciberrato.files.atomic import replace_file

_TEXTS = (
    "lab",
    "grid",
    "start",
    "prior",
    "parameters",
    "settings",
    "gps",
    "drive",
    "filter",
    "code",
    "error",
)
_SWITCHES = ("compass", "staged", "first_claim_wrong", "final_claim")
_OF_TASK = (
    *("lab", "grid", "start", "prior", "parameters", "settings", "compass", "gps", "drive", "filter", "code"),
    *("seed", "resolution", "kidnap", "staged", "settle"),
)
_OF_OUTCOME = (
    *(
        "cycles",
        "room",
        "first_right",
        "first_claim",
        "first_claim_wrong",
        "claimed",
        "wrongly",
        "final_claim",
    ),
    *("final_place_error", "collisions", "colliding", "kidnapped", "noticed", "found", "arrived", "rested"),
    *("given_up", "equals", "alike"),
)
_TIMES = ("median", "q99", "max")
_RANGES = [f"{tenth * 10}_{tenth * 10 + 10}" for tenth in range(10)]
COLUMNS = (
    *_OF_TASK,
    *("cycle_limit", "error"),
    *_OF_OUTCOME,
    *(
        "start_x",
        "start_y",
        "start_heading_deg",
        "final_turn_error_deg",
        "restarts",
        "truth_mean",
        "truth_last",
    ),
    *(f"{part}_ms_{time}" for part in ("filter", "drive") for time in _TIMES),
    *(f"{what}_{tenth}" for tenth in _RANGES for what in ("claims", "right")),
)
"""Names of the columns. *error* says why a run failed; what is not known is nan, or no text. *cycle_limit* is
the length that was asked for. *truth*: probability of the true pose; its whole course is in the file of
outcomes. *claims_A_B*, *right_A_B*: cycles in which the estimate's probability was from A to B per cent, and
those of them in which it was right."""

Columns = dict[str, NDArray[Any]]


def read_results(path: str | Path) -> Any:
    """Read outcomes as a table.

    Parameters
    ----------
    path : str or Path
        A file of outcomes (``--output``), or what ``--table`` wrote from one: ``.csv`` or ``.parquet``.

    Returns
    -------
    pandas.DataFrame, or dict of str to array
        A row a run, with the columns in `COLUMNS`; a dict of arrays, shape (runs,), where pandas is not
        installed.

    Raises
    ------
    UsageError
        If there is no such file, or pyarrow is needed to read it and is not installed.
    LabError
        If it holds something else.
    """
    if not isinstance(path, str | Path):
        raise TypeError(f"path: {path!r:.60} is not the path of a file of outcomes")
    file = Path(path)
    if not file.is_file():
        raise UsageError(f"{file}: no such file; check the path")
    read = {".csv": _from_csv, ".parquet": _from_parquet}.get(file.suffix.lower(), _from_outcomes)
    columns = read(file)
    try:
        pandas = importlib.import_module("pandas")
    except ImportError:
        return columns
    return pandas.DataFrame(columns)


def check_table(path: Path) -> None:
    """Refuse a table that could not be written when the runs are over; UsageError."""
    if path.suffix.lower() not in _WRITERS:
        raise UsageError(f"--table {path}: its name ends in .csv or .parquet")
    if path.suffix.lower() == ".parquet":
        _pyarrow()
    if not path.absolute().parent.is_dir():
        raise UsageError(f"--table {path}: no folder {path.parent}; create it")


def write_table(path: Path, tried: Sequence[Result | Failure]) -> None:
    """Write outcomes as a table, whole or not at all.

    Parameters
    ----------
    path : Path
        File; the ending of its name selects the format: ``.csv`` (empty where not known) or ``.parquet``.
    tried : sequence of Result or Failure
    """
    check_table(path)
    replace_file(path, _WRITERS[path.suffix.lower()](columns_of(tried)))


def columns_of(tried: Sequence[Result | Failure]) -> Columns:
    """Return outcomes as the columns of `COLUMNS`; each of shape (runs,)."""
    rows = [_row(one) for one in tried]
    return {name: _column(name, [row.get(name) for row in rows]) for name in COLUMNS}


def _row(one: Result | Failure) -> dict[str, Any]:
    task = one.task
    row: dict[str, Any] = {name: getattr(task, name) for name in _OF_TASK} | {"cycle_limit": task.cycles}
    if isinstance(one, Failure):
        return row | {"error": one.error}
    outcome = one.outcome
    row |= {name: getattr(outcome, name) for name in _OF_OUTCOME}
    row |= dict(zip(("start_x", "start_y", "start_heading_deg"), outcome.start, strict=True))
    row |= {"final_turn_error_deg": outcome.final_turn_error_deg, "restarts": len(outcome.restarts)}
    if outcome.truth:
        row |= {"truth_mean": float(np.mean(outcome.truth)), "truth_last": outcome.truth[-1]}
    for part, times in (("filter", outcome.filter_ms), ("drive", outcome.drive_ms)):
        row |= {f"{part}_ms_{name}": time for name, time in zip(_TIMES, times, strict=False)}
    for tenth, (claims, right) in zip(_RANGES, outcome.calibration, strict=False):
        row |= {f"claims_{tenth}": claims, f"right_{tenth}": right}
    return row


def _column(name: str, values: Sequence[Any]) -> NDArray[Any]:
    if name in _TEXTS:
        return np.array(["" if value is None else str(value) for value in values], object)
    values = [None if value != value else value for value in values]  # nan, as Parquet has it
    if name in _SWITCHES and not any(value is None for value in values):
        return np.array([bool(value) for value in values], np.bool_)
    return np.array([math.nan if value is None else float(value) for value in values], np.float64)


def _from_outcomes(path: Path) -> Columns:
    from ciberrato.evaluation.runner import read_evaluation

    evaluation = read_evaluation(path)
    return columns_of([*evaluation.results, *evaluation.failures])


def _to_csv(columns: Columns) -> bytes:
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in zip(*(column.tolist() for column in columns.values()), strict=True):
        writer.writerow(["" if value != value else value for value in row])
    return text.getvalue().encode()


def _from_csv(path: Path) -> Columns:
    with path.open(newline="", encoding="utf-8", errors="replace") as file:
        rows = list(csv.reader(file))
    if not rows or tuple(rows[0]) != COLUMNS or any(len(row) != len(COLUMNS) for row in rows):
        raise LabError("not a table of outcomes that --table has written", source=str(path), line=1)
    switches = {"True": True, "False": False, "": None, "1.0": True, "0.0": False}
    try:
        return {
            name: _column(
                name,
                [
                    row[place]
                    if name in _TEXTS
                    else switches[row[place]]
                    if name in _SWITCHES
                    else row[place] or None
                    for row in rows[1:]
                ],
            )
            for place, name in enumerate(COLUMNS)
        }
    except (ValueError, KeyError) as error:
        raise LabError(f"not a table of outcomes: {error}", source=str(path)) from None


def _to_parquet(columns: Columns) -> bytes:
    arrow, parquet = _pyarrow()
    sink = arrow.BufferOutputStream()
    parquet.write_table(arrow.table({name: arrow.array(column) for name, column in columns.items()}), sink)
    written: bytes = sink.getvalue().to_pybytes()
    return written


def _from_parquet(path: Path) -> Columns:
    _, parquet = _pyarrow()
    try:
        table = parquet.read_table(path)
    except Exception as error:  # pyarrow's own, and OSError
        raise LabError(f"not a Parquet file: {' '.join(str(error).split())}", source=str(path)) from None
    if tuple(table.column_names) != COLUMNS:
        raise LabError("not a table of outcomes that --table has written", source=str(path))
    return {name: _column(name, table.column(name).to_pylist()) for name in COLUMNS}


def _pyarrow() -> tuple[Any, Any]:
    try:
        return importlib.import_module("pyarrow"), importlib.import_module("pyarrow.parquet")
    except ImportError:
        raise UsageError("Parquet needs pyarrow: pip install 'ciberrato[tables]', or write .csv") from None


_WRITERS: dict[str, Callable[[Columns], bytes]] = {".csv": _to_csv, ".parquet": _to_parquet}
