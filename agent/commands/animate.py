"""The subcommand ``animate``: a run as a moving picture."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from agent.commands.files import named_lab
from agent.commands.parser import OptionParser, add_replay, add_salvage
from agent.run.reporter import PROGRAM, Reporter
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
    add("run", type=Path, metavar="RUN", help="log of the run: run.jsonl, or that of a simulator")
    add("-m", "--map", metavar="LAB", help="lab file or name; not needed with a simulator's log")
    add("-o", "--output", type=Path, required=True, metavar="FILE", help="animation")
    add(
        "--truth",
        type=Path,
        metavar="FILE",
        help="draw the robot at the simulator's true poses (CSV); not needed with a simulator's log",
    )
    add_replay(parser)
    add_salvage(parser)
    add("--every", type=int, default=4, metavar="N", help="number of cycles per frame; default: 4")
    return parser


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Draw the animation; return the exit status."""
    from agent.offline.anyrun import read_recorded
    from agent.offline.localization import expected_readings_of, localize_run
    from agent.views.figures.animation import animate_poses, animate_run, check_animation
    from ciberrato.files.truth import read_truth

    check_animation(options.output)
    if options.every < 1:
        raise UsageError(f"--every: {options.every} is not a number of cycles, 1 or more")
    run, lab, poses = read_recorded(
        options.run,
        options.angles,
        robot=options.robot,
        salvage=Reporter().warn if options.salvage else None,
    )
    if lab is None or options.map is not None:
        lab = named_lab(options.map, options.run)
    if options.truth is not None:
        poses = read_truth(options.truth)
    if run.drives_right:
        found = localize_run(run, expected_readings_of(run.header, lab))
        frames = animate_run(run, found.beliefs, lab, options.output, truth=poses, every=options.every)
    else:
        frames = animate_poses(run, lab, options.output, truth=poses, every=options.every)
    print(f"animation: {options.output}, {frames} frames")
    return 0
