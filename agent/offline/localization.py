"""From a recorded run to ``localization.out``."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from agent.offline.doubts import doubts_of
from agent.offline.localizer import NO_DOUBT, Localization, Preset, localize
from agent.offline.map_fit import Fit, map_fit
from ciberrato.files.beliefs import read_beliefs, write_beliefs

if TYPE_CHECKING:
    from agent.offline.expected_readings import ExpectedReadings
    from ciberrato.files.run_records import RecordedRun, RunHeader
    from ciberrato.world.lab import Lab


def expected_readings_of(header: RunHeader, lab: Lab) -> ExpectedReadings:
    """Compute the tables that the filter needs for a run.

    Parameters
    ----------
    header : RunHeader
        Sensor angles, announced noise and distance model of the run.
    lab : Lab

    Returns
    -------
    ExpectedReadings
    """
    from agent.offline.expected_readings import compute_expected_readings

    return compute_expected_readings(
        lab, header.sensor_angles, header.parameters, model=header.distance_model
    )


def localize_run(
    run: RecordedRun, expected: ExpectedReadings, *, preset: Preset | None = None
) -> Localization:
    """Run the filter over the steps of a recorded run, as far as it goes.

    Parameters
    ----------
    run : RecordedRun
    expected : ExpectedReadings
        For the lab and the sensor angles of the run.
    preset : {"seed", "calibrated"} or None
        None = that of the run.

    Returns
    -------
    Localization
    """
    preset = run.header.preset if preset is None else preset
    return localize(
        [step.readings for step in run.steps],
        expected,
        preset=preset,
        obstacle_noise=run.header.parameters.obstacle_noise,
        # The published method as it is takes every step for one.
        doubts=doubts_of(run) if preset == "calibrated" else None,
    )


def write_localization(
    run: RecordedRun, expected: ExpectedReadings, *, preset: Preset, output: Path, precision: int = 3
) -> Localization:
    """Run the filter over a recorded run and write its beliefs.

    Parameters
    ----------
    run : RecordedRun
    expected : ExpectedReadings
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
    localization = localize_run(run, expected, preset=preset)
    write_beliefs(output, localization.beliefs, precision)
    return localization


def fit_of(run: RecordedRun, expected: ExpectedReadings) -> Fit:
    """Compute how well the recorded readings fit the lab, whatever the preset.

    Parameters
    ----------
    run : RecordedRun
    expected : ExpectedReadings
        For the lab and the sensor angles of the run.

    Returns
    -------
    Fit
    """
    steps = zip(run.steps, doubts_of(run), strict=True)
    # From the first gap on it is not sure that a reading is that of its assumed cell.
    sure = itertools.takewhile(lambda one: one[1] == NO_DOUBT, steps)
    readings = [step.readings for step, _ in sure]
    return map_fit(readings, expected, run.header.parameters.obstacle_noise)


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
    from agent.offline.summary import step_table

    stream = sys.stdout if stream is None else stream
    # As the file has them, rounded: then all who tabulate it later say the same.
    (*_, written) = read_beliefs(output)
    beliefs = written.beliefs
    if len(beliefs) != len(localization.beliefs):  # a restart looks like the prior of another run
        beliefs = localization.beliefs
    notes = [""] * len(beliefs)
    for step in localization.recoveries:
        notes[step + 1] = "restarted: no cell was left possible"
    print(step_table(beliefs, notes=notes), file=stream)
    print(f"written: {output} ({len(localization.beliefs)} blocks)", file=stream, flush=True)
