"""The command line of the simulator.

This module is imported before all others, and imports next to nothing itself: a Ctrl-C is to end the program
quietly from the first moment on.
"""

from __future__ import annotations

import os
import signal
import sys

from ciberrato.plaintext import plain
from ciberrato.system.signals import ENDING

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
        Exit status: 0, or 2 for what the user can put right, a disk that was full included.
    """
    former = _take_signals()
    try:
        return _run(arguments)
    finally:
        for number, handler in former.items():
            # As a program there is nothing left to do: a second signal must not disturb the going down.
            signal.signal(number, signal.SIG_IGN if arguments is None else handler)


def _run(arguments: Sequence[str] | None) -> int:
    from ciberrato.command_line import run_program
    from simulator_stub.options import PROGRAM, parse_arguments

    def body() -> int:
        options = parse_arguments(arguments)
        # Only now, as these take a tenth of a second to import.
        from ciberrato.system.process import ask_for_short_slices
        from simulator_stub.assembly import build_server

        if arguments is None and not options.lockstep:
            ask_for_short_slices()  # a cycle takes a fraction of a millisecond, and should not begin late

        notify, warn = _notifier(quiet=options.quiet), _notifier(quiet=False)
        server = build_server(options, print_line=_print_line, notify=notify, warn=warn)
        if options.view is None:
            return _serve(server, notify, warn)
        from simulator_stub.service.viewer_process import viewer_beside

        host = "127.0.0.1" if options.bind in (None, "0.0.0.0") else options.bind
        with viewer_beside(f"{host}:{server.port}", options.view, options.view_token):
            return _serve(server, notify, warn)

    return run_program(PROGRAM, body)


def _take_signals() -> dict[int, Callable[[int, FrameType | None], object] | int | None]:
    """Install the default action for both signals until the server has handlers of its own."""
    try:
        return {number: signal.signal(number, _leave) for number in ENDING}
    except ValueError:  # not in the main thread: the caller there stops us otherwise
        return {}


def _leave(number: int, frame: FrameType | None) -> NoReturn:
    # Nothing has happened that is worth writing down. An exception here could be lost, as it may be raised
    # anywhere in an import.
    os._exit(0)


def _serve(server: Server, notify: Callable[[str], None], warn: Callable[[str], None]) -> int:
    with server.stopping_on_signals():
        try:
            server.run()
            notify(f"ended at time {server.simulation.time}; {server.pace.delays()}")
        finally:
            server.close()
        dropped = server.session.dropped_in_all()
        if dropped:
            parts = (f"{name.replace('_', ' ')} {number}" for name, number in dropped.items())
            notify(f"dropped in all: {', '.join(parts)} (docs/simulator.md explains the names)")
    if server.records_are_whole():
        return 0
    warn("not all that was to be recorded could be: see above")
    return 2


def _print_line(line: str) -> None:
    print(plain(line), flush=True)


def _notifier(*, quiet: bool) -> Callable[[str], None]:
    from simulator_stub.options import PROGRAM

    def notify(line: str) -> None:
        if not quiet:
            print(f"{PROGRAM}: {plain(line)}", file=sys.stderr, flush=True)

    return notify
