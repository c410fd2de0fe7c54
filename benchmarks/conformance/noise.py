"""Noise: what our sensors and motors draw, against samples of the real simulator's, by two-sample tests.

A robot of ours stands (or drives) where the recorded one did, with the same parameters, as many cycles, from
a fixed seed. Readings are discrete: each is tested by chi-square for homogeneity, bins with few cases merged.
What the motors add is continuous: Kolmogorov-Smirnov, and a test of the spread. The numbers differ from run
to run by chance; a test fails where such a difference, or a greater one, is less likely than `LEVEL` if both
come from one distribution.
"""

from __future__ import annotations

import csv
import gzip
import json
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.conformance.files import read_named_lab
from benchmarks.conformance.finding import Finding
from benchmarks.conformance.transcripts import GPS_OFFSET
from ciberrato.arrays import Floats
from ciberrato.files.parameters import parse_parameters
from ciberrato.protocol import Actions, Measures, RobotRegistration
from ciberrato.world.lab import Lab
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

LEVEL = 1e-4
"""With about 50 tests, one in 200 seeds would fail by chance."""

SEED = 20
LEAST_EXPECTED = 8
"""Cases that a bin should have, of both samples together."""

EMPTY = Lab(width=400.0, height=400.0)
"""The lab of the recordings of motors."""

Series = dict[str, list[Any]]


def rows(golden: Path, labs: Path | None) -> Iterator[Finding]:
    """Yield a row for each sensor and run."""
    folder = golden / "noise"
    names = sorted(path.name.removesuffix(".meta.json") for path in folder.glob("*.meta.json"))
    if not names:
        yield Finding("noise", 0, None, True, "skipped: no samples here")
    for name in names:
        meta = json.loads((folder / f"{name}.meta.json").read_text(encoding="utf-8"))
        lab = EMPTY if meta["lab"].startswith("empty") else read_named_lab(meta["lab"], labs)
        if lab is None:
            yield Finding(f"noise {name}", 0, None, True, f"skipped: {meta['lab']} is not here")
        elif meta["cmd"] is None:
            yield from _sensor_rows(name, folder, meta, lab)
        else:
            yield _heading_row(name, folder, meta, lab)
    for path in sorted(folder.glob("m*_direct_*.csv.gz")):
        yield from _motor_rows(path)


# --- sensors -------------------------------------------------------------------------------------------


def _sensor_rows(name: str, folder: Path, meta: dict[str, Any], lab: Lab) -> Iterator[Finding]:
    with gzip.open(folder / f"{name}.csv.gz", "rt", newline="") as file:
        recorded = [row for row in csv.DictReader(file) if row["time"] != "0"]
    theirs = _split(
        [
            (
                [float(row[f"ir{sensor}"]) for sensor in range(4)],
                float(row["compass"]),
                (float(row["gps_x"]), float(row["gps_y"])),
                row["line"],
                [None if text == "NotVisible" else float(text) for text in row["beacons"].split("|")],
            )
            for row in recorded
        ]
    )
    simulation = _simulation(meta, lab)
    simulation.gps_offset = GPS_OFFSET
    ours = _split([_reading(simulation.step()[1]) for _ in recorded])
    for key, values in theirs.items():
        yield _compare(f"noise {name} {key}", values, ours[key])


def _reading(measures: Measures) -> tuple[Any, ...]:
    bearings = [reading.bearing for reading in measures.beacons]
    return list(measures.infrared), measures.compass, measures.gps, measures.line, bearings


def _split(readings: list[tuple[Any, ...]]) -> Series:
    """Return readings as one series per sensor."""
    series: Series = {}
    infrared, compass, gps, line, beacons = zip(*readings, strict=True)
    for sensor in range(4):
        series[f"ir{sensor}"] = [values[sensor] for values in infrared]
    series["compass"] = list(compass)
    series["gps x"], series["gps y"] = ([place[axis] for place in gps] for axis in range(2))
    for element in range(7):
        series[f"line {element}"] = [int(text[element]) for text in line]
    for beacon in range(len(beacons[0])):
        series[f"beacon {beacon}"] = [values[beacon] for values in beacons]
    return series


def _simulation(meta: dict[str, Any], lab: Lab) -> Simulation:
    attributes = " ".join(f'{key}="{value}"' for key, value in meta["param"].items())
    parameters = parse_parameters(f"<Parameters {attributes}/>".encode(), "meta.json")
    x, y, direction = meta["pose"]
    grid = StartGrid(positions=(GridPosition(x=x, y=y, direction_deg=direction),))
    simulation = Simulation(lab, grid, replace(parameters, sim_time=0), SEED + meta.get("pid_seed", 0))
    simulation.register(RobotRegistration())
    simulation.launch()
    return simulation


def _compare(check: str, theirs: list[Any], ours: list[Any]) -> Finding:
    """Test two samples of a discrete quantity for being drawn alike."""
    probability, bins = homogeneity(Counter(map(_key, theirs)), Counter(map(_key, ours)))
    figures = [np.array([value for value in sample if value is not None]) for sample in (theirs, ours)]
    note = f"p = {probability:.3g} in {bins} bins"
    if all(sample.size for sample in figures):
        means, spreads = (f"{f(figures[0]):.4g} and {f(figures[1]):.4g}" for f in (_mean, _spread))
        note += f"; means {means}, standard deviations {spreads}"
    return Finding(check, len(ours), None, probability > LEVEL, note)


def _mean(values: Floats) -> float:
    """Compute the mean, of angles as well as of lengths: angles near 180 degrees are unwrapped."""
    return float(np.mean(_unwrapped(values)))


def _spread(values: Floats) -> float:
    return float(np.std(_unwrapped(values)))


def _unwrapped(values: Floats) -> Floats:
    wraps = values.min() < -150 and values.max() > 150
    return np.where(values < 0, values + 360, values) if wraps else values


def _key(value: float | None) -> float:
    return math.nan if value is None else round(float(value) % 360 if abs(value) > 150 else float(value), 1)


def homogeneity(one: Counter[float], other: Counter[float]) -> tuple[float, int]:
    """Test by chi-square whether two samples of a discrete quantity come from one distribution.

    Parameters
    ----------
    one, other : Counter
        Frequency of each value; NaN counts as a value of its own.

    Returns
    -------
    probability : float
        Of a difference as great, or greater, if they do.
    bins : int
        Values that are left after neighbours with few cases have been merged.
    """
    from scipy.stats import chi2

    values = sorted(set(one) | set(other), key=lambda value: (math.isnan(value), value))
    table = _merged([(one[value], other[value]) for value in values])
    if len(table) < 2:
        return 1.0, len(table)
    counts = np.array(table, dtype=np.float64)
    expected = counts.sum(axis=1, keepdims=True) * counts.sum(axis=0) / counts.sum()
    statistic = float(((counts - expected) ** 2 / expected).sum())
    return float(chi2.sf(statistic, len(table) - 1)), len(table)


def _merged(table: list[tuple[int, int]]) -> list[tuple[int, int]]:
    merged: list[tuple[int, int]] = []
    waiting = (0, 0)
    for pair in table:
        waiting = (waiting[0] + pair[0], waiting[1] + pair[1])
        if sum(waiting) >= 2 * LEAST_EXPECTED:
            merged.append(waiting)
            waiting = (0, 0)
    if sum(waiting) and merged:
        merged[-1] = (merged[-1][0] + waiting[0], merged[-1][1] + waiting[1])
    return merged


# --- motors ----------------------------------------------------------------------------------------------


def _heading_row(name: str, folder: Path, meta: dict[str, Any], lab: Lab) -> Finding:
    """Compare what each cycle adds to the turning, from the headings that views received."""
    with gzip.open(folder / f"{name}.csv.gz", "rt", newline="") as file:
        recorded = [float(row["true_dir_deg"] or "nan") for row in csv.DictReader(file) if row["time"] != "0"]
    simulation = _simulation(meta, lab)
    left, right = meta["cmd"]
    ours = []
    for _ in recorded:
        simulation.step({1: Actions(left_motor=left, right_motor=right)})
        ours.append(float(f"{simulation.robots[0].heading_degrees:g}"))
    return _continuous(f"noise {name} turning", _innovations(recorded), _innovations(ours), "degrees")


def _innovations(headings: Sequence[float]) -> Floats:
    """Subtract from the turns what the motor filter keeps of the turn before: the rest is independent."""
    turns = np.diff(np.array(headings))
    turns = (turns + 180.0) % 360.0 - 180.0
    innovations = turns[1:] - turns[:-1] / 2.0
    return np.asarray(innovations[~np.isnan(innovations)])  # where a cycle was not recorded


def _motor_rows(path: Path) -> Iterator[Finding]:
    """Compare the factors of the motors, recorded at full precision."""
    with gzip.open(path, "rt", newline="") as file:
        recorded = list(csv.DictReader(file))
    meta = {"pose": (20.0, 200.0, 0.0), "param": {"MotorsNoise": 1.5, "SimTime": 0}}
    simulation = _simulation(meta, EMPTY)
    ours: dict[str, list[float]] = {"left": [0.0], "right": [0.0]}
    commands = [(float(row["left_cmd"]), float(row["right_cmd"])) for row in recorded[1:]]
    for left, right in commands:
        simulation.step({1: Actions(left_motor=left, right_motor=right)})
        robot = simulation.robots[0]
        ours["left"].append(robot.left_output)
        ours["right"].append(robot.right_output)
    for side, column in (("left", 0), ("right", 1)):
        inputs = np.array(commands)[:, column]
        theirs = _factors(inputs, np.array([float(row[f"{side}_out"]) for row in recorded]))
        name = path.name.removesuffix(".csv.gz")
        yield _continuous(f"noise {name} {side}", theirs, _factors(inputs, np.array(ours[side])), "factor")


def _factors(inputs: Floats, outputs: Floats) -> Floats:
    return np.asarray(outputs[1:] / ((inputs + outputs[:-1]) / 2.0))


def _continuous(check: str, theirs: Floats, ours: Floats, unit: str) -> Finding:
    from scipy.stats import ks_2samp, norm

    # The first test hardly sees a difference in spread; so there is a second, and the level is divided by
    # two.
    deviation = math.log(theirs.std() / ours.std()) / math.sqrt(0.5 / theirs.size + 0.5 / ours.size)
    probabilities = float(ks_2samp(theirs, ours).pvalue), 2.0 * float(norm.sf(abs(deviation)))
    probability = min(1.0, 2.0 * min(probabilities))
    note = (
        f"p = {probability:.3g}; means {theirs.mean():.5g} and {ours.mean():.5g},"
        f" standard deviations {theirs.std():.4g} and {ours.std():.4g} ({unit})"
    )
    return Finding(check, len(ours), None, probability > LEVEL, note)
