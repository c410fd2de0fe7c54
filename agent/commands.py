"""What the agent's command line can say, and what follows from it."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from agent import optiontypes
from agent.optionparser import (
    DISTANCES,
    PRESETS,
    OptionParser,
    add_output,
    add_precision,
    add_strict,
    check_output,
    read_lab_file,
)
from agent.run.reporter import PROGRAM, Reporter
from ciberrato.errors import CiberratoError, UsageError

if TYPE_CHECKING:
    from agent.run.session import Settings
    from agent.run.signals import Interrupts

SHOW_COMMANDS = ("draw", "compare", "animate", "watch", "overlay")
DEFAULT_MAP = "standard"
DEFAULT_LOG = Path("run.jsonl")


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
            from agent.localizecommand import localize

            status = localize(words[1:], interrupts)
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
    interrupts.arm()
    views = []
    if options.viewer is not None:
        views.append(["overlay", str(settings.log), "-m", options.map, "--viewer", options.viewer])
    if options.watch:
        views.append(["watch", str(settings.log), "-m", options.map])
    if not views:
        return _drive(options, settings, interrupts)
    import dataclasses

    from agent.showing import beside

    # The screen is the watch's until the end: what is to be said is said then.
    quiet = settings.quiet or options.watch
    with beside(settings.log, *views):
        status = _drive(options, dataclasses.replace(settings, quiet=quiet), interrupts)
    if status == 0 and options.watch and not options.quiet:
        from agent.views.inspection import inspect

        inspect(settings.output)
    return status


def _drive(options: argparse.Namespace, settings: Settings, interrupts: Interrupts) -> int:
    reporter = Reporter(quiet=settings.quiet)
    if not options.online and options.drive == ("right", None) and not options.smooth:
        from agent.run.session import Session

        return Session(settings, interrupts, reporter).run()
    from agent.run.live_session import LiveSession, LiveSettings
    from ciberrato.localization.evidence.start_prior import check_start, parse_start

    check_start(parse_start(options.start), settings.lab)
    drive, goal = options.drive
    live = LiveSettings(
        drive=drive,
        goal=goal,
        start=options.start,
        smooth=options.smooth,
        exit_when_finished=options.exit_when_finished,
        show=not settings.quiet,
        lockstep=options.lockstep,
    )
    return LiveSession(settings, live, interrupts, reporter).run()


def _inspect(options: argparse.Namespace) -> int:
    import shutil

    from agent.views.inspection import inspect

    lab = None if options.map is None else read_lab_file(options.map)[0]
    width = shutil.get_terminal_size().columns
    inspect(options.file, png=options.png, lab=lab, width=width, colour=sys.stdout.isatty())
    return 0


def _settings(options: argparse.Namespace) -> Settings:
    from agent.run.session import Settings
    from ciberrato.net.address import parse_address

    host, port = parse_address(options.host)
    lab, path, data = read_lab_file(options.map, strict=options.strict)
    check_output(options.output)
    check_output(options.log)
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
        "  ciberrato-agent watch RUN -m LAB         a run as it goes on, in the terminal\n"
        "  ciberrato-agent overlay RUN -m LAB       a run as it goes on, in a ciberrato-viewer",
    )
    add = parser.add_argument
    add("-h", "--host", default="127.0.0.1", metavar="HOST[:PORT]", help="default: this machine, port 6000")
    add(
        "-p",
        "--pos",
        type=optiontypes.count,
        default=1,
        metavar="N",
        help="start position, 0 = any free; default: 1",
    )
    add(
        "-r", "--robname", type=optiontypes.name, default="ciberrato", metavar="NAME", help="the robot's name"
    )
    add("-m", "--map", default=DEFAULT_MAP, metavar="LAB", help=f"lab file or name; default: {DEFAULT_MAP}")
    add_strict(parser)
    add("--transport", choices=("udp", "tcp"), default="udp", help="default: udp")
    add("--log", type=Path, default=DEFAULT_LOG, metavar="FILE", help=f"default: {DEFAULT_LOG}")
    add_output(parser)
    add("--preset", choices=PRESETS, default="calibrated", help="default: calibrated")
    add_precision(parser, default=3)
    add("--distance", choices=DISTANCES, default="sensor", help="default: sensor")
    add(
        "--angles",
        type=optiontypes.angles,
        default=(0.0, 90.0, -90.0, 180.0),
        metavar="A,B,C,D",
        help="of the IR sensors, degrees; default: 0,90,-90,180 (--angles=-90,... if the first is negative)",
    )
    add(
        "--cruise",
        type=optiontypes.cruise,
        default=0.1,
        metavar="POWER",
        help="motor command to 0.15; default: 0.1",
    )
    add("--online", action="store_true", help="know the pose while driving: print and log it every cycle")
    add(
        "--drive",
        type=optiontypes.drive,
        default=("right", None),
        metavar="POLICY",
        help="right (default), explore, active (to where the pose shows, then stop), goto:X,Y; all but the "
        "first work from an unknown pose and imply --online",
    )
    add(
        "--start",
        type=optiontypes.start,
        default="anywhere",
        metavar="WHERE",
        help="what --online takes for possible: anywhere (any free pose, default), centres (of cells, four "
        "headings), centres:DEGREES, X,Y or X,Y,DEGREES",
    )
    add("--smooth", action="store_true", help="belief file of the whole run's knowledge, for every cell")
    add("--exit-when-finished", action="store_true", help="end the run when active or goto are done")
    add(
        "--lockstep",
        action="store_true",
        help="with a simulator in lockstep: register when the tables are there, so that a seed gives one run",
    )
    add("--exit-at-wall", action="store_true", help="end the run when a wall is ahead")
    add(
        "--silence",
        type=optiontypes.seconds,
        default=2.0,
        metavar="SECONDS",
        help="that end the run; default: 2",
    )
    add(
        "--give-up-after",
        type=optiontypes.seconds,
        metavar="SECONDS",
        help="without a simulator; default: never",
    )
    add(
        "--seed",
        type=optiontypes.count,
        metavar="N",
        help="of the simulation, for the log (the agent has none)",
    )
    add("--quiet", action="store_true", help="print nothing but errors")
    add("--watch", action="store_true", help="show the run on one screen while it goes on")
    add(
        "--viewer",
        nargs="?",
        const="",
        metavar="PORT",
        help="show the belief in a ciberrato-viewer on this machine; default port: 6001",
    )
    return parser


def _inspect_parser() -> argparse.ArgumentParser:
    parser = OptionParser(f"{PROGRAM} inspect", "Validate a belief file and show what it says.")
    parser.add_argument("file", type=Path, metavar="FILE", help="the belief file, localization.out")
    parser.add_argument("--png", type=Path, metavar="FILE", help="draw all steps there")
    parser.add_argument("-m", "--map", metavar="LAB", help="draw the walls of this lab over them")
    return parser
