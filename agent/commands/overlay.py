"""The subcommand ``overlay``: a run as it goes on, in a ciberrato-viewer."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from agent.commands.beside import Ending
from agent.commands.files import read_lab_file
from agent.commands.parser import OptionParser, add_salvage
from agent.run.reporter import PROGRAM, Reporter

if TYPE_CHECKING:
    from agent.run.signals import Interrupts


def make_parser() -> OptionParser:
    """Return the parser of the subcommand."""
    parser = OptionParser(
        f"{PROGRAM} overlay", "Send what a run's agent believes to a ciberrato-viewer. Ctrl-C ends it."
    )
    add = parser.add_argument
    add("run", type=Path, metavar="RUN", help="log of the run, run.jsonl; need not exist yet")
    add("-m", "--map", required=True, metavar="LAB", help="lab file or name")
    add("--viewer", default="", metavar="PORT", help="where the viewer takes overlays; default: 6001")
    add_salvage(parser)
    add("--until-eof", action="store_true", help="end when standard input ends, too")
    return parser


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Send overlays until the run or its reader ends; return the exit status."""
    from agent.views.logfollower import LogFollower
    from agent.views.overlaying import show_overlays
    from ciberrato.net.address import parse_address
    from ciberrato.net.overlay import OverlayClient
    from ciberrato.overlay import OVERLAY_PORT

    follower = LogFollower(options.run, salvage=Reporter().warn if options.salvage else None)
    ended = Ending(options.until_eof)
    lab, _, _ = read_lab_file(options.map)
    _, port = parse_address(f"127.0.0.1:{options.viewer or OVERLAY_PORT}")
    with OverlayClient(port=port) as client:
        show_overlays(follower, lab, client, ended=ended)
    return 0
