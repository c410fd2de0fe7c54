"""Views that run beside a run: started with it, and ended with it."""

from __future__ import annotations

import contextlib
import os
import select
import signal
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import FrameType


@contextlib.contextmanager
def beside(log: Path, *views: Sequence[str]) -> Iterator[None]:
    """Show a run by processes of their own as long as the block lasts.

    Parameters
    ----------
    log : Path
        Of the run; what an earlier run left there is removed, so that it is not shown.
    *views : sequence of str
        Command lines of subcommands that follow the log.
    """
    import subprocess

    from ciberrato.processes import module_command

    log.unlink(missing_ok=True)
    # A process group of their own: Ctrl-C is meant for the run. The end of the pipe ends them, when the log
    # is complete, or when this process is no more.
    processes = [
        subprocess.Popen(
            module_command("agent", *view, "--until-eof"), stdin=subprocess.PIPE, process_group=0
        )
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
        self._until_eof = until_eof
        self._told = False
        signal.signal(signal.SIGTERM, self._tell)
        signal.signal(signal.SIGINT, self._tell)

    def __call__(self) -> bool:
        """Return whether to end."""
        if self._until_eof and select.select([0], [], [], 0.0)[0]:
            self._told = self._told or not os.read(0, 1024)
        return self._told

    def _tell(self, number: int, frame: FrameType | None) -> None:
        self._told = True
