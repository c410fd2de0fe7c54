"""The subcommands that show: ``draw``, ``compare``, ``animate``, ``watch`` and ``overlay``."""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import select
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from agent import optiontypes
from agent.optionparser import OptionParser, add_replay, read_lab_file
from agent.run.reporter import PROGRAM
from ciberrato.errors import UsageError
from ciberrato.world.lab import CELL_SIZE

if TYPE_CHECKING:
    from types import FrameType

    from agent.offline.summary import Cell
    from ciberrato.world.lab import Lab


def show(command: str, words: Sequence[str]) -> int:
    """Run one of the subcommands.

    Parameters
    ----------
    command : str
        Its name.
    words : sequence of str
        The rest of the command line.

    Returns
    -------
    int
        Exit status 0.

    Raises
    ------
    CiberratoError
        For what the user can put right.
    """
    parser, run = _COMMANDS[command]
    run(parser().parse_args(words))
    return 0


# --- draw ----------------------------------------------------------------------------------------


def _draw_parser() -> OptionParser:
    parser = OptionParser(
        f"{PROGRAM} draw",
        "Draw a figure; the ending of its name (png, svg, pdf) chooses the format.\n\n"
        "  walls     the lab as the agent stores it\n"
        "  cones     the sensors in one cell (--cell), and the wall point that each sees\n"
        "  table     what each sensor should read in every cell\n"
        "  beliefs   a panel a step (--beliefs; --truth rings the true cell)\n"
        "  curves    probability and entropy over the steps (--beliefs)\n"
        "  errors    error of the dead reckoning over the run (--run and --truth)",
    )
    add = parser.add_argument
    add("what", choices=("walls", "cones", "table", "beliefs", "curves", "errors"), metavar="WHAT")
    add("-m", "--map", default="standard", metavar="LAB", help="lab file or name; default: standard")
    add("-o", "--output", type=Path, required=True, metavar="FILE", help="the figure")
    add("--cell", default="1,1", metavar="X,Y", help="a point of the cell, in units; default: 1,1")
    add("--heading", type=float, default=0.0, metavar="DEGREES", help="of the robot; default: 0")
    add(
        "--angles",
        type=optiontypes.angles,
        default=(0.0, 90.0, -90.0, 180.0),
        metavar="A,B,C,D",
        help="of the sensors, degrees; default: 0,90,-90,180",
    )
    add("--distance", choices=("sensor", "cone"), default="sensor", help="distance model; default: sensor")
    add("--beliefs", type=Path, metavar="FILE", help="belief file, localization.out")
    add("--run", type=Path, metavar="FILE", help="the run's log, run.jsonl")
    add("--truth", type=Path, metavar="FILE", help="the simulator's true poses, CSV")
    add("--every-step", action="store_true", help="beliefs: cut no tail of certain steps")
    return parser


def _draw(options: argparse.Namespace) -> None:
    lab, _, _ = read_lab_file(options.map)
    _DRAWINGS[options.what](options, lab)
    print(f"figure: {options.output}")


def _draw_walls(options: argparse.Namespace, lab: Lab) -> None:
    from agent.views.figures.labmaps import wall_map

    wall_map(lab, options.output)


def _draw_cones(options: argparse.Namespace, lab: Lab) -> None:
    from agent.views.figures.labmaps import sensor_cones

    cell = _cell(options.cell, lab)
    sensor_cones(lab, cell, options.angles, options.output, model=options.distance, heading=options.heading)


def _draw_table(options: argparse.Namespace, lab: Lab) -> None:
    from agent.offline.expected_readings import compute_ground_truth
    from agent.views.figures.labmaps import ground_truth_maps

    truth = compute_ground_truth(lab, options.angles, model=options.distance)
    ground_truth_maps(lab, truth, options.angles, options.output)


def _draw_beliefs(options: argparse.Namespace, lab: Lab) -> None:
    from agent.views.figures.beliefs import belief_panels
    from ciberrato.files.beliefs import read_beliefs

    beliefs = read_beliefs(_needed(options, "beliefs"))[-1].beliefs
    _check_size(beliefs.shape, lab)
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

    from agent.offline.truth_file import read_truth
    from agent.views.figures.curves import pose_error_curves
    from ciberrato.files.run_log import read_run

    run, poses = read_run(_needed(options, "run")), read_truth(_needed(options, "truth"))
    cycles = [cycle for cycle in run.cycles if cycle.time in poses]
    if not cycles:
        raise UsageError(f"{options.run} and {options.truth} have no cycle in common: give those of one run")
    start = poses[min(poses)]
    rows = []
    for cycle in cycles:
        x, y, heading = poses[cycle.time]
        turned = math.degrees(math.remainder(math.radians(cycle.heading - heading), 2 * math.pi))
        rows.append((cycle.displacement - (x - start[0]), cycle.lateral - (y - start[1]), turned))
    deviations = np.array([cycle.spread for cycle in cycles])
    pose_error_curves([cycle.time for cycle in cycles], np.array(rows), deviations, options.output)


_DRAWINGS: dict[str, Callable[[argparse.Namespace, Lab], None]] = {
    "walls": _draw_walls,
    "cones": _draw_cones,
    "table": _draw_table,
    "beliefs": _draw_beliefs,
    "curves": _draw_curves,
    "errors": _draw_errors,
}


def _needed(options: argparse.Namespace, name: str) -> Path:
    path = getattr(options, name)
    if not isinstance(path, Path):
        raise UsageError(f"draw {options.what} needs --{name} FILE")
    return path


def _true_cells(options: argparse.Namespace, blocks: int) -> list[Cell | None] | None:
    """Look up the true cell of each block; the log tells at which cycle each step was."""
    if options.truth is None:
        return None
    from agent.offline.truth_file import read_truth, true_cells
    from ciberrato.files.run_log import read_run

    if options.run is None:
        raise UsageError("--truth needs --run, too: the log tells at which cycle each step was")
    steps = read_run(options.run).steps
    if len(steps) + 1 != blocks:
        raise UsageError(f"{options.run} has {len(steps)} steps, the belief file {blocks - 1}")
    return [None, *true_cells(read_truth(options.truth), [step.time for step in steps])]


def _check_size(shape: tuple[int, ...], lab: Lab) -> None:
    if shape[1:] != (lab.rows, lab.columns):
        raise UsageError(
            f"the beliefs have {shape[1]} x {shape[2]} cells, but the lab {lab.name!r} has {lab.rows} x "
            f"{lab.columns}: give the lab of that run (-m)"
        )


def _cell(text: str, lab: Lab) -> Cell:
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"--cell: {text!r} is not a point X,Y") from None
    if not (0 <= x < lab.columns * CELL_SIZE and 0 <= y < lab.rows * CELL_SIZE):
        raise UsageError(f"--cell: ({x:g}, {y:g}) is outside the cells of {lab.name!r}")
    return int(y // CELL_SIZE), int(x // CELL_SIZE)


# --- compare -------------------------------------------------------------------------------------


def _compare_parser() -> OptionParser:
    parser = OptionParser(f"{PROGRAM} compare", "Say where and by how much two belief files differ.")
    parser.add_argument("first", type=Path, metavar="FILE")
    parser.add_argument("second", type=Path, metavar="FILE")
    parser.add_argument("--png", type=Path, metavar="FILE", help="draw the differences there")
    parser.add_argument("-m", "--map", metavar="LAB", help="draw the walls of this lab over them")
    return parser


def _compare(options: argparse.Namespace) -> None:
    from agent.offline.comparison import compare_beliefs, comparison_table
    from ciberrato.files.beliefs import read_beliefs

    first, second = (read_beliefs(path)[-1].beliefs for path in (options.first, options.second))
    comparison = compare_beliefs(first, second)
    print(comparison_table(comparison))
    if options.png is not None:
        from agent.views.figures.differences import difference_panels

        lab = None if options.map is None else read_lab_file(options.map)[0]
        if lab is not None:
            _check_size(first.shape, lab)
        names = (options.first.name, options.second.name)
        if names[0] == names[1]:
            names = (str(options.first), str(options.second))
        difference_panels(comparison, options.png, lab=lab, names=names)
        print(f"figure: {options.png}")


# --- animate -------------------------------------------------------------------------------------


def _animate_parser() -> OptionParser:
    parser = OptionParser(
        f"{PROGRAM} animate",
        "Draw a run as a moving picture: gif, html (one file, works offline), mp4 where ffmpeg is installed.",
    )
    add = parser.add_argument
    add("run", type=Path, metavar="RUN", help="the run's log, run.jsonl, or that of a simulator")
    add("-m", "--map", metavar="LAB", help="lab file or name; not needed with a simulator's log")
    add("-o", "--output", type=Path, required=True, metavar="FILE", help="the animation")
    add(
        "--truth",
        type=Path,
        metavar="FILE",
        help="draw the robot at the simulator's true poses (CSV); a simulator's log has them",
    )
    add_replay(parser)
    add("--every", type=int, default=4, metavar="N", help="cycles a frame; default: 4")
    return parser


def _animate(options: argparse.Namespace) -> None:
    from agent.offline.anyrun import read_recorded
    from agent.offline.localization import ground_truth_of, localize_run
    from agent.offline.truth_file import read_truth
    from agent.views.figures.animation import animate_run, check_animation

    check_animation(options.output)
    if options.every < 1:
        raise UsageError(f"--every: {options.every} is not a number of cycles, 1 or more")
    run, lab, poses = read_recorded(options.run, options.angles, robot=options.robot)
    if lab is None or options.map is not None:
        lab = _named_lab(options)
    if options.truth is not None:
        poses = read_truth(options.truth)
    found = localize_run(run, ground_truth_of(run.header, lab))
    frames = animate_run(run, found.beliefs, lab, options.output, truth=poses, every=options.every)
    print(f"animation: {options.output}, {frames} frames")


def _named_lab(options: argparse.Namespace) -> Lab:
    if options.map is None:
        raise UsageError(f"-m LAB is needed: {options.run} does not hold its lab, as a simulator's log does")
    return read_lab_file(options.map)[0]


# --- watch ---------------------------------------------------------------------------------------


def _watch_parser() -> OptionParser:
    parser = OptionParser(
        f"{PROGRAM} watch",
        "Show a run while it goes on: one screen, redrawn as the log grows. Ctrl-C ends it.",
    )
    add = parser.add_argument
    add("run", type=Path, metavar="RUN", help="the run's log, run.jsonl, or that of a simulator")
    add("-m", "--map", metavar="LAB", help="lab file or name; not needed with a simulator's log")
    add_replay(parser)
    add("--once", action="store_true", help="show what is there and end")
    add("--until-eof", action="store_true", help="end when standard input ends, too")
    return parser


def _watch(options: argparse.Namespace) -> None:
    from agent.views.logfollower import SimulatorLogFollower
    from agent.views.watching import watch
    from ciberrato.files.log_kind import is_simulator_log

    ended = _Ending(options.until_eof)
    source: Path | SimulatorLogFollower = options.run
    # An agent's log may not exist yet.
    if options.run.exists() and is_simulator_log(options.run):
        source = SimulatorLogFollower(options.run, options.angles, robot=options.robot)
    held = None if isinstance(source, Path) else source.lab
    lab = held if held is not None and options.map is None else _named_lab(options)
    colour = sys.stdout.isatty() and "NO_COLOR" not in os.environ
    watch(source, lab, once=options.once, colour=colour, ended=ended)


class _Ending:
    """Tells a view when to end: by a signal, or when standard input ends, too.

    Parameters
    ----------
    until_eof : bool
        Standard input is a pipe from the agent that started the view; it ends with the agent, however that
        ends.
    """

    def __init__(self, until_eof: bool) -> None:
        self._until_eof = until_eof
        self._told = False
        signal.signal(signal.SIGTERM, self._tell)
        signal.signal(signal.SIGINT, self._tell)

    def __call__(self) -> bool:
        if self._until_eof and select.select([0], [], [], 0.0)[0]:
            self._told = self._told or not os.read(0, 1024)
        return self._told

    def _tell(self, number: int, frame: FrameType | None) -> None:
        self._told = True


# --- overlay -------------------------------------------------------------------------------------


def _overlay_parser() -> OptionParser:
    parser = OptionParser(
        f"{PROGRAM} overlay", "Send what a run's agent believes to a ciberrato-viewer. Ctrl-C ends it."
    )
    add = parser.add_argument
    add("run", type=Path, metavar="RUN", help="the run's log, run.jsonl; may not exist yet")
    add("-m", "--map", required=True, metavar="LAB", help="lab file or name")
    add("--viewer", default="", metavar="PORT", help="where the viewer takes overlays; default: 6001")
    add("--until-eof", action="store_true", help="end when standard input ends, too")
    return parser


def _overlay(options: argparse.Namespace) -> None:
    from agent.views.overlaying import show_overlays
    from ciberrato.net.address import parse_address
    from ciberrato.net.overlay import OverlayClient
    from ciberrato.overlay import OVERLAY_PORT

    ended = _Ending(options.until_eof)
    lab, _, _ = read_lab_file(options.map)
    _, port = parse_address(f"127.0.0.1:{options.viewer or OVERLAY_PORT}")
    with OverlayClient(port=port) as client:
        show_overlays(options.run, lab, client, ended=ended)


@contextlib.contextmanager
def beside(log: Path, *views: Sequence[str]) -> Iterator[None]:
    """Show a run by processes of their own as long as the block lasts.

    Parameters
    ----------
    log : Path
        Of the run; what an earlier run left there is removed, so that it is not shown.
    *views : sequence of str
        Command lines of subcommands that follow the log.
    """
    import subprocess

    from ciberrato.processes import module_command

    log.unlink(missing_ok=True)
    # A process group of their own: Ctrl-C is meant for the run. The end of the pipe ends them, when the log
    # is complete, or when this process is no more.
    processes = [
        subprocess.Popen(
            module_command("agent", *view, "--until-eof"), stdin=subprocess.PIPE, process_group=0
        )
        for view in views
    ]
    try:
        yield
    finally:
        for process in processes:
            process.communicate()


_COMMANDS: dict[str, tuple[Callable[[], OptionParser], Callable[[argparse.Namespace], None]]] = {
    "draw": (_draw_parser, _draw),
    "compare": (_compare_parser, _compare),
    "animate": (_animate_parser, _animate),
    "watch": (_watch_parser, _watch),
    "overlay": (_overlay_parser, _overlay),
}
