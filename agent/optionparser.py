"""The parser that all subcommands share, and what several of them read."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from agent import optiontypes
from agent.run.reporter import Reporter
from ciberrato.command_line import ProgramParser
from ciberrato.errors import UsageError

if TYPE_CHECKING:
    from ciberrato.world.lab import Lab

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
        self.add_argument("--help", action="help", help="show this and end")


def read_lab_file(name_or_path: str, *, strict: bool = False) -> tuple[Lab, Path, bytes]:
    """Read the lab that a command line names.

    Parameters
    ----------
    name_or_path : str
        A file, or the name of a lab that ships.
    strict : bool
        Refuse a lab with warnings.

    Returns
    -------
    lab : Lab
    path : Path
        The file.
    data : bytes
        Its contents.

    Raises
    ------
    UsageError
        If there is no such lab, it cannot be read, or there are warnings and `strict`.
    LabError
        If its contents are wrong.
    """
    from ciberrato.checks.telling import tell
    from ciberrato.checks.things import thing_findings
    from ciberrato.files.lab import parse_lab_file
    from ciberrato.labs import find_lab

    path = find_lab(name_or_path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    file = parse_lab_file(data, str(path))
    tell([*file.findings, *thing_findings(file)], Reporter().warn, strict=strict)
    return file.lab, path, data


def add_strict(parser: argparse.ArgumentParser) -> None:
    """Add ``--strict``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
    """
    parser.add_argument("--strict", action="store_true", help="refuse a lab with warnings")


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
    text = f"decimals, 2 to 17; default: {shown}"
    parser.add_argument("--precision", type=optiontypes.precision, default=default, metavar="N", help=text)


def check_output(path: Path) -> None:
    """Refuse a file that cannot be written, before the run and not after it.

    Parameters
    ----------
    path : Path

    Raises
    ------
    UsageError
        If it is a directory, or is in none that can be written.
    """
    folder = path.parent
    if path.is_dir():
        raise UsageError(f"{path}: is a directory; give a file")
    if not folder.is_dir():
        raise UsageError(f"{path}: there is no directory {folder}")
    if not os.access(folder, os.W_OK | os.X_OK) or (path.exists() and not os.access(path, os.W_OK)):
        raise UsageError(f"{path}: cannot be written: permission denied")
