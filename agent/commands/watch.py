"""The subcommand ``watch``: a run as it goes on, in the terminal."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from agent.commands.beside import Ending
from agent.commands.files import named_lab
from agent.commands.parser import OptionParser, add_replay, add_salvage
from agent.run.reporter import PROGRAM, Reporter

if TYPE_CHECKING:
    from agent.run.signals import Interrupts


def make_parser() -> OptionParser:
    """Return the parser of the subcommand."""
    parser = OptionParser(
        f"{PROGRAM} watch",
        "Show a run while it goes on: one screen, redrawn as the log grows. Ctrl-C ends it.",
    )
    add = parser.add_argument
    add("run", type=Path, metavar="RUN", help="log of the run: run.jsonl, or that of a simulator")
    add("-m", "--map", metavar="LAB", help="lab file or name; not needed with a simulator's log")
    add_replay(parser)
    add_salvage(parser)
    add("--once", action="store_true", help="show what is there and end")
    add("--until-eof", action="store_true", help="end when standard input ends, too")
    return parser


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Show the run until it or its reader ends; return the exit status."""
    from agent.views.logfollower import Follower, LogFollower, SimulatorLogFollower
    from agent.views.watching import watch
    from ciberrato.files.log_kind import is_simulator_log

    ended = Ending(options.until_eof)
    source: Follower = LogFollower(options.run, salvage=Reporter().warn if options.salvage else None)
    # An agent's log may not exist yet.
    if options.run.exists() and is_simulator_log(options.run):
        source = SimulatorLogFollower(options.run, options.angles, robot=options.robot)
    held = source.lab if isinstance(source, SimulatorLogFollower) else None
    lab = held if held is not None and options.map is None else named_lab(options.map, options.run)
    colour = sys.stdout.isatty() and "NO_COLOR" not in os.environ
    watch(source, lab, once=options.once, colour=colour, ended=ended)
    return 0
