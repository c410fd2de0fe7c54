"""The command line of ciberrato: one name for all programs, for ``uvx ciberrato ...`` and ``pipx run``."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence

from ciberrato.version import __version__

PROGRAMS = {
    "demo": ("ciberrato.front.demo", "run simulator and agent once, and show what the robot believes"),
    "simulator": ("simulator_stub.cli", "simulate a lab for robots and viewers"),
    "agent": ("agent.cli", "drive a robot that finds out where it is"),
    "viewer": ("ciberrato.viewer.cli", "show any CiberRato simulator in the browser"),
    "grade": ("ciberrato.grading.cli", "run a course's agents in its labs, and report"),
    "lab": ("ciberrato.labtool.cli", "make, draw and check labs"),
    "evaluate": ("ciberrato.evaluation.cli", "measure how soon and how surely robots localize themselves"),
}
"""Module with the ``main`` of each subcommand, and what it does."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program that the first word names.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line without the program's name.

    Returns
    -------
    int
        Exit status of the program; 2 when the first word names none.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    first = words[0] if words else "--help"
    if first in ("-h", "--help"):
        print(usage())
        return 0
    if first == "--version":
        print(f"ciberrato {__version__}")
        return 0
    if first not in PROGRAMS:
        print(f"ciberrato: there is no command {first!r}; there are {', '.join(PROGRAMS)}", file=sys.stderr)
        return 2
    status: int = importlib.import_module(PROGRAMS[first][0]).main(words[1:])
    return status


def usage() -> str:
    """Return the help text."""
    width = max(map(len, PROGRAMS)) + 2
    lines = [f"  {name:<{width}}{purpose}" for name, (_, purpose) in PROGRAMS.items()]
    return "\n".join(
        [
            "usage: ciberrato COMMAND ...",
            "",
            "Tools for the CiberRato robot competition. Each command has its own --help;",
            "all but demo are also programs: ciberrato-simulator, ciberrato-agent, ...",
            "",
            *lines,
            "",
            "A first look: ciberrato demo",
        ]
    )
