"""A viewer beside the simulator: a process of its own that ends with the simulator, however that one ends."""

from __future__ import annotations

import contextlib
import os
import subprocess
from collections.abc import Iterator

from ciberrato.net.address import TOKEN_VARIABLE
from ciberrato.processes import module_command

_SECONDS = 5.0
"""Time for the viewer to close its browsers' connections."""


@contextlib.contextmanager
def viewer_beside(address: str, http: str, token: str | None = None) -> Iterator[None]:
    """Run a viewer while the block runs.

    The viewer's output (the address of the page) goes to our standard output. If it cannot start, it says so
    itself, and the simulator goes on without it.

    Parameters
    ----------
    address : str
        HOST:PORT of the simulator.
    http : str
        [HOST:]PORT of the page, as the viewer's option ``--http`` takes it.
    token : str or None
        Token that the simulator requires of views; passed in the environment, where others cannot read it.
    """
    options = ("--simulator", address, "--http", http, "--until-eof")
    # It ends when this pipe does: the system closes it even if we are killed.
    environment = os.environ | ({} if token is None else {TOKEN_VARIABLE: token})
    command = module_command("ciberrato.viewer", *options)
    viewer = subprocess.Popen(command, stdin=subprocess.PIPE, env=environment)
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
