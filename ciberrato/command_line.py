"""The parser that all programs share: an error is one line, and options are never abbreviated."""

from __future__ import annotations

import argparse
import sys
from typing import Any, NoReturn

from ciberrato.errors import UsageError
from ciberrato.system.process import take_any_character
from ciberrato.version import __version__


class ProgramParser(argparse.ArgumentParser):
    """A parser with ``--version`` whose errors are `UsageError`.

    Parameters
    ----------
    program : str
        Its name, and that of the subcommand if it is one.
    description : str
    **options
        As for `argparse.ArgumentParser`.
    """

    def __init__(self, program: str, description: str, **options: Any) -> None:
        super().__init__(prog=program, description=description, allow_abbrev=False, **options)
        version = f"ciberrato {__version__}"
        self.add_argument("--version", action="version", version=version, help="show the version and end")

    def parse_known_args(self, *arguments: Any, **options: Any) -> Any:
        """Parse; from then on any character can be printed."""
        take_any_character(sys.stdout)
        return super().parse_known_args(*arguments, **options)

    def error(self, message: str) -> NoReturn:
        """Raise what is wrong with the command line."""
        raise UsageError(f"{message} (see {self.prog} --help)")
