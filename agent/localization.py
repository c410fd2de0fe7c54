"""From a recorded run to ``localization.out``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from agent.belieffile import write_beliefs
from agent.localizer import Localization, Preset, localize

if TYPE_CHECKING:
    from agent.ground_truth import GroundTruth
    from agent.runrecords import RecordedRun


def write_localization(
    run: RecordedRun, truth: GroundTruth, *, preset: Preset, output: Path, precision: int = 3
) -> Localization:
    """Run the filter over a recorded run and write its beliefs.

    Parameters
    ----------
    run : RecordedRun
    truth : GroundTruth
        For the lab and the sensor angles of the run.
    preset : {"seed", "calibrated"}
    output : Path
        The belief file, written whole or not at all.
    precision : int
        Decimals.

    Returns
    -------
    Localization

    Raises
    ------
    UsageError
        If the file cannot be written.
    """
    localization = localize(
        [step.readings for step in run.steps],
        truth,
        preset=preset,
        obstacle_noise=run.header.parameters.obstacle_noise,
    )
    write_beliefs(output, localization.beliefs, precision)
    return localization


def print_localization(localization: Localization, output: Path, stream: TextIO | None = None) -> None:
    """Print the table of steps, what was remarkable about them, and where the file is.

    Parameters
    ----------
    localization : Localization
    output : Path
        The belief file.
    stream : text stream
        Standard output if None.
    """
    from agent.summary import step_table

    stream = sys.stdout if stream is None else stream
    notes = [""] * len(localization.beliefs)
    for step in localization.recoveries:
        notes[step + 1] = "restarted: no cell was left possible"
    print(step_table(localization.beliefs, notes=notes), file=stream)
    print(f"written: {output} ({len(localization.beliefs)} blocks)", file=stream, flush=True)
