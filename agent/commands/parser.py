"""The parser that all subcommands share, and the options that several of them have."""

from __future__ import annotations

import argparse
from pathlib import Path

from agent.commands import option_types
from ciberrato.command_line import ProgramParser

DEFAULT_OUTPUT = Path("localization.out")

PRESETS = ("calibrated", "seed")
DISTANCES = ("sensor", "cone")
# As in ciberrato.files.run_records, which is not imported yet: making its records takes time that the
# registration should not wait for.


class OptionParser(ProgramParser):
    """The parser of all subcommands: ``-h`` is left for the host.

    Parameters
    ----------
    usage : str
        Program and subcommand.
    description : str
    """

    def __init__(self, usage: str, description: str) -> None:
        super().__init__(
            usage, description, add_help=False, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        self.add_argument("--help", action="help", help="show this help and end")


def add_output(parser: argparse.ArgumentParser) -> None:
    """Add ``--output``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    """
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=DEFAULT_OUTPUT,
        metavar="FILE",
        help=f"belief file; default: {DEFAULT_OUTPUT}",
    )


def add_precision(parser: argparse.ArgumentParser, default: int | None) -> None:
    """Add ``--precision``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    default : int or None
        None = that of the run.
    """
    shown = "that of the run" if default is None else default
    text = f"number of decimals, 2 to 17; default: {shown}"
    parser.add_argument("--precision", type=option_types.precision, default=default, metavar="N", help=text)


def add_strict(parser: argparse.ArgumentParser) -> None:
    """Add ``--strict``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    """
    parser.add_argument("--strict", action="store_true", help="refuse a lab that has warnings")


def add_replay(parser: argparse.ArgumentParser) -> None:
    """Add ``--angles`` and ``--robot``: what a simulator's log does not hold, and which robot's run is meant.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    """
    parser.add_argument(
        "--angles",
        type=option_types.angles,
        default=(0.0, 90.0, -90.0, 180.0),
        metavar="A,B,C,D",
        help="angles of the IR sensors, degrees, for a simulator's log; default: 0,90,-90,180",
    )
    parser.add_argument(
        "--robot",
        type=option_types.count,
        metavar="N",
        help="id of the robot in a simulator's log; default: the first",
    )


def add_salvage(parser: argparse.ArgumentParser) -> None:
    """Add ``--salvage``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    """
    parser.add_argument(
        "--salvage",
        action="store_true",
        help="skip unreadable lines of the log, each with a warning",
    )
