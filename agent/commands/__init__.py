"""The subcommands, one file each: the table of them, and what follows from a command line.

A subcommand is a module here with ``make_parser()`` and ``run(options, interrupts)``, and a line in
`SUBCOMMANDS`. Only the module that a command line asks for is loaded.
"""

from __future__ import annotations

import importlib
import sys

from ciberrato.command_line import run_program
from ciberrato.errors import UsageError, did_you_mean

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence

    from agent.run.signals import Interrupts

__all__ = ["SUBCOMMANDS", "execute"]

SUBCOMMANDS = {
    "localize": ("RUN -m LAB", "the filter alone, from the log of a run"),
    "inspect": ("FILE", "look into a belief file"),
    "draw": ("WHAT -m LAB ...", "figures of the lab, its sensors, and a run"),
    "compare": ("FILE FILE", "how two belief files differ"),
    "animate": ("RUN -m LAB", "a run as a moving picture"),
    "watch": ("RUN -m LAB", "a run as it goes on, in the terminal"),
    "overlay": ("RUN -m LAB", "a run as it goes on, in a ciberrato-viewer"),
}
"""By name, which is the module's, too: what it is called with, and what it is for."""
_SHOWING = ("inspect", "compare")
"""Those that write no file: what they print is all their work."""
DRIVE = "drive"
"""The module that takes a command line without a subcommand."""


def execute(arguments: Sequence[str] | None, interrupts: Interrupts) -> int:
    """Execute a command line.

    Parameters
    ----------
    arguments : sequence of str or None
        Without the program's name; None = those of the process.
    interrupts : Interrupts
        Installed.

    Returns
    -------
    int
        Exit status, see `agent.cli.main`.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    name = words.pop(0) if words and words[0] in SUBCOMMANDS else DRIVE

    def body() -> int:
        if name == DRIVE and words and not words[0].startswith("-"):
            # No option, so a subcommand was meant; the drive takes nothing but options.
            listed = ", ".join(SUBCOMMANDS)
            meant = did_you_mean(words[0], SUBCOMMANDS)
            raise UsageError(f"unknown subcommand {words[0]!r}; choose one of {listed}{meant}")
        command = importlib.import_module(f"agent.commands.{name}")
        status: int = command.run(command.make_parser().parse_args(words), interrupts)
        return status

    return run_program("ciberrato-agent", body, shows=lambda: name in _SHOWING)
