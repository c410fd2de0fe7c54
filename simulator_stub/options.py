"""The command line's options."""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Sequence
from pathlib import Path

from ciberrato.command_line import ProgramParser
from ciberrato.errors import UsageError, did_you_mean

PROGRAM = "ciberrato-simulator"
DEFAULT_ANSWER_LIMIT = 1.0
SCORING_MODES = {
    0: "competitive",
    1: "control",
    2: "mapping",
    3: "planning",
    4: "line-control",
    5: "line-mapping",
    6: "line-planning",
    7: "line-control-45",
}
"""Names of the scoring modes; the modes themselves are not imported here."""


def parse_arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Parse a command line.

    Parameters
    ----------
    arguments : sequence of str or None
        Without the program's name; None = that of the process.

    Raises
    ------
    UsageError
        If it cannot be understood.
    """
    options = _parser().parse_args(arguments)
    if options.reproducible and options.seed is None:
        raise UsageError("--reproducible needs --seed N: without it every run is another")
    return options


def _parser() -> argparse.ArgumentParser:
    from ciberrato.net.address import DEFAULT_PORT, TOKEN_VARIABLE  # brings in the whole codec

    parser = ProgramParser(
        PROGRAM,
        description="A CiberRato simulator without a window: the wire protocol of the real one, and a seed.",
    )
    world = parser.add_argument_group("the world (each a file, or the name of one that ships)")
    world.add_argument("--lab", metavar="FILE", help="lab file; default: the real simulator's built-in lab")
    world.add_argument(
        "--grid",
        metavar="FILE",
        help="start grid file, or poses X,Y,DIR[;X,Y,DIR...] in units and degrees; default: 9,3,0",
    )
    world.add_argument("--param", metavar="FILE", help="parameter file; default: the real simulator's values")
    modes = ", ".join(f"{number} {name}" for number, name in SCORING_MODES.items())
    world.add_argument(
        "--scoring",
        type=_scoring,
        default=0,
        metavar="MODE",
        help=f"scoring mode, by number or name: {modes}; or a plugin: the name of an entry point in "
        "ciberrato.scoring, or module:Class; default: 0",
    )
    world.add_argument(
        "--sensor",
        action="append",
        default=[],
        metavar="NAME",
        help="add a sensor plugin to the robots: the name of an entry point in ciberrato.sensors, or "
        "module:Class; may be repeated",
    )
    for name, what in (("gps", "a GPS"), ("beacon", "beacon sensors"), ("compass", "a compass")):
        world.add_argument(
            f"--{name}",
            action="store_true",
            help=f"add {what} to the robots, also where the parameters have none",
        )
    world.add_argument(
        "--showactions", action="store_true", help="no effect; accepted as by the real simulator"
    )
    world.add_argument(
        "--strict",
        action="store_true",
        help="refuse files that have warnings; default: report the warnings and go on",
    )
    world.add_argument("--seed", type=_seed, metavar="N", help="seed of all random numbers; default: random")
    world.add_argument(
        "--reproducible",
        action="store_true",
        help="with --seed: make all output depend on the seed only; the log's date is SOURCE_DATE_EPOCH, or "
        "follows from the seed",
    )
    world.add_argument(
        "--kidnap",
        action="append",
        metavar="CYCLE:X,Y,DIR",
        help="move the first robot to that pose (units, degrees) before that cycle; may be repeated",
    )
    network = parser.add_argument_group("the network")
    network.add_argument(
        "--port",
        type=_port,
        default=DEFAULT_PORT,
        metavar="N",
        help="port for UDP and TCP; 0: any free port; default: 6000",
    )
    network.add_argument(
        "--bind",
        metavar="ADDRESS",
        help="address to listen on; 0.0.0.0: the network, too; default: 127.0.0.1, this machine only",
    )
    network.add_argument(
        "--views",
        type=_views,
        default="all",
        metavar="all|local|N",
        help="limit the viewers, which may also start, stop, reset and remove: all (256 at a time), local "
        "(programs on this machine only), or N at a time; default: all",
    )
    network.add_argument(
        "--view-token",
        type=_token,
        default=os.environ.get(TOKEN_VARIABLE) or None,
        metavar="TEXT",
        help=f"token required of viewers (their --view-token); default: ${TOKEN_VARIABLE}, or none",
    )
    network.add_argument(
        "--tcp",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="listen on TCP as well as UDP; default: --tcp",
    )
    network.add_argument(
        "--no-restart",
        action="store_true",
        help='ignore a robot\'s Reset="On", which restarts the run by default',
    )
    pace = parser.add_argument_group("the pace")
    pace.add_argument(
        "--speed", type=_speed, default=1.0, metavar="X", help="speed as a multiple of real time; default: 1"
    )
    pace.add_argument(
        "--lockstep",
        action="store_true",
        help="run the next cycle as soon as every robot has answered; default: real time",
    )
    pace.add_argument(
        "--answer-limit",
        type=_seconds,
        metavar="SECONDS",
        help="time that --lockstep waits for an answer, inf: without limit; default: a few times the robot's "
        "usual answer time, up to 1 while it computes",
    )
    pace.add_argument(
        "--compiled",
        action="store_true",
        help="compute cycles in machine code, with the same results; needs the extra fast "
        "(pip install 'ciberrato[fast]')",
    )
    pace.add_argument(
        "--autostart",
        type=_count,
        default=0,
        metavar="N",
        help="start as soon as N robots have registered; default: wait for a viewer's Start",
    )
    pace.add_argument(
        "--runs",
        type=_runs,
        metavar="N",
        help="exit after N runs, each with the next seed; robots register again in each; default: no limit",
    )
    pace.add_argument(
        "--exit-at-end", action="store_true", help="exit when the run is over; default: exit on a signal only"
    )
    pace.add_argument(
        "--exit-when-silent",
        type=_seconds,
        metavar="SECONDS",
        help="exit when the run is over, or when no robot has sent anything for this simulated time",
    )
    output = parser.add_argument_group("output")
    output.add_argument(
        "--ready-file",
        type=Path,
        metavar="FILE",
        help="write the port to a file as soon as clients can register",
    )
    output.add_argument(
        "--ready-fd",
        type=_descriptor,
        metavar="N",
        help="write the port to an open file descriptor, and close it, as soon as clients can register",
    )
    output.add_argument(
        "--log", type=Path, metavar="FILE", help="write a log in the real simulator's XML format"
    )
    output.add_argument("--truth", type=Path, metavar="FILE", help="write the true poses as CSV")
    output.add_argument("--result", type=Path, metavar="FILE", help="write scores and final states as JSON")
    output.add_argument(
        "--scoring-files",
        type=Path,
        default=Path(),
        metavar="DIR",
        help="folder for mapping.out and planning.out of scoring modes 2, 3, 5 and 6; default: this folder",
    )
    output.add_argument(
        "--view",
        nargs="?",
        const="6080",
        metavar="[HOST:]PORT",
        help="start a viewer, too; address of its page; 0: any free port; default: 127.0.0.1:6080",
    )
    output.add_argument("--quiet", action="store_true", help="print errors, seed and ports only")
    return parser


def _number(text: str, what: str, *, least: float, most: float) -> int:
    try:
        value = int(text)
    except ValueError:
        value = -1
    if not least <= value <= most:
        raise argparse.ArgumentTypeError(f"{text!r} is not {what}")
    return value


def _token(text: str) -> str:
    if not (text.isascii() and text.isprintable() and 0 < len(text) <= 200):
        raise argparse.ArgumentTypeError("the token must be 1 to 200 printable ASCII characters")
    return text


def _scoring(text: str) -> int | str:
    """Read a scoring mode, by number or by name; one that others wrote by its own name or place."""
    numbers = {name: number for number, name in SCORING_MODES.items()}
    numbers |= {str(number): number for number in SCORING_MODES}
    from ciberrato.plugins import REFERENCE, installed, refuse_taken

    refuse_taken("ciberrato.scoring", numbers)
    name = text.lower().replace("_", "-")
    if name not in numbers:
        if text in installed("ciberrato.scoring") or REFERENCE.fullmatch(text):
            return text
        listed = ", ".join(f"{number} {name}" for number, name in SCORING_MODES.items())
        meant = did_you_mean(name, SCORING_MODES.values())
        raise argparse.ArgumentTypeError(f"{text!r} is not a scoring mode; choose one of {listed}{meant}")
    return numbers[name]


def _port(text: str) -> int:
    return _number(text, "a port number from 0 to 65535", least=0, most=65535)


def _count(text: str) -> int:
    return _number(text, "a number of robots, 0 or more", least=0, most=math.inf)


def _views(text: str) -> int | str:
    if text in ("all", "local"):
        return text
    return _number(text, "all, local, or a number of views, 0 or more", least=0, most=math.inf)


def _runs(text: str) -> int:
    return _number(text, "a number of runs, 1 or more", least=1, most=math.inf)


def _descriptor(text: str) -> int:
    what = "an open file descriptor, 1 or more"
    number = _number(text, what, least=1, most=2**31 - 1)
    try:
        os.fstat(number)
    except OSError:
        raise argparse.ArgumentTypeError(f"{text!r} is not {what}") from None
    return number


def _seed(text: str) -> int:
    return _number(text, "a whole number, 0 or more", least=0, most=math.inf)


def _real(text: str, what: str, *, allow_infinite: bool) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not value > 0.0 or (math.isinf(value) and not allow_infinite):
        raise argparse.ArgumentTypeError(f"{text!r} is not {what}")
    return value


def _speed(text: str) -> float:
    return _real(text, "a speed greater than 0", allow_infinite=False)


def _seconds(text: str) -> float:
    return _real(text, "a number of seconds greater than 0", allow_infinite=True)
