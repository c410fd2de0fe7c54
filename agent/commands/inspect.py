"""The subcommand ``inspect``: look into a belief file."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from agent.commands.files import read_lab_file
from agent.commands.parser import OptionParser
from agent.run.reporter import PROGRAM
from ciberrato.errors import UsageError

if TYPE_CHECKING:
    from agent.run.signals import Interrupts


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Print what the file says, and draw it if asked to; return the exit status."""
    import shutil

    from agent.views.inspection import inspect

    _refuse_log(options.file)
    lab = None if options.map is None else read_lab_file(options.map)[0]
    width = shutil.get_terminal_size().columns
    inspect(options.file, png=options.png, lab=lab, width=width, colour=sys.stdout.isatty())
    return 0


def _refuse_log(path: Path) -> None:
    """Refuse the log of a run by its first byte, and say which commands read one."""
    try:
        with path.open("rb") as stream:
            is_log = stream.read(1) == b"{"
    except OSError:
        return  # reading it as a belief file says what is wrong
    if is_log:
        raise UsageError(
            f"{path}: this is the log of a run, not a belief file like localization.out: "
            f"{PROGRAM} localize {path} -m LAB makes one of it, {PROGRAM} watch {path} -m LAB shows the run"
        )


def make_parser() -> OptionParser:
    """Return the parser of the subcommand."""
    parser = OptionParser(f"{PROGRAM} inspect", "Validate a belief file and show what it says.")
    parser.add_argument("file", type=Path, metavar="FILE", help="the belief file, localization.out")
    parser.add_argument("--png", type=Path, metavar="FILE", help="draw all steps there")
    parser.add_argument("-m", "--map", metavar="LAB", help="draw the walls of this lab over them")
    return parser
