"""Without a subcommand: drive a robot through a known lab."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from agent.commands import SUBCOMMANDS, option_types
from agent.commands.files import check_output, read_lab_file
from agent.commands.parser import DISTANCES, PRESETS, OptionParser, add_output, add_precision, add_strict
from agent.drives.registry import DRIVES, RIGHT, drive_kind, forms
from agent.run.reporter import PROGRAM, Reporter
from ciberrato.errors import UsageError

if TYPE_CHECKING:
    from agent.run.session import Session
    from agent.run.settings import Settings
    from agent.run.signals import Interrupts

_SIGNALLED = 128
DEFAULT_MAP = "standard"
DEFAULT_LOG = Path("run.jsonl")


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Drive, and return the exit status."""
    settings = settings_of(options)
    interrupts.arm()
    views = []
    if options.viewer is not None:
        views.append(["overlay", str(settings.log), "-m", options.map, "--viewer", options.viewer])
    if options.watch:
        views.append(["watch", str(settings.log), "-m", options.map])
    if not views:
        return _drive(options, settings, interrupts)
    import dataclasses

    from agent.commands.beside import beside

    # The screen is the watch's until the end: what is to be said is said then.
    quiet = settings.quiet or options.watch
    with beside(settings.log, *views):
        status = _drive(options, dataclasses.replace(settings, quiet=quiet), interrupts)
    if status == 0 and options.watch and not options.quiet:
        from agent.views.inspection import inspect

        inspect(settings.output)
    return status


def _drive(options: argparse.Namespace, settings: Settings, interrupts: Interrupts) -> int:
    """Drive, and with ``--reconnect`` again whenever the simulator goes away; return the exit status."""
    import dataclasses
    from itertools import count

    reporter = Reporter(quiet=settings.quiet)
    status: int | None = None
    for number in count(2):
        session = _session(options, settings, interrupts, reporter)
        try:
            last = session.run()
        except UsageError as error:
            if not (settings.reconnect and session.lost_contact):
                raise
            reporter.warn(str(error))
        else:
            # A signal that comes before anything was recorded again takes nothing back.
            status = last if status is None or last < _SIGNALLED else status
        if interrupts.received or not (settings.reconnect and session.lost_contact):
            break
        settings = dataclasses.replace(
            settings, log=_numbered(options.log, number), output=_numbered(options.output, number)
        )
        reporter.warn(f"registering again; this run's files are {settings.log} and {settings.output}")
    return interrupts.status if status is None else status


def _numbered(path: Path, number: int) -> Path:
    """Return the name of a file of another run: run.jsonl, run.2.jsonl, run.3.jsonl."""
    return path.with_name(f"{path.stem}.{number}{path.suffix}")


def _session(
    options: argparse.Namespace, settings: Settings, interrupts: Interrupts, reporter: Reporter
) -> Session:
    from agent.run.session import Session

    drive, argument = options.drive
    if options.exit_at_wall and drive != RIGHT:
        raise UsageError(f"--exit-at-wall is for --drive {RIGHT} only: {drive} drives round walls")
    if options.exit_when_finished and drive == RIGHT:
        raise UsageError("--exit-when-finished is for --drive active and goto: right has nothing to finish")
    if not options.online and options.drive == (RIGHT, None) and not options.smooth:
        from agent.run.published_method import PublishedMethod

        published = PublishedMethod(settings, interrupts, reporter)
        return Session(settings, interrupts, reporter, published)
    from agent.run.live_method import LiveMethod, LiveSettings
    from ciberrato.localization.evidence.start_prior import check_start, parse_start

    check_start(parse_start(options.start), settings.lab)
    check = drive_kind(drive).check
    if check is not None:
        check(argument, settings.lab)
    live = LiveSettings(
        drive=drive,
        goal=argument,
        start=options.start,
        smooth=options.smooth,
        exit_when_finished=options.exit_when_finished,
        show=not settings.quiet,
        lockstep=options.lockstep,
    )
    return Session(settings, interrupts, reporter, LiveMethod(settings, live, interrupts, reporter))


def settings_of(options: argparse.Namespace) -> Settings:
    """Return what the command line says of the run; complain of what cannot be."""
    from agent.run.settings import Settings
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
        reconnect=options.reconnect,
        lockstep=options.lockstep,
    )


def make_parser() -> OptionParser:
    """Return the parser of the subcommand."""
    parser = OptionParser(
        PROGRAM,
        "Drive a robot to the right through a known lab and work out in which cell it began.\n\n"
        f"{_line('[options]', 'drive; Ctrl-C ends the run and writes the belief file')}"
        + "".join(_line(f"{name} {words}", what) for name, (words, what) in SUBCOMMANDS.items()),
    )
    add = parser.add_argument
    add(
        "-h",
        "--host",
        default="127.0.0.1",
        metavar="[HOST][:PORT]",
        help="simulator; default: 127.0.0.1:6000",
    )
    add(
        "-p",
        "--pos",
        type=option_types.count,
        default=1,
        metavar="N",
        help="start position, 0: any free one; default: 1",
    )
    add(
        "-r",
        "--robname",
        type=option_types.name,
        default="ciberrato",
        metavar="NAME",
        help="the robot's name",
    )
    add("-m", "--map", default=DEFAULT_MAP, metavar="LAB", help=f"lab file or name; default: {DEFAULT_MAP}")
    add_strict(parser)
    add("--transport", choices=("udp", "tcp"), default="udp", help="transport; default: udp")
    add(
        "--log",
        type=Path,
        default=DEFAULT_LOG,
        metavar="FILE",
        help=f"log of the run; default: {DEFAULT_LOG}",
    )
    add_output(parser)
    add("--preset", choices=PRESETS, default="calibrated", help="preset of the filter; default: calibrated")
    add_precision(parser, default=3)
    add(
        "--distance",
        choices=DISTANCES,
        default="sensor",
        help="distance model of the sensors; default: sensor",
    )
    add(
        "--angles",
        type=option_types.angles,
        default=(0.0, 90.0, -90.0, 180.0),
        metavar="A,B,C,D",
        help="angles of the IR sensors, degrees; default: 0,90,-90,180 (--angles=-90,... if the first is "
        "negative)",
    )
    add(
        "--cruise",
        type=option_types.cruise,
        default=0.1,
        metavar="POWER",
        help="motor command on straight legs, up to 0.15; default: 0.1",
    )
    add("--online", action="store_true", help="estimate the pose while driving: print and log it every cycle")
    add(
        "--drive",
        type=option_types.drive,
        default=(RIGHT, None),
        metavar="POLICY",
        help=f"drive: {_drives()}; all but the first work from an unknown pose and imply --online",
    )
    add(
        "--start",
        type=option_types.start,
        default=option_types.ANYWHERE,
        metavar="WHERE",
        help="prior of --online: anywhere (any free pose, default), centres (of cells, four headings), "
        "centres:DEGREES, X,Y or X,Y,DEGREES",
    )
    add(
        "--smooth",
        action="store_true",
        help="write smoothed beliefs: every cell, given all readings of the run",
    )
    add(
        "--exit-when-finished",
        action="store_true",
        help="end the run when the drive active or goto has finished",
    )
    add(
        "--lockstep",
        action="store_true",
        help="with a simulator in lockstep: register when the tables are there and ask no clock, so that a "
        "seed gives one run",
    )
    add("--exit-at-wall", action="store_true", help="with --drive right: end the run when a wall is ahead")
    add(
        "--silence",
        type=option_types.seconds,
        default=2.0,
        metavar="SECONDS",
        help="end the run after this time without Measures; default: 2",
    )
    add(
        "--give-up-after",
        type=option_types.seconds,
        metavar="SECONDS",
        help="end if no simulator answers in this time; default: never",
    )
    add(
        "--reconnect",
        action="store_true",
        help="register and localize again when the simulator has gone: run.2.jsonl, localization.2.out",
    )
    add(
        "--seed",
        type=option_types.count,
        metavar="N",
        help="seed of the simulation, for the log only (the agent needs none)",
    )
    add("--quiet", action="store_true", help="print errors only")
    add("--watch", action="store_true", help="show the run on one screen, live")
    add(
        "--viewer",
        nargs="?",
        const="",
        metavar="PORT",
        help="show the belief in a ciberrato-viewer on this machine; default of PORT: 6001",
    )
    return parser


def _line(words: str, what: str) -> str:
    return f"  {f'{PROGRAM} {words}':<40} {what}\n"


def _drives() -> str:
    kinds = zip(forms(), DRIVES.values(), strict=True)
    there = ", ".join(form + f" ({kind.summary})" * bool(kind.summary) for form, kind in kinds)
    return f"{there}; or that of an entry point in ciberrato.drives, or module:object, with :TEXT"
