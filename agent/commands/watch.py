"""The subcommand ``watch``: a run as it goes on, in the terminal."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from agent.commands.beside import Ending
from agent.commands.files import read_lab_file
from agent.commands.parser import OptionParser
from agent.run.reporter import PROGRAM

if TYPE_CHECKING:
    from agent.run.signals import Interrupts


def make_parser() -> OptionParser:
    """Return the parser of the subcommand."""
    parser = OptionParser(
        f"{PROGRAM} watch",
        "Show a run while it goes on: one screen, redrawn as the log grows. Ctrl-C ends it.",
    )
    add = parser.add_argument
    add("run", type=Path, metavar="RUN", help="the run's log, run.jsonl; may not exist yet")
    add("-m", "--map", required=True, metavar="LAB", help="lab file or name")
    add("--once", action="store_true", help="show what is there and end")
    add("--until-eof", action="store_true", help="end when standard input ends, too")
    return parser


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Show the run until it or its reader ends; return the exit status."""
    from agent.views.watching import watch

    ended = Ending(options.until_eof)
    lab, _, _ = read_lab_file(options.map)
    colour = sys.stdout.isatty() and "NO_COLOR" not in os.environ
    watch(options.run, lab, once=options.once, colour=colour, ended=ended)
    return 0
