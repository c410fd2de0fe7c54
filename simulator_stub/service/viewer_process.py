"""A viewer beside the simulator: a process of its own that ends with the simulator, however that one ends."""

from __future__ import annotations

import contextlib
import subprocess
from collections.abc import Iterator

from ciberrato.processes import module_command

_SECONDS = 5.0
"""How long the viewer may take to close its browsers' connections."""


@contextlib.contextmanager
def viewer_beside(address: str, http: str) -> Iterator[None]:
    """Let a viewer run while the block does.

    What the viewer prints (where the page is) goes to our standard output. If it cannot start, it says so
    itself, and the simulator goes on without it.

    Parameters
    ----------
    address : str
        HOST:PORT of the simulator.
    http : str
        [HOST:]PORT of the page, as the viewer's option ``--http`` takes it.
    """
    options = ("--simulator", address, "--http", http, "--until-eof")
    # It ends when this pipe does: the system closes it even if we are killed.
    viewer = subprocess.Popen(module_command("ciberrato.viewer", *options), stdin=subprocess.PIPE)
    try:
        yield
    finally:
        assert viewer.stdin is not None
        viewer.stdin.close()
        try:
            viewer.wait(_SECONDS)
        except subprocess.TimeoutExpired:
            viewer.kill()
            viewer.wait()
