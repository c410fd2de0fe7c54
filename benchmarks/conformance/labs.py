"""Lab, grid and parameter files: what our readers make of them, and what the real parsers did."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.conformance import Finding
from benchmarks.conformance.files import DEFAULT_LAB, find_lab_file, read_named_lab, records
from ciberrato.errors import LabError, ProtocolError
from ciberrato.files.lab import parse_lab_with_warnings
from ciberrato.files.parameters import parse_parameters
from ciberrato.files.start_grid import default_grid, parse_grid
from ciberrato.protocol import encode_parameters
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid

NOT_COPIED = {
    "dup_attr": "an attribute twice is not XML; the real parser takes the first",
    "latin1_no_decl": "bytes that are not UTF-8, without a declaration, are not XML",
    "nul_inside": "a NUL in the middle is not XML",
    "pattern_newline": "a line break in an attribute is a blank in XML, and ends a wall; theirs keeps it",
    "nested": "a position inside a position counts once each, not the inner one twice",
}
"""Odd inputs that we treat unlike the real parsers, and why."""


def rows(golden: Path, labs: Path | None) -> Iterator[Finding]:
    """Yield the rows of this check."""
    folder = golden / "ir"
    yield _labs(folder, labs)
    yield _unlisted(folder, labs)
    yield _lab_quirks(folder / "lab_quirks.jsonl.gz")
    yield _grids(folder / "grids.jsonl.gz", labs)
    yield _grid_quirks(folder / "grid_quirks.jsonl.gz")
    yield _parameter_quirks(folder / "param_quirks.jsonl.gz")


def _labs(folder: Path, labs: Path | None) -> Finding:
    check = "labs: walls"
    cases = walls = missing = 0
    greatest = 0.0
    for file in ("labs.jsonl.gz", "own_labs.jsonl.gz"):
        for record in records(folder / file):
            lab = read_named_lab(record["lab"], labs)
            if lab is None:
                missing += 1
                continue
            difference = lab_difference(lab, record)
            cases += 1
            walls += len(record["walls"])
            if difference > 0.0:
                return Finding(check, cases, difference, False, f"first in {record['lab']}")
            greatest = max(greatest, difference)
    if cases + missing == 0:
        return _nothing(check)
    note = f"{walls} walls, beacons, targets, sizes and names, to the last bit"
    return Finding(check, cases, greatest, True, note + _missing(missing, "labs"))


def lab_difference(lab: Lab, record: dict[str, Any]) -> float:
    """Return the greatest difference of a lab from the record of the real parser; infinite if unlike.

    Parameters
    ----------
    lab : Lab
    record : dict
        A line of ``labs.jsonl.gz``.

    Returns
    -------
    float
        Units.
    """
    ours: list[float] = [lab.width, lab.height]
    theirs: list[float] = [record["width"], record["height"]]
    walls = (lab.border, *lab.walls)
    shapes = [
        (lab.name, record["name"]),
        ([len(wall.corners) for wall in walls], [len(wall["corners"]) for wall in record["walls"]]),
        (len(lab.beacons), len(record["beacons"])),
        (len(lab.targets), len(record["targets"])),
    ]
    if any(our != their for our, their in shapes):
        return math.inf
    for wall, recorded in zip(walls, record["walls"], strict=True):
        ours += [wall.height, *(value for corner in wall.corners for value in corner)]
        theirs += [recorded["height"], *(value for corner in recorded["corners"] for value in corner)]
    for beacon, recorded in zip(lab.beacons, record["beacons"], strict=True):
        ours += [beacon.x, beacon.y, beacon.height]
        theirs += [recorded["x"], recorded["y"], recorded["height"]]
    for target, recorded in zip(lab.targets, record["targets"], strict=True):
        ours += [target.x, target.y, target.radius]
        theirs += [recorded["x"], recorded["y"], recorded["radius"]]
    return max(abs(our - their) for our, their in zip(ours, theirs, strict=True))


def _unlisted(folder: Path, labs: Path | None) -> Finding:
    """Return labs that the recordings do not mention: they must at least be read or refused properly."""
    check = "labs: not recorded"
    if labs is None:
        return Finding(check, 0, None, True, "no folder of labs")
    recorded = {record["lab"] for record in records(folder / "labs.jsonl.gz")}
    cases = 0
    for path in sorted(labs.rglob("*.xml")):
        if path.relative_to(labs).as_posix() in recorded:
            continue
        data = path.read_bytes()
        if b"<Lab" not in data:
            continue
        cases += 1
        try:
            parse_lab_with_warnings(data, str(path))
        except LabError as error:
            if error.line is None:
                return Finding(check, cases, None, False, f"refused without a line number: {error}")
    return Finding(check, cases, None, True, "read, or refused with a line number" if cases else "none")


def _lab_quirks(path: Path) -> Finding:
    check = "labs: odd input"
    cases = refused = 0
    excepted = []
    for record in records(path):
        cases += 1
        data = base64.b64decode(record["xml_b64"])
        try:
            lab = parse_lab_with_warnings(data, record["case"], any_size=True)[0]
            good = record["parse_ok"] and lab_difference(lab, record) == 0.0
        except LabError as error:
            refused += 1
            good = not record["parse_ok"] and error.line is not None
        if record["case"] in NOT_COPIED:
            excepted.append(record["case"])
        elif not good:
            return Finding(check, cases, None, False, f"first: {record['case']} ({record['what']})")
    if cases == 0:
        return _nothing(check)
    return Finding(check, cases, None, True, f"{refused} refused with line number; " + _reasons(excepted))


def _grids(path: Path, labs: Path | None) -> Finding:
    check = "grids: positions"
    cases = missing = 0
    greatest = 0.0
    for record in records(path):
        if record["grid"] == DEFAULT_LAB:
            grid = default_grid()
        else:
            file = find_lab_file(record["grid"], labs)
            if file is None:
                missing += 1
                continue
            grid = parse_grid(file.read_bytes(), record["grid"])
        cases += 1
        difference = grid_difference(grid, record)
        greatest = max(greatest, difference)
        if difference > 0.0:
            return Finding(check, cases, greatest, False, f"first in {record['grid']}")
    if cases + missing == 0:
        return _nothing(check)
    return Finding(check, cases, greatest, True, "to the last bit" + _missing(missing, "grids"))


def grid_difference(grid: StartGrid, record: dict[str, Any]) -> float:
    """Return the greatest difference of a grid from the record of the real parser; infinite if unlike.

    Parameters
    ----------
    grid : StartGrid
    record : dict
        A line of ``grids.jsonl.gz``.

    Returns
    -------
    float
        Units, or radians.
    """
    if len(grid.positions) != len(record["positions"]):
        return math.inf
    differences = [
        max(
            abs(ours.x - theirs["x"]),
            abs(ours.y - theirs["y"]),
            abs(math.radians(ours.direction_deg) - theirs["dir_rad"]),
        )
        for ours, theirs in zip(grid.positions, record["positions"], strict=True)
    ]
    return max(differences, default=0.0)


def _grid_quirks(path: Path) -> Finding:
    check = "grids: odd input"
    cases = 0
    excepted = []
    for record in records(path):
        cases += 1
        try:
            grid = parse_grid(record["xml"].encode(), record["case"], allow_empty=True)
            good = record["parse_ok"] and grid_difference(grid, record) == 0.0
        except LabError as error:
            good = not record["parse_ok"] and error.line is not None
        if record["case"] in NOT_COPIED:
            excepted.append(record["case"])
        elif not good:
            return Finding(check, cases, None, False, f"first: {record['case']} ({record['what']})")
    return Finding(check, cases, None, True, _reasons(excepted)) if cases else _nothing(check)


def _parameter_quirks(path: Path) -> Finding:
    check = "parameters: odd input"
    cases = 0
    for record in records(path):
        cases += 1
        try:
            parameters = parse_parameters(
                record["xml"].encode(), record["case"], Parameters(show_actions=False)
            )
            good = record["parse_ok"] and (
                encode_parameters(parameters, 0) == record["to_xml"]
                and parameters.line_sensor_true_probability == record["line_true_prob"]
            )
        except (LabError, ProtocolError):
            good = not record["parse_ok"]
        if not good:
            return Finding(check, cases, None, False, f"first: {record['case']}")
    return Finding(check, cases, None, True, "equal to the byte when announced") if cases else _nothing(check)


def _nothing(check: str) -> Finding:
    return Finding(check, 0, None, True, "not recorded here")


def _reasons(cases: list[str]) -> str:
    listed = "; ".join(f"{case}: {NOT_COPIED[case]}" for case in cases)
    return f"{len(cases)} deliberately unlike ({listed})" if cases else "all alike"


def _missing(count: int, what: str) -> str:
    return f"; {count} {what} whose files are not here" if count else ""
