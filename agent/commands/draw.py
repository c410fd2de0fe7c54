"""The subcommand ``draw``: figures of the lab, its sensors, and a run."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from agent.commands import option_types
from agent.commands.files import check_size, read_lab_file
from agent.commands.parser import OptionParser, add_salvage
from agent.run.reporter import PROGRAM, Reporter
from ciberrato.errors import UsageError
from ciberrato.geometry.angles import short_turn
from ciberrato.world.lab import CELL_SIZE

if TYPE_CHECKING:
    from agent.run.signals import Interrupts
    from ciberrato.files.run_records import RecordedRun
    from ciberrato.world.coordinates import Cell
    from ciberrato.world.lab import Lab


def make_parser() -> OptionParser:
    """Return the parser of the subcommand."""
    parser = OptionParser(
        f"{PROGRAM} draw",
        "Draw a figure; the ending of its name (png, svg, pdf) chooses the format.\n\n"
        "  walls     the lab as the agent stores it\n"
        "  cones     the sensors in one cell (--cell), and the wall point that each sees\n"
        "  table     what each sensor should read in every cell\n"
        "  beliefs   one panel per step (--beliefs; --truth rings the true cell)\n"
        "  curves    probability and entropy over the steps (--beliefs)\n"
        "  errors    error of the dead reckoning over the run (--run and --truth)",
    )
    add = parser.add_argument
    add("what", choices=("walls", "cones", "table", "beliefs", "curves", "errors"), metavar="WHAT")
    add("-m", "--map", default="standard", metavar="LAB", help="lab file or name; default: standard")
    add("-o", "--output", type=Path, required=True, metavar="FILE", help="figure")
    add("--cell", default="1,1", metavar="X,Y", help="point of the cell, in units; default: 1,1")
    add("--heading", type=float, default=0.0, metavar="DEGREES", help="heading of the robot; default: 0")
    add(
        "--angles",
        type=option_types.angles,
        default=(0.0, 90.0, -90.0, 180.0),
        metavar="A,B,C,D",
        help="angles of the sensors, degrees; default: 0,90,-90,180",
    )
    add("--distance", choices=("sensor", "cone"), default="sensor", help="distance model; default: sensor")
    add("--beliefs", type=Path, metavar="FILE", help="belief file, localization.out")
    add("--run", type=Path, metavar="FILE", help="the run's log, run.jsonl")
    add("--truth", type=Path, metavar="FILE", help="the simulator's true poses, CSV")
    add_salvage(parser)
    add("--every-step", action="store_true", help="beliefs: cut no tail of certain steps")
    return parser


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Draw the requested figures; return the exit status."""
    lab, _, _ = read_lab_file(options.map)
    _DRAWINGS[options.what](options, lab)
    print(f"figure: {options.output}")
    return 0


def _draw_walls(options: argparse.Namespace, lab: Lab) -> None:
    from agent.views.figures.labmaps import wall_map

    wall_map(lab, options.output)


def _draw_cones(options: argparse.Namespace, lab: Lab) -> None:
    from agent.views.figures.labmaps import sensor_cones

    cell = _cell(options.cell, lab)
    sensor_cones(lab, cell, options.angles, options.output, model=options.distance, heading=options.heading)


def _draw_table(options: argparse.Namespace, lab: Lab) -> None:
    from agent.offline.expected_readings import compute_expected_readings
    from agent.views.figures.labmaps import expected_readings_maps

    expected = compute_expected_readings(lab, options.angles, model=options.distance)
    expected_readings_maps(lab, expected, options.angles, options.output)


def _draw_beliefs(options: argparse.Namespace, lab: Lab) -> None:
    from agent.views.figures.beliefs import belief_panels
    from ciberrato.files.beliefs import read_beliefs

    beliefs = read_beliefs(_needed(options, "beliefs"))[-1].beliefs
    check_size(beliefs.shape, lab)
    cells = _true_cells(options, len(beliefs))
    belief_panels(
        beliefs, options.output, lab=lab, true_cells=cells, title=lab.name, every_step=options.every_step
    )


def _draw_curves(options: argparse.Namespace, lab: Lab) -> None:
    from agent.views.figures.curves import step_curves
    from ciberrato.files.beliefs import read_beliefs

    beliefs = read_beliefs(_needed(options, "beliefs"))[-1].beliefs
    step_curves(beliefs, options.output, true_cells=_true_cells(options, len(beliefs)))


def _draw_errors(options: argparse.Namespace, lab: Lab) -> None:
    import numpy as np

    from agent.views.figures.curves import pose_error_curves
    from ciberrato.files.truth import read_truth

    run, poses = _read_run(options, _needed(options, "run")), read_truth(_needed(options, "truth"))
    cycles = [cycle for cycle in run.cycles if cycle.time in poses]
    if any(cycle.displacement is None for cycle in cycles):
        raise UsageError(f"{options.run} has no dead reckoning: only the drive to the right logs it")
    if not cycles:
        raise UsageError(f"{options.run} and {options.truth} have no cycle in common: give those of one run")
    start = poses[min(poses)]
    rows = []
    for cycle in cycles:
        x, y, heading = poses[cycle.time]
        turned = math.degrees(short_turn(math.radians((cycle.heading or 0.0) - heading)))
        along, lateral = cycle.displacement or 0.0, cycle.lateral or 0.0
        rows.append((along - (x - start[0]), lateral - (y - start[1]), turned))
    deviations = np.array([cycle.spread or (0.0, 0.0, 0.0) for cycle in cycles])
    pose_error_curves([cycle.time for cycle in cycles], np.array(rows), deviations, options.output)


_DRAWINGS: dict[str, Callable[[argparse.Namespace, Lab], None]] = {
    "walls": _draw_walls,
    "cones": _draw_cones,
    "table": _draw_table,
    "beliefs": _draw_beliefs,
    "curves": _draw_curves,
    "errors": _draw_errors,
}


def _read_run(options: argparse.Namespace, path: Path) -> RecordedRun:
    from ciberrato.files.run_log import read_run

    return read_run(path, salvage=Reporter().warn if options.salvage else None)


def _needed(options: argparse.Namespace, name: str) -> Path:
    path = getattr(options, name)
    if not isinstance(path, Path):
        raise UsageError(f"draw {options.what} needs --{name} FILE")
    return path


def _true_cells(options: argparse.Namespace, blocks: int) -> list[Cell | None] | None:
    """Return the true cell of each block; the log has the cycle of each step."""
    if options.truth is None:
        return None
    from ciberrato.files.truth import read_truth, true_cells

    if options.run is None:
        raise UsageError("--truth needs --run, too: the log tells at which cycle each step was")
    steps = _read_run(options, options.run).steps
    if len(steps) + 1 != blocks:
        raise UsageError(f"{options.run} has {len(steps)} steps, the belief file {blocks - 1}")
    return [None, *true_cells(read_truth(options.truth), [step.time for step in steps])]


def _cell(text: str, lab: Lab) -> Cell:
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"--cell: {text!r} is not a point X,Y") from None
    if not (0 <= x < lab.columns * CELL_SIZE and 0 <= y < lab.rows * CELL_SIZE):
        raise UsageError(f"--cell: ({x:g}, {y:g}) is outside the cells of {lab.name!r}")
    return int(y // CELL_SIZE), int(x // CELL_SIZE)
