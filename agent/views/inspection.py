"""Look into a belief file: validate it, tabulate its steps, draw its last belief."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TextIO

import numpy as np

from agent.offline.summary import heat_map, step_table
from ciberrato.errors import UsageError
from ciberrato.files.beliefs import BeliefRun, read_beliefs
from ciberrato.world.lab import Lab


def inspect(
    path: str | os.PathLike[str],
    *,
    png: Path | None = None,
    lab: Lab | None = None,
    out: TextIO | None = None,
    width: int = 80,
    colour: bool = False,
) -> tuple[BeliefRun, ...]:
    """Print the contents of a belief file, and draw it on request.

    Parameters
    ----------
    path : path-like
        The belief file.
    png : Path or None
        Write a figure of all steps of the last run here (the ending chooses the format).
    lab : Lab or None
        Draw its walls over the beliefs.
    out : text stream
        Stream for the text; standard output if None.
    width : int
        Columns of the terminal.
    colour : bool
        Use terminal colours.

    Returns
    -------
    tuple of BeliefRun
        The runs in the file.

    Raises
    ------
    LabError
        At the first fault in the file, with line and column.
    UsageError
        If the lab has not the size of the beliefs, or the figure cannot be written.
    """
    out = sys.stdout if out is None else out
    runs = read_beliefs(path)
    _, rows, columns = runs[-1].beliefs.shape
    if lab is not None and (lab.rows, lab.columns) != (rows, columns):
        raise UsageError(
            f"{os.fspath(path)} holds beliefs of {rows} x {columns} cells, "
            f"but the lab {lab.name!r} has {lab.rows} x {lab.columns}: give the lab of that run"
        )
    for number, run in enumerate(runs, start=1):
        blocks, rows, columns = run.beliefs.shape
        steps = f"{blocks - 1} step" + ("" if blocks == 2 else "s")
        which = f"run {number} of {len(runs)}, from line {run.first_line}: " if len(runs) > 1 else ""
        print(
            f"{os.fspath(path)}: {which}prior and {steps}, {rows} x {columns} cells, {run.decimals} decimals",
            file=out,
        )
        print(step_table(run.beliefs), file=out)
        undefined = int(np.isnan(run.beliefs).any(axis=(1, 2)).sum())
        if undefined:
            print(
                f"{undefined} of {blocks} blocks are undefined (nan): "
                "the writer's filter found every cell impossible",
                file=out,
            )
        print(file=out)
    last = runs[-1].beliefs[-1]
    print("last step, probability in % (x to the right, y up, cell centres in units):", file=out)
    print(heat_map(last, width=width, colour=colour), file=out)
    if png is not None:
        from agent.views.figures import belief_panels  # matplotlib takes a second to load

        belief_panels(runs[-1].beliefs, png, lab=lab, title=Path(path).name)
        print(f"figure: {png}", file=out)
    return runs
