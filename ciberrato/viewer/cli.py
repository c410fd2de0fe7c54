"""The command line of the viewer."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ciberrato.command_line import ProgramParser, run_program
from ciberrato.errors import UsageError
from ciberrato.plaintext import plain
from ciberrato.system.loops import run_with_sockets

if TYPE_CHECKING:
    from ciberrato.viewer.server import Server
    from ciberrato.viewer.session import Session

PROGRAM = "ciberrato-viewer"
DEFAULT_HTTP_PORT = 6080


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the viewer until a signal ends it.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line without the program's name; by default that of the process.

    Returns
    -------
    int
        Exit status: 0, or 2 for what the user can put right.
    """

    def body() -> int:
        try:
            options = _parser().parse_args(arguments)
            return run_with_sockets(_serve(options))
        except KeyboardInterrupt:
            return 0

    return run_program(PROGRAM, body)


async def _serve(options: argparse.Namespace) -> int:
    server = _build(options)

    def started() -> None:
        _print(f"page: {server.url}")
        if server.overlay_port is not None:
            _print(f"overlay: 127.0.0.1:{server.overlay_port}/udp")
        if options.open:
            import webbrowser

            webbrowser.open(server.url)

    await server.run(until_eof=options.until_eof, started=started)
    return 0


def _build(options: argparse.Namespace) -> Server:
    """Open everything; what is open already is closed where something else cannot be."""
    from ciberrato.net import TcpLink, UdpLink, parse_address
    from ciberrato.viewer.server import Server
    from ciberrato.viewer.session import Session

    notify = _notifier(quiet=options.quiet)
    with contextlib.ExitStack() as opened:
        link: UdpLink | TcpLink | None = None
        if options.run is not None:
            session = _recorded(options, notify)
        else:
            host, port = parse_address(options.simulator)
            link = TcpLink(host, port) if options.transport == "tcp" else UdpLink(host, port)
            opened.callback(link.close)
            session = Session(
                f"{host}:{port}", control=options.control, notify=notify, view_token=options.view_token
            )
        page_host, page_port = options.http
        server = Server(
            session,
            link,
            host=page_host,
            port=page_port,
            token=options.token,
            blocking_registration=options.transport == "tcp",
        )
        opened.callback(server.close)
        if options.overlays and options.run is None:
            _open_overlay(server, options.overlay_port, notify)
        opened.pop_all()
    return server


def _recorded(options: argparse.Namespace, notify: Callable[[str], None]) -> Session:
    """Open a log, of an agent or of a simulator."""
    from ciberrato.files.log_kind import is_simulator_log

    if not is_simulator_log(options.run):
        from ciberrato.viewer.recording import load_recording

        if options.angles is not None:
            raise UsageError("--angles: an agent's log tells how the sensors are mounted; leave it out")
        return load_recording(
            options.run,
            options.map,
            options.start_cell,
            options.beliefs,
            salvage=notify if options.salvage else None,
        )
    from ciberrato.viewer.simulator_log import load_simulator_log

    for name, value in (
        ("-m", options.map),
        ("--start-cell", options.start_cell),
        ("--beliefs", options.beliefs),
    ):
        if value is not None:
            raise UsageError(
                f"{name}: a simulator's log holds the lab and the true poses; leave this option out"
            )
    return load_simulator_log(options.run, options.angles, notify)


def _open_overlay(server: Server, port: int | None, notify: Callable[[str], None]) -> None:
    from ciberrato.overlay import OVERLAY_PORT

    try:
        server.open_overlay(OVERLAY_PORT if port is None else port)
    except UsageError as error:
        # A second viewer does without overlays, unless they were asked for.
        if port is not None:
            raise
        notify(f"{error}; going on without overlays")


def _print(line: str) -> None:
    with contextlib.suppress(OSError):
        print(plain(line), flush=True)


def _notifier(*, quiet: bool) -> Callable[[str], None]:
    def notify(line: str) -> None:
        if not quiet:
            with contextlib.suppress(OSError):  # the reader of our messages may be gone
                print(f"{PROGRAM}: {plain(line)}", file=sys.stderr, flush=True)

    return notify


def _parser() -> argparse.ArgumentParser:
    from ciberrato.net.address import TOKEN_VARIABLE

    parser = ProgramParser(
        PROGRAM,
        description="Watch a CiberRato simulator, real or stub, in the browser.",
    )
    world = parser.add_argument_group("what to show")
    world.add_argument(
        "--simulator",
        default="127.0.0.1:6000",
        metavar="HOST[:PORT]",
        help="address of the simulator; default: 127.0.0.1:6000",
    )
    world.add_argument(
        "--transport",
        choices=("udp", "tcp"),
        default="udp",
        help="transport to the simulator; the real one has udp only; default: udp",
    )
    world.add_argument(
        "--view-token",
        default=os.environ.get(TOKEN_VARIABLE) or None,
        metavar="TEXT",
        help=f"token that the simulator requires of viewers; default: ${TOKEN_VARIABLE}, or none",
    )
    world.add_argument(
        "--run",
        type=Path,
        metavar="FILE",
        help="show a log instead of a simulator: an agent's (run.jsonl), or a simulator's (--log of the real "
        "one or of ciberrato-simulator), plain or gzip",
    )
    world.add_argument(
        "-m", "--map", metavar="LAB", help="with --run: lab file or name; default: the lab that the log names"
    )
    world.add_argument(
        "--start-cell",
        type=_cell,
        metavar="COLUMN,ROW",
        help="with --run: start cell, counted from 0,0 at the lower left; default: the most likely one",
    )
    world.add_argument(
        "--beliefs",
        type=Path,
        metavar="FILE",
        help="with --run: belief file of the agent, localization.out; default: a filter run by the viewer",
    )
    world.add_argument(
        "--salvage",
        action="store_true",
        help="with --run: leave out lines of the log that cannot be read, with a warning each",
    )
    world.add_argument(
        "--angles",
        type=_angles,
        metavar="A,B,C,D",
        help="with --run and a simulator's log: angles of the IR sensors, degrees; default: 0,60,-60,180",
    )
    page = parser.add_argument_group("the page")
    page.add_argument(
        "--http",
        type=_http,
        default=("127.0.0.1", DEFAULT_HTTP_PORT),
        metavar="[HOST:]PORT",
        help="address of the page; port 0: any free port; default: 127.0.0.1:6080. On an address that other "
        "machines can reach, browsers need a token",
    )
    page.add_argument(
        "--token",
        metavar="TEXT",
        help="token required of browsers; default: none on this machine, else random",
    )
    page.add_argument("--open", action="store_true", help="open the page in a browser")
    page.add_argument(
        "--no-control",
        dest="control",
        action="store_false",
        help="do not allow browsers to start, stop, reset or remove; default: allow",
    )
    overlay = parser.add_argument_group("overlays of agents")
    overlay.add_argument(
        "--overlay",
        dest="overlay_port",
        type=_port,
        metavar="PORT",
        help="UDP port on 127.0.0.1; 0: any free port; default: 6001",
    )
    overlay.add_argument(
        "--no-overlay", dest="overlays", action="store_false", help="do not receive overlays"
    )
    parser.add_argument("--until-eof", action="store_true", help="end also when standard input ends")
    parser.add_argument("--quiet", action="store_true", help="print errors and addresses only")
    return parser


def _port(text: str) -> int:
    number = int(text) if text.isascii() and text.isdigit() and len(text) <= 5 else -1
    if not 0 <= number <= 65535:
        raise argparse.ArgumentTypeError(f"{text!r} is not a port number from 0 to 65535")
    return number


def _http(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    return host.strip("[]") or "127.0.0.1", _port(port)


def _angles(text: str) -> tuple[float, float, float, float]:
    import math

    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != 4 or not all(map(math.isfinite, numbers)):
        raise argparse.ArgumentTypeError(f"{text!r} is not four angles in degrees, such as 0,60,-60,180")
    return numbers


def _cell(text: str) -> tuple[int, int]:
    column, comma, row = text.partition(",")
    if not (comma and column.isascii() and column.isdigit() and row.isascii() and row.isdigit()):
        raise argparse.ArgumentTypeError(f"{text!r} is not COLUMN,ROW")
    return int(column), int(row)
