"""Tell other programs that clients can register."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from ciberrato.errors import UsageError
from ciberrato.files.atomic import replace_file


def tell_ready(port: int, file: Path | None, descriptor: int | None) -> None:
    """Write the port, a line, where another program waits for it.

    Parameters
    ----------
    port : int
    file : Path or None
        Is there whole or not at all.
    descriptor : int or None
        An open one, as of a pipe; closed afterwards, so that a reader comes to the end. A reader that has
        gone is no fault.

    Raises
    ------
    UsageError
        If the file or descriptor cannot be written to.
    """
    line = f"{port}\n".encode()
    if file is not None:
        replace_file(file, line)
    if descriptor is None:
        return
    try:
        with contextlib.suppress(BrokenPipeError):
            os.write(descriptor, line)
        if descriptor > 2:  # standard output and error are still needed
            os.close(descriptor)
    except OSError as error:
        raise UsageError(f"--ready-fd {descriptor}: cannot be written to: {error.strerror}") from None
