"""Views that run beside a run: started with it, and ended with it."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator, Sequence
from pathlib import Path

from ciberrato.system.process import apart, when_input_ends
from ciberrato.system.signals import ENDING


@contextlib.contextmanager
def beside(log: Path, *views: Sequence[str]) -> Iterator[None]:
    """Show a run by processes of their own as long as the block lasts.

    Parameters
    ----------
    log : Path
        Log of the run; what an earlier run left there is removed, so that it is not shown.
    *views : sequence of str
        Command lines of subcommands that follow the log.
    """
    import subprocess

    from ciberrato.processes import module_command

    log.unlink(missing_ok=True)
    # Apart from us: Ctrl-C is meant for the run. The end of the pipe ends them, when the log is complete, or
    # when this process is no more.
    processes = [
        subprocess.Popen(module_command("agent", *view, "--until-eof"), stdin=subprocess.PIPE, **apart())
        for view in views
    ]
    try:
        yield
    finally:
        for process in processes:
            process.communicate()


class Ending:
    """Tells a view when to end: by a signal, or when standard input ends, too.

    Parameters
    ----------
    until_eof : bool
        Standard input is a pipe from the agent that started the view; it ends with the agent, however that
        ends.
    """

    def __init__(self, until_eof: bool) -> None:
        self._told = False
        for number in ENDING:
            signal.signal(number, self._tell)
        if until_eof:
            when_input_ends(self._tell)

    def __call__(self) -> bool:
        """Return whether to end."""
        return self._told

    def _tell(self, *_: object) -> None:
        self._told = True
