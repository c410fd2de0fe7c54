"""Parts that all programs share: a parser whose errors are one line, and a program's begin and end.

Options are never abbreviated. `run_program` sees to it that an output that is gone (closed, full, a pipe that
ends) does not disturb the work, and that memory or file descriptors that are used up are told in one line.
"""

from __future__ import annotations

import argparse
import contextlib
import errno
import math
import os
import sys
from collections.abc import Callable
from typing import IO, Any, NoReturn

from ciberrato.errors import CiberratoError, UsageError
from ciberrato.plaintext import plain
from ciberrato.system.ending import raised_for_signals, word_and_status
from ciberrato.system.limits import allow_descriptors, allowed_memory
from ciberrato.system.process import reader_has_gone, take_any_character
from ciberrato.version import __version__

LEAST_MEMORY = 256
"""MB of address space: with less, numpy's BLAS may end the process when it is loaded, or loop without end."""
LEAST_DESCRIPTORS = 16
"""Files that a process has open: streams, sockets, a log, what an import opens, pipes to other processes."""
_USED_UP = {errno.EMFILE: "file descriptors", errno.ENFILE: "file descriptors", errno.ENOMEM: "memory"}
_HELP = {
    "memory": "allow it more (ulimit -v, ulimit -m, the container's limit)",
    "file descriptors": f"allow it {LEAST_DESCRIPTORS} at least (ulimit -n)",
    "threads": "allow it more processes (ulimit -u) or memory (ulimit -v)",
}


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
        kind = options.pop("formatter_class", argparse.HelpFormatter)
        width = _columns() - 2
        super().__init__(
            prog=program,
            description=description,
            allow_abbrev=False,
            formatter_class=lambda prog: kind(prog, width=width),
            **options,
        )
        version = f"ciberrato {__version__}"
        self.add_argument("--version", action="version", version=version, help="show the version and end")

    def parse_known_args(self, *arguments: Any, **options: Any) -> Any:
        """Parse arguments; from then on any character can be printed."""
        take_any_character(sys.stdout)
        return super().parse_known_args(*arguments, **options)

    def error(self, message: str) -> NoReturn:
        """Raise what is wrong with the command line."""
        raise UsageError(f"{message} (see {self.prog} --help)")


def _columns() -> int:
    """Return the terminal's width, as argparse finds it out itself, but once and without `shutil`.

    argparse asks for it at every option that is added, and loading `shutil` takes as long as adding them all.
    """
    columns = os.environ.get("COLUMNS", "")
    if columns.isascii() and columns.isdigit() and int(columns) > 0:
        return int(columns)
    try:
        assert sys.__stdout__ is not None
        return os.get_terminal_size(sys.__stdout__.fileno()).columns or 80
    except (AssertionError, ValueError, OSError):
        return 80


class Output:
    """A text stream that drops what can no longer be written, and remembers why.

    Parameters
    ----------
    stream : file or None
        None: the process was started without it.
    """

    def __init__(self, stream: IO[str] | None) -> None:
        self._stream = stream
        self.fault: OSError | None = None
        """Error that made it drop output: the disk is full, the reader of the pipe has gone."""

    def write(self, text: str) -> int:
        """Write the text, or drop it."""
        if self._stream is not None and self.fault is None:
            try:
                self._stream.write(text)
            except OSError as error:
                self._give_up(error)
        return len(text)

    def flush(self) -> None:
        """Flush the buffer, or drop it."""
        if self._stream is not None and self.fault is None:
            try:
                self._stream.flush()
            except OSError as error:
                self._give_up(error)

    def isatty(self) -> bool:
        """Return whether it is a terminal."""
        return self._stream is not None and self._stream.isatty()

    def __getattr__(self, name: str) -> Any:
        stream = self.__dict__.get("_stream")
        if stream is None:  # a stream like any other, to nowhere
            stream = self.__dict__["_stream"] = open(os.devnull, "w", encoding="utf-8", newline="\n")  # noqa: SIM115
        return getattr(stream, name)

    def _give_up(self, error: OSError) -> None:
        self.fault = error
        # What is still buffered must not complain when the interpreter ends.
        with contextlib.suppress(OSError, ValueError, AttributeError):
            assert self._stream is not None
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())


def run_program(program: str, body: Callable[[], int], *, shows: Callable[[], bool] = lambda: False) -> int:
    """Run a program from its first line to its exit status.

    Parameters
    ----------
    program : str
        Its name.
    body : callable
        Does the work and returns the exit status. Its `CiberratoError` become lines on standard error and
        status 2; so do memory, file descriptors and threads that are used up.
    shows : callable
        Whether what the program prints is all its work: then it has failed if there is no room for that.

    Returns
    -------
    int
        Exit status.
    """
    _open_streams()
    former = sys.stdout, sys.stderr
    output, errors = Output(sys.stdout), Output(sys.stderr)
    sys.stdout, sys.stderr = output, errors
    try:
        return _status(program, body, output, shows)
    finally:
        output.flush()
        errors.flush()
        # A process goes down with what drops the rest; in a test the streams are given back.
        if output.fault is None and None not in former:
            sys.stdout, sys.stderr = former


def _status(program: str, body: Callable[[], int], output: Output, shows: Callable[[], bool]) -> int:
    try:
        with raised_for_signals():
            _check_limits()
            status = body()
            output.flush()
        fault = output.fault
        if fault is not None and not reader_has_gone(fault):  # a reader that has seen enough is no fault
            print(f"{program}: the output is cut short: {fault.strerror}", file=sys.stderr)
            status = status or 2 * shows()
    except CiberratoError as error:
        _tell(program, str(error))
    except KeyboardInterrupt as interrupt:
        word, status = word_and_status(interrupt)
        _tell(program, word)
        return status
    except Exception as error:
        what = used_up(error)
        if what is None:
            raise
        _tell(program, f"there is not enough of {what} for this: {_HELP[what]}")
    else:
        return status
    return 2


def used_up(error: BaseException) -> str | None:
    """Return what the system has no more of, if an error says so: memory, file descriptors or threads.

    Parameters
    ----------
    error : BaseException
        The error; its causes count, too: numpy's ImportError does not say it itself.
    """
    seen: BaseException | None = error
    while seen is not None:
        if isinstance(seen, MemoryError) or "failed to map segment" in str(seen):
            return "memory"
        if isinstance(seen, OSError) and seen.errno in _USED_UP:
            return _USED_UP[seen.errno]
        if isinstance(seen, RuntimeError) and "can't start new thread" in str(seen):
            return "threads"
        if isinstance(seen, ImportError) and ("cannot allocate memory" in str(seen).lower()):
            return "memory"
        seen = seen.__cause__ or seen.__context__
    return None


def _tell(program: str, message: str) -> None:
    for line in message.split("\n"):
        print(f"{program}: {plain(line)}", file=sys.stderr)


def _open_streams() -> None:
    """Open the null device for closed standard streams: the next file opened would take their numbers."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDONLY if descriptor == 0 else os.O_WRONLY)
            os.set_inheritable(descriptor, True)


def _check_limits() -> None:
    """Refuse too few descriptors and too little memory; use few threads where memory is limited."""
    enough = allow_descriptors(LEAST_DESCRIPTORS)
    if enough < LEAST_DESCRIPTORS:
        raise UsageError(f"only {enough} file descriptors are allowed: {_HELP['file descriptors']}")
    memory = allowed_memory()
    if memory < LEAST_MEMORY:
        least = f"allow it {LEAST_MEMORY} MB at least (ulimit -v)"
        raise UsageError(f"only {memory:.0f} MB of memory are allowed: {least}")
    if memory < math.inf:
        # Its threads each ask for memory when numpy is loaded, and end the process where there is none.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
