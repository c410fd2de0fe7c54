"""What the agent's command line can say, and what follows from it."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from agent.optionparser import OptionParser, read_lab_file
from agent.reporter import PROGRAM, Reporter
from ciberrato.errors import CiberratoError, UsageError

if TYPE_CHECKING:
    from agent.session import Settings
    from agent.signals import Interrupts

# As in agent.runlog, which is not imported yet: its records take time that the registration should not wait
# for.
PRESETS = ("calibrated", "seed")
DISTANCES = ("sensor", "cone")
SHOW_COMMANDS = ("draw", "compare", "animate", "watch")
DEFAULT_MAP = "standard"
DEFAULT_LOG = Path("run.jsonl")
DEFAULT_OUTPUT = Path("localization.out")
_LONGEST_NAME = 200  # the real simulator dies of names much longer


def execute(arguments: Sequence[str] | None, interrupts: Interrupts) -> int:
    """Do what a command line says.

    Parameters
    ----------
    arguments : sequence of str or None
        Without the program's name; None = those of the process.
    interrupts : Interrupts
        Installed.

    Returns
    -------
    int
        Exit status, see `agent.cli.main`.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if words[:1] == ["localize"]:
            status = _localize(_localize_parser().parse_args(words[1:]), interrupts)
        elif words[:1] == ["inspect"]:
            status = _inspect(_inspect_parser().parse_args(words[1:]))
        elif words and words[0] in SHOW_COMMANDS:
            from agent.showing import show

            status = show(words[0], words[1:])
        else:
            status = _run(_run_parser().parse_args(words), interrupts)
        sys.stdout.flush()
    except CiberratoError as error:
        Reporter().warn(str(error))
        return 2
    except BrokenPipeError:
        # Whoever read our output has seen enough; what is still buffered must not complain at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    return status


def _run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    settings = _settings(options)
    from agent.session import Session

    interrupts.arm()
    return Session(settings, interrupts, Reporter(quiet=options.quiet)).run()


def _localize(options: argparse.Namespace, interrupts: Interrupts) -> int:
    import hashlib

    from agent.runlog import read_run

    run = read_run(options.run)
    lab, path, data = read_lab_file(options.map)
    _check_output(options.output)
    if hashlib.sha256(data).hexdigest() != run.header.lab_sha256:
        Reporter().warn(
            f"{options.run} was recorded in {run.header.lab_name}, whose contents differ from those of {path}"
        )
    if not run.steps:
        raise UsageError(f"{options.run}: no step was recorded; there is nothing to localize from")
    from agent.ground_truth import compute_ground_truth
    from agent.localization import print_localization, write_localization

    interrupts.arm()  # from here on a signal must not harm the file
    header = run.header
    tables = compute_ground_truth(lab, header.sensor_angles, header.parameters, model=header.distance_model)
    preset = header.preset if options.preset is None else options.preset
    precision = header.precision if options.precision is None else options.precision
    localization = write_localization(run, tables, preset=preset, output=options.output, precision=precision)
    if not options.quiet:
        print_localization(localization, options.output)
    return 0


def _inspect(options: argparse.Namespace) -> int:
    import shutil

    from agent.inspection import inspect

    lab = None if options.map is None else read_lab_file(options.map)[0]
    width = shutil.get_terminal_size().columns
    inspect(options.file, png=options.png, lab=lab, width=width, colour=sys.stdout.isatty())
    return 0


def _settings(options: argparse.Namespace) -> Settings:
    from agent.session import Settings
    from ciberrato.net.address import parse_address

    host, port = parse_address(options.host)
    lab, path, data = read_lab_file(options.map)
    _check_output(options.output)
    _check_output(options.log)
    if options.log.resolve() == options.output.resolve():
        raise UsageError(f"--log and --output both name {options.log}")
    return Settings(
        host=host,
        port=port,
        transport=options.transport,
        position=options.pos,
        name=options.robname,
        lab=lab,
        lab_file=path,
        lab_data=data,
        angles=options.angles,
        cruise=options.cruise,
        exit_at_wall=options.exit_at_wall,
        preset=options.preset,
        distance_model=options.distance,
        precision=options.precision,
        seed=options.seed,
        log=options.log,
        output=options.output,
        silence=options.silence,
        give_up_after=options.give_up_after,
        quiet=options.quiet,
    )


def _check_output(path: Path) -> None:
    """Refuse a file that cannot be written, before the run and not after it."""
    folder = path.parent
    if path.is_dir():
        raise UsageError(f"{path}: is a directory; give a file")
    if not folder.is_dir():
        raise UsageError(f"{path}: there is no directory {folder}")
    if not os.access(folder, os.W_OK | os.X_OK) or (path.exists() and not os.access(path, os.W_OK)):
        raise UsageError(f"{path}: cannot be written: permission denied")


def _run_parser() -> argparse.ArgumentParser:
    parser = OptionParser(
        PROGRAM,
        "Drive a robot to the right through a known lab and work out in which cell it began.\n\n"
        "  ciberrato-agent [options]                drive; Ctrl-C ends the run and writes the belief file\n"
        "  ciberrato-agent localize RUN -m LAB      the filter alone, from the log of a run\n"
        "  ciberrato-agent inspect FILE             look into a belief file\n"
        "  ciberrato-agent draw WHAT -m LAB ...     figures of the lab, its sensors, and a run\n"
        "  ciberrato-agent compare FILE FILE        how two belief files differ\n"
        "  ciberrato-agent animate RUN -m LAB       a run as a moving picture\n"
        "  ciberrato-agent watch RUN -m LAB         a run as it goes on, in the terminal",
    )
    add = parser.add_argument
    add("-h", "--host", default="127.0.0.1", metavar="HOST[:PORT]", help="default: this machine, port 6000")
    add("-p", "--pos", type=_count, default=1, metavar="N", help="start position, 0 = any free; default: 1")
    add("-r", "--robname", type=_name, default="ciberrato", metavar="NAME", help="the robot's name")
    add("-m", "--map", default=DEFAULT_MAP, metavar="LAB", help=f"lab file or name; default: {DEFAULT_MAP}")
    add("--transport", choices=("udp", "tcp"), default="udp", help="default: udp")
    add("--log", type=Path, default=DEFAULT_LOG, metavar="FILE", help=f"default: {DEFAULT_LOG}")
    _add_output(parser)
    add("--preset", choices=PRESETS, default="calibrated", help="default: calibrated")
    _add_precision(parser, default=3)
    add("--distance", choices=DISTANCES, default="sensor", help="default: sensor")
    add(
        "--angles",
        type=_angles,
        default=(0.0, 90.0, -90.0, 180.0),
        metavar="A,B,C,D",
        help="of the IR sensors, degrees; default: 0,90,-90,180 (--angles=-90,... if the first is negative)",
    )
    add("--cruise", type=_cruise, default=0.1, metavar="POWER", help="motor command to 0.15; default: 0.1")
    add("--exit-at-wall", action="store_true", help="end the run when a wall is ahead")
    add("--silence", type=_seconds, default=2.0, metavar="SECONDS", help="that end the run; default: 2")
    add("--give-up-after", type=_seconds, metavar="SECONDS", help="without a simulator; default: never")
    add("--seed", type=_count, metavar="N", help="of the simulation, for the log (the agent has none)")
    add("--quiet", action="store_true", help="print nothing but errors")
    return parser


def _localize_parser() -> argparse.ArgumentParser:
    parser = OptionParser(f"{PROGRAM} localize", "Run the filter over a run's log and write the belief file.")
    add = parser.add_argument
    add("run", type=Path, metavar="RUN", help="the log, run.jsonl")
    add("-m", "--map", required=True, metavar="LAB", help="lab file or name")
    _add_output(parser)
    add("--preset", choices=PRESETS, help="of the filter; default: that of the run")
    _add_precision(parser, default=None)
    add("--quiet", action="store_true", help="no table")
    return parser


def _inspect_parser() -> argparse.ArgumentParser:
    parser = OptionParser(f"{PROGRAM} inspect", "Validate a belief file and show what it says.")
    parser.add_argument("file", type=Path, metavar="FILE", help="the belief file, localization.out")
    parser.add_argument("--png", type=Path, metavar="FILE", help="draw all steps there")
    parser.add_argument("-m", "--map", metavar="LAB", help="draw the walls of this lab over them")
    return parser


def _add_output(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=DEFAULT_OUTPUT,
        metavar="FILE",
        help=f"belief file; default: {DEFAULT_OUTPUT}",
    )


def _add_precision(parser: argparse.ArgumentParser, default: int | None) -> None:
    shown = "that of the run" if default is None else default
    text = f"decimals, 2 to 17; default: {shown}"
    parser.add_argument("--precision", type=_precision, default=default, metavar="N", help=text)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _count(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 19):
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number, 0 or more")
    return int(text)


def _precision(text: str) -> int:
    if not (text.isascii() and text.isdigit() and 2 <= int(text) <= 17):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of decimals from 2 to 17")
    return int(text)


def _cruise(text: str) -> float:
    value = _number(text)
    if not 0.0 < value <= 0.15:
        raise argparse.ArgumentTypeError(f"{text!r} is not a motor command greater than 0, up to 0.15")
    return value


def _seconds(text: str) -> float:
    value = _number(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds greater than 0")
    return value


def _angles(text: str) -> tuple[float, float, float, float]:
    values = [_number(part) for part in text.split(",")]
    if len(values) != 4 or not all(math.isfinite(value) for value in values):
        raise argparse.ArgumentTypeError(f"{text!r} is not four angles in degrees, like 0,90,-90,180")
    return values[0], values[1], values[2], values[3]


def _name(text: str) -> str:
    if len(text.encode(errors="replace")) > _LONGEST_NAME or not text.isprintable():
        raise argparse.ArgumentTypeError(f"a name has at most {_LONGEST_NAME} printable characters")
    return text
