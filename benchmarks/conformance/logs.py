"""Logs of the real simulator, made again: the recorded actions in the same world give the same log.

Where nothing is noisy the whole document is compared byte by byte, but for its date. Where there is noise,
what depends on it is left out: poses, scores, and what sensors read.
"""

from __future__ import annotations

import gzip
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path

from benchmarks.conformance.finding import Finding
from benchmarks.conformance.transcripts import GPS_OFFSET
from ciberrato.files.lab import read_lab
from ciberrato.files.parameters import read_parameters
from ciberrato.files.simulator_log import LoggedRobot, SimulatorLog, read_simulator_log
from ciberrato.files.start_grid import read_grid
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.world.parameters import Parameters
from simulator_stub.recording.log import log_header, log_record
from simulator_stub.simulation import Simulation

STOPPED_CYCLES = 20
"""Cycles before the start, so that late readings have arrived as they had in the recordings."""

_NOISY = re.compile(
    r'(?<=<Pos )X="[^"]*" Y="[^"]*" Dir="[^"]*"|(?<=<Scores )[^/]*(?=VisitedMask)|(?<=<Sensors )[^>]*'
    r'|(?<=Sensor Id="\d" )Value="[^"]*"|(?<=<GPS )X="[^"]*" Y="[^"]*"'
)
_LINE = re.compile(r'(?<=<LineSensor )Value="[01]*"')


def rows(golden: Path, labs: Path | None) -> Iterator[Finding]:
    """Yield a row for each recorded log."""
    del labs
    folders = sorted(path.parent for path in golden.glob("logs/*/sim.log.gz"))
    if not folders:
        yield Finding("logs", 0, None, True, "skipped: no logs here")
    for folder in folders:
        yield _row(folder)


def _row(folder: Path) -> Finding:
    recorded = read_simulator_log(folder / "sim.log.gz")
    with gzip.open(folder / "sim.log.gz", "rt", encoding="latin-1", newline="") as file:
        theirs = file.read()
    parameters = replace(
        read_parameters(folder / "param.xml"),
        lab_file=recorded.header.parameters.lab_file,
        grid_file=recorded.header.parameters.grid_file,
    )
    ours = replayed(recorded, folder, parameters)
    noisy = has_noise(parameters)
    if noisy:
        theirs, ours = _NOISY.sub("", theirs), _NOISY.sub("", ours)
    if parameters.line_sensor_true_probability < 1.0:
        theirs, ours = _LINE.sub("", theirs), _LINE.sub("", ours)
    cases = theirs.count("<LogInfo ")
    note = f"records; {len(ours):,} characters equal"
    if noisy:
        note += ", poses and readings left out: noise"
    if ours != theirs:
        pairs = enumerate(zip_longest(theirs.split("\n"), ours.split("\n"), fillvalue="nothing"), 1)
        line, one, other = next((line, *pair) for line, pair in pairs if pair[0] != pair[1])
        note = f"line {line} is {one.strip()!r}, ours {other.strip()!r}"
    return Finding(f"log {folder.name}", cases, None, ours == theirs, note)


def has_noise(parameters: Parameters) -> bool:
    """Return whether poses or readings (but those of the line sensor) depend on random numbers."""
    p = parameters
    return any((p.motors_noise, p.compass_noise, p.obstacle_noise, p.beacon_noise)) or (
        p.gps and p.gps_linear_noise > 0.0
    )


def replayed(recorded: SimulatorLog, folder: Path, parameters: Parameters) -> str:
    """Drive the recorded robots again, and write the log."""
    simulation = Simulation(read_lab(folder / "lab.xml"), read_grid(folder / "grid.xml"), parameters)
    simulation.gps_offset = GPS_OFFSET
    for robot in recorded.records[0].robots:
        simulation.register(RobotRegistration(name=robot.name, robot_id=robot.robot_id))
    for _ in range(STOPPED_CYCLES):
        simulation.step()
    simulation.start()
    simulation.step()
    text = log_header(simulation, recorded.header.date)
    for record in recorded.records:
        over = record is recorded.records[-1]
        simulation.begin_cycle()
        if not over:
            for robot in record.robots:
                simulation.act(robot.robot_id, _actions(robot))
        text += log_record(simulation, over=over)
        simulation.advance()
        simulation.end_cycle()
    return text + "</Log>\n"


def _actions(robot: LoggedRobot) -> Actions:
    """Return the actions of the record; a lone VisitingLed shows in the LEDs only."""
    actions = robot.actions or Actions()
    return replace(actions, visiting_led=robot.measures.visiting_led) if not robot.actions else actions
