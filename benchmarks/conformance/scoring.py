"""Scores: scripted runs of the real simulator in every mode, the circuits it finds, the files it writes."""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from benchmarks.conformance.files import find_lab_file, table
from benchmarks.conformance.finding import Finding
from ciberrato.files.lab import parse_lab_with_warnings
from ciberrato.files.parameters import read_parameters
from ciberrato.files.start_grid import read_grid
from ciberrato.protocol import Actions, Measures, RobotRegistration, RobotStatus
from ciberrato.world.parameters import Parameters
from simulator_stub.scoring import SCORINGS
from simulator_stub.scoring.circuits import CircuitScoring
from simulator_stub.simulation import Simulation

_LEDS = {"EndLed": "end_led", "ReturningLed": "returning_led", "VisitingLed": "visiting_led"}
_LED = re.compile(r'(\w+)="(\w+)"')
_COLUMNS = (
    *("x", "y", "dir_deg", "score", "collisions", "collision", "state", "visited_mask"),
    *("arrival_time", "returning_time", "ground", "m_score", "m_leds"),
)


@dataclass(slots=True)
class _Comparison:
    """Collects what the runs of one mode show."""

    runs: int = 0
    rows: int = 0
    unlike: int = 0
    missing: int = 0
    first: str = ""

    def note(self, place: str) -> None:
        self.unlike += 1
        self.first = self.first or place

    def row(self, check: str, what: str) -> Finding:
        note = f"{self.runs} {what}"
        note += f"; {self.missing} whose labs are not here" if self.missing else ""
        note += f"; {self.unlike} unlike, first {self.first}" if self.unlike else ""
        return Finding(check, self.rows, None, self.unlike == 0, note)


def rows(golden: Path, labs: Path | None) -> Iterator[Finding]:
    """Yield the rows of this check."""
    folder = golden / "scoring"
    runs = sorted(folder.glob("*.meta.json"))
    if not runs and not (folder / "paths.jsonl").is_file():
        yield Finding("scoring", 0, None, True, "not recorded here")
        return
    modes: defaultdict[int, _Comparison] = defaultdict(_Comparison)
    files = _Comparison()
    for path in runs:
        meta = json.loads(path.read_text(encoding="utf-8"))
        _compare_run(folder, meta, labs, modes[meta["scoring"]], files)
    for mode, found in sorted(modes.items()):
        yield found.row(f"scoring: mode {mode}", "runs")
    if files.runs or files.missing:
        yield files.row("scoring: reference files", "files")
    if (folder / "paths.jsonl").is_file():
        yield _compare_circuits(folder, labs)


def _compare_run(
    folder: Path, meta: dict[str, Any], labs: Path | None, found: _Comparison, files: _Comparison
) -> None:
    name = meta["name"]
    simulation = _simulation(folder, meta, labs, folder / f"{name}.param.xml")
    if simulation is None:
        found.missing += 1
        files.missing += len(meta["files"])
        return
    found.runs += 1
    simulation.register(RobotRegistration(robot_id=1, name=name))
    simulation.step()
    simulation.start()
    for row in table(folder / f"{name}.csv.gz"):
        ours = _texts(*_cycle(simulation, row))
        found.rows += 1
        unlike = [column for column in _COLUMNS if row[column] != ours[column]]
        if unlike:
            differences = ", ".join(f"{column} {ours[column]} not {row[column]}" for column in unlike)
            found.note(f"{name}, time {row['time']}: {differences}")
    for written, kept in meta["files"].items():
        files.runs += 1
        expected = (folder / kept).read_text(encoding="ascii")
        ours_written = simulation.scoring.documents.get(written, "")
        files.rows += len(expected.splitlines())
        if ours_written != expected:
            files.note(f"{kept}")


def _simulation(
    folder: Path, meta: dict[str, Any], labs: Path | None, param: Path | None
) -> Simulation | None:
    lab, grid = (_find(folder, meta[what], labs) for what in ("lab", "grid"))
    if lab is None or grid is None:
        return None
    parameters = Parameters() if param is None else read_parameters(param)
    return Simulation(
        parse_lab_with_warnings(lab.read_bytes(), lab.name, any_size=True)[0],
        read_grid(grid),
        replace(parameters, requests_per_cycle=0),
        scoring=meta["scoring"],
    )


def _find(folder: Path, name: str, labs: Path | None) -> Path | None:
    beside = folder / name
    return beside if beside.is_file() else find_lab_file(name, labs)


def _cycle(simulation: Simulation, row: dict[str, str]) -> tuple[RobotStatus, Measures]:
    leds = {_LEDS[name]: value == "On" for name, value in _LED.findall(row["led_attributes"])}
    simulation.begin_cycle()
    if row["left_cmd"] or leds:
        simulation.act(
            1,
            Actions(
                left_motor=float(row["left_cmd"]) if row["left_cmd"] else None,
                right_motor=float(row["right_cmd"]) if row["right_cmd"] else None,
                **leds,
            ),
        )
    measures = simulation.advance()[1]
    status = simulation.statuses()[0]
    simulation.end_cycle()
    return status, measures


def _texts(status: RobotStatus, measures: Measures) -> dict[str, str]:
    """Return what the real simulator would have sent; it sends scores without their sign to views."""
    leds = (measures.end_led, measures.returning_led, measures.visiting_led)
    return {
        "x": f"{status.x:g}",
        "y": f"{status.y:g}",
        "dir_deg": f"{status.direction_deg:g}",
        "score": str(status.score % 2**32),
        "collisions": str(status.collisions),
        "collision": str(status.collision),
        "state": status.state,
        "visited_mask": status.visited_mask,
        "arrival_time": str(status.arrival_time),
        "returning_time": str(status.returning_time),
        "ground": str(measures.ground),
        "m_score": str(measures.score.score if measures.score else None),
        "m_leds": " ".join(
            f'{name}="{"On" if led else "Off"}"' for name, led in zip(_LEDS, leds, strict=True)
        ),
    }


def _compare_circuits(folder: Path, labs: Path | None) -> Finding:
    found = _Comparison()
    for line in (folder / "paths.jsonl").read_text(encoding="utf-8").splitlines():
        recorded = json.loads(line)
        simulation = _simulation(folder, recorded, labs, None)
        scoring = SCORINGS[recorded["scoring"]]
        if simulation is None:
            found.missing += 1
            continue
        assert issubclass(scoring, CircuitScoring)
        found.runs += 1
        start = simulation.world.grid.positions[0]
        circuit = scoring(simulation.world).find_circuit(start.x, start.y)
        found.rows += len(recorded["cells"])
        if circuit != tuple((column, row) for column, row in recorded["cells"]):
            found.note(f"mode {recorded['scoring']} in {recorded['lab']}")
    return found.row("scoring: circuits", "labs")
