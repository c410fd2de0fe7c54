"""The command line of the agent."""

from __future__ import annotations

from agent.run.signals import Interrupts

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the agent, or one of its subcommands.

    Parameters
    ----------
    arguments : sequence of str or None
        Command line without the program's name; None = that of the process.

    Returns
    -------
    int
        Exit status: 0; 2 for what the user or the simulator can put right; 128 + number of a signal that
        came before anything was recorded.
    """
    interrupts = Interrupts()
    interrupts.install()  # before anything that takes time, imports included
    try:
        from agent.commands import execute

        return execute(arguments, interrupts)
    finally:
        if arguments is None:
            interrupts.ignore()
        else:
            interrupts.close()
