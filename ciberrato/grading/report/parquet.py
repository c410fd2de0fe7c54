"""The runs as a Parquet table, where pyarrow is installed."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ciberrato.grading.outcome import Outcome

if TYPE_CHECKING:
    from ciberrato.grading.standing import Standing

WITHOUT = "no results.parquet: pyarrow is not installed (pip install 'ciberrato[tables]')"


def available() -> bool:
    """Return whether pyarrow is installed and can be loaded."""
    try:
        importlib.import_module("pyarrow.parquet")
    except ImportError:
        return False
    return True


def write_table(ranked: Sequence[Standing], path: Path) -> None:
    """Write the rows of ``results.csv``, each column with its type.

    Parameters
    ----------
    ranked : sequence of Standing
    path : Path
        The same runs give the same bytes.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    from ciberrato.files.atomic import replace_file

    kinds = {"str": pa.string(), "bool": pa.bool_(), "int": pa.int64(), "float": pa.float64()}
    columns = [("agent", "str"), ("lab", "str"), ("seed", "int")]
    first = next((run for standing in ranked for run, _ in standing.runs), None)
    columns += [(name, type(value).__name__) for name, value in (first.extra() if first else {}).items()]
    columns.append(("points", "float"))
    columns += [(field.name, str(field.type).partition(" ")[0]) for field in fields(Outcome)]
    columns.append(("commit", "str"))
    schema = pa.schema([(name, kinds[kind]) for name, kind in columns])
    rows: list[dict[str, Any]] = []
    for standing in ranked:
        for run, points in standing.runs:
            task = run.task
            rows.append(
                {
                    "agent": task.agent.name,
                    "lab": task.lab.name,
                    "seed": task.seed,
                    **run.extra(),
                    "points": points,
                    **asdict(run.outcome),
                    "commit": task.agent.commit,
                }
            )
    buffer = pa.BufferOutputStream()
    pq.write_table(pa.Table.from_pylist(rows, schema=schema), buffer)
    replace_file(path, buffer.getvalue().to_pybytes())
