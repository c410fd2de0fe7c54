"""The subcommand ``localize``: the filter alone, from the log of a run."""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

from agent.commands.files import check_output, read_lab_file
from agent.commands.parser import (
    PRESETS,
    OptionParser,
    add_output,
    add_precision,
    add_replay,
    add_salvage,
    add_strict,
)
from agent.run.reporter import PROGRAM, Reporter
from ciberrato.errors import UsageError
from ciberrato.plaintext import plain

if TYPE_CHECKING:
    from agent.run.signals import Interrupts
    from ciberrato.files.run_records import RecordedRun
    from ciberrato.world.lab import Lab


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Run the filter over a log, of the agent or of a simulator, and write the belief file.

    Parameters
    ----------
    options : argparse.Namespace
    interrupts : Interrupts
        Installed.

    Returns
    -------
    int
        Exit status: 0, or 3 if the readings do not fit the lab.

    Raises
    ------
    CiberratoError
        For what the user can put right.
    """
    check_output(options.output)
    if options.animate is not None:
        from agent.views.figures.animation import check_animation

        check_animation(options.animate)
    recorded, lab = _read(options)
    if not recorded.steps:
        raise UsageError(f"{options.run}: no step was recorded: the robot never stood looking to the right")
    from agent.offline.doubts import missing_in
    from agent.offline.exit_status import WRONG_MAP
    from agent.offline.localization import (
        expected_readings_of,
        fit_of,
        print_localization,
        write_localization,
    )
    from agent.offline.map_fit import wrong_map

    missing = missing_in(recorded)
    if missing is not None:
        Reporter().warn(f"{options.run}: {missing}")
    interrupts.arm()  # from here on a signal must not harm the file
    if not recorded.drives_right:
        return _filter_poses(options, recorded, lab)
    header = recorded.header
    tables = expected_readings_of(header, lab)
    preset = header.preset if options.preset is None else options.preset
    precision = header.precision if options.precision is None else options.precision
    localization = write_localization(
        recorded, tables, preset=preset, output=options.output, precision=precision
    )
    if not options.quiet:
        print_localization(localization, options.output)
    if options.animate is not None:
        from agent.views.figures.animation import animate_run

        frames = animate_run(recorded, localization.beliefs, lab, options.animate)
        Reporter(quiet=options.quiet).say(f"animation: {options.animate}, {frames} frames")
    if not fit_of(recorded, tables).is_doubtful:
        return 0
    from agent.offline.simulator_log import is_simulator_log

    if options.map is None and is_simulator_log(options.run):
        # The lab is that of the simulator's own log: the drive is not what the method is for.
        Reporter().warn(
            f"the readings do not fit a robot that drives to the right alone in "
            f"{plain(lab.name, 40)}: what is said of its cells is worth nothing where it drove otherwise, "
            "or others were in view"
        )
        return 0
    Reporter().warn(wrong_map(plain(lab.name, 40)))
    return WRONG_MAP


def _filter_poses(options: argparse.Namespace, recorded: RecordedRun, lab: Lab) -> int:
    """Run the pose filter over the log of a drive whose steps are no cells of one row."""
    from agent.offline.exit_status import WRONG_MAP
    from agent.offline.map_fit import wrong_map
    from agent.offline.pose_replay import replay_poses
    from agent.offline.summary import step_table
    from ciberrato.files.beliefs import read_beliefs, write_beliefs

    if options.preset is not None:
        raise UsageError(f"{options.run} was not driven to the right: --preset is for such runs")
    precision = recorded.header.precision if options.precision is None else options.precision
    replay = replay_poses(recorded, lab, lambda _, cycle: cycle.step is not None)
    write_beliefs(options.output, replay.beliefs, precision)
    if not options.quiet:
        print(step_table(read_beliefs(options.output)[-1].beliefs))
        print(f"written: {options.output} ({len(replay.beliefs)} blocks)")
    if options.animate is not None:
        from agent.views.figures.animation import animate_poses

        frames = animate_poses(recorded, lab, options.animate)
        Reporter(quiet=options.quiet).say(f"animation: {options.animate}, {frames} frames")
    if replay.doubtful_since is None:
        return 0
    Reporter().warn(f"since time {replay.doubtful_since} {wrong_map(lab.name)}")
    return WRONG_MAP


def _read(options: argparse.Namespace) -> tuple[RecordedRun, Lab]:
    """Read the log, of an agent or of a simulator, and the lab."""
    from agent.offline.simulator_log import is_simulator_log

    if is_simulator_log(options.run):
        from agent.offline.simulator_log import run_from_simulator_log

        run, lab = run_from_simulator_log(options.run, options.angles, robot=options.robot)
        return run, lab if options.map is None else read_lab_file(options.map, strict=options.strict)[0]
    from ciberrato.files.run_log import read_run

    run = read_run(options.run, salvage=Reporter().warn if options.salvage else None)
    wanted = options.map
    if wanted is None:
        from ciberrato.labs import lab_with_hash

        wanted = lab_with_hash(run.header.lab_sha256)
        if wanted is None:
            if not run.header.lab_name:
                raise UsageError(f"-m LAB is needed: {options.run} does not say in which lab it was recorded")
            raise UsageError(
                f"-m LAB is needed: {options.run} names its lab ({run.header.lab_name}) but does not hold "
                "it, and no lab that ships has its SHA-256"
            )
    lab, path, data = read_lab_file(wanted, strict=options.strict)
    # A client that did not know its lab names none: then there is nothing to compare with.
    if run.header.lab_name and hashlib.sha256(data).hexdigest() != run.header.lab_sha256:
        differs = (
            f"{options.run} was recorded with {run.header.lab_name}, whose contents differ from those of"
        )
        if not options.force:
            raise UsageError(f"{differs} {path} (SHA-256): give the lab of that run, or --force")
        Reporter().warn(f"{differs} {path}")
    return run, lab


def make_parser() -> OptionParser:
    """Return the parser of the subcommand."""
    parser = OptionParser(
        f"{PROGRAM} localize",
        "Run the filter over the log of a run and write the belief file. The log is the agent's (run.jsonl)\n"
        "or a simulator's (--log of ciberrato-simulator or of the real one), which also holds the lab.",
    )
    add = parser.add_argument
    add("run", type=Path, metavar="RUN", help="log of the run")
    add(
        "-m",
        "--map",
        metavar="LAB",
        help="lab file or name; default: the lab in a simulator's log, or a "
        "lab that ships with the SHA-256 of the run's lab",
    )
    add("--force", action="store_true", help="use LAB even if the run was recorded with another lab")
    add_strict(parser)
    add_output(parser)
    add("--preset", choices=PRESETS, help="preset of the filter; default: that of the run")
    add_precision(parser, default=None)
    add_replay(parser)
    add_salvage(parser)
    add("--animate", type=Path, metavar="FILE", help="draw the run as a moving picture: .gif, .html, .mp4")
    add("--quiet", action="store_true", help="print no table")
    return parser
