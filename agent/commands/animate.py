"""The subcommand ``animate``: a run as a moving picture."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from agent.commands.files import read_lab_file
from agent.commands.parser import OptionParser
from agent.run.reporter import PROGRAM
from ciberrato.errors import UsageError

if TYPE_CHECKING:
    from agent.run.signals import Interrupts


def make_parser() -> OptionParser:
    """Return the parser of the subcommand."""
    parser = OptionParser(
        f"{PROGRAM} animate",
        "Draw a run as a moving picture: gif, html (one file, works offline), mp4 where ffmpeg is installed.",
    )
    add = parser.add_argument
    add("run", type=Path, metavar="RUN", help="the run's log, run.jsonl")
    add("-m", "--map", required=True, metavar="LAB", help="lab file or name")
    add("-o", "--output", type=Path, required=True, metavar="FILE", help="the animation")
    add("--truth", type=Path, metavar="FILE", help="draw the robot at the simulator's true poses (CSV)")
    add("--every", type=int, default=4, metavar="N", help="cycles a frame; default: 4")
    return parser


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Draw the animation; return the exit status."""
    from agent.offline.localization import expected_readings_of, localize_run
    from agent.views.figures.animation import animate_run, check_animation
    from ciberrato.files.run_log import read_run
    from ciberrato.files.truth import read_truth

    check_animation(options.output)
    if options.every < 1:
        raise UsageError(f"--every: {options.every} is not a number of cycles, 1 or more")
    run, (lab, _, _) = read_run(options.run), read_lab_file(options.map)
    poses = None if options.truth is None else read_truth(options.truth)
    found = localize_run(run, expected_readings_of(run.header, lab))
    frames = animate_run(run, found.beliefs, lab, options.output, truth=poses, every=options.every)
    print(f"animation: {options.output}, {frames} frames")
    return 0
