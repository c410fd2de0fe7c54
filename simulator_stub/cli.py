"""The command line of the simulator.

This module is imported before all others, and imports next to nothing itself: a Ctrl-C is to end the program
quietly from the first moment on.
"""

from __future__ import annotations

import os
import signal
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from types import FrameType
    from typing import NoReturn

    from simulator_stub.service.server import Server


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the simulator until a signal ends it, or its last run is over.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line without the program's name; by default that of the process.

    Returns
    -------
    int
        Exit status: 0, or 2 for what the user can put right.
    """
    former = _take_signals()
    try:
        return _run(arguments)
    finally:
        for number, handler in former.items():
            # As a program there is nothing left to do: a second signal must not disturb the going down.
            signal.signal(number, signal.SIG_IGN if arguments is None else handler)


def _run(arguments: Sequence[str] | None) -> int:
    from ciberrato.errors import CiberratoError
    from simulator_stub.options import PROGRAM, parse_arguments

    try:
        options = parse_arguments(arguments)
        # Only now, as these take a tenth of a second to import.
        from simulator_stub.assembly import build_server

        notify = _notifier(quiet=options.quiet)
        server = build_server(options, print_line=_print_line, notify=notify)
        if options.view is None:
            return _serve(server, notify)
        from simulator_stub.service.viewer_process import viewer_beside

        host = "127.0.0.1" if options.bind == "0.0.0.0" else options.bind
        with viewer_beside(f"{host}:{server.port}", options.view):
            return _serve(server, notify)
    except CiberratoError as error:
        print(f"{PROGRAM}: {error}", file=sys.stderr)
        return 2


def _take_signals() -> dict[int, Callable[[int, FrameType | None], object] | int | None]:
    """Let both signals end the process at once, until the server has handlers of its own."""
    try:
        return {number: signal.signal(number, _leave) for number in (signal.SIGINT, signal.SIGTERM)}
    except ValueError:  # not in the main thread: the caller there stops us otherwise
        return {}


def _leave(number: int, frame: FrameType | None) -> NoReturn:
    # Nothing has happened that is worth writing down. An exception here could be lost, as it may be raised
    # anywhere in an import.
    os._exit(0)


def _serve(server: Server, notify: Callable[[str], None]) -> int:
    with server.stopping_on_signals():
        try:
            server.run()
            notify(f"ended at time {server.simulation.time}; {server.pace.delays()}")
        finally:
            server.close()
    return 0


def _print_line(line: str) -> None:
    print(line, flush=True)


def _notifier(*, quiet: bool) -> Callable[[str], None]:
    from simulator_stub.options import PROGRAM

    def notify(line: str) -> None:
        if not quiet:
            try:
                print(f"{PROGRAM}: {line}", file=sys.stderr, flush=True)
            except OSError:  # the reader of our messages may be gone
                return

    return notify
