"""The command line of the evaluation."""

from __future__ import annotations

import argparse
import functools
import itertools
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

# Small products on several threads cost a hundred times what they save; before numpy is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from ciberrato.command_line import ProgramParser
from ciberrato.errors import CiberratoError, UsageError
from ciberrato.evaluation.task import DRIVES, GPS, PRIORS, STARTS, Task

if TYPE_CHECKING:
    from ciberrato.evaluation.attempt import Result

PROGRAM = "ciberrato-evaluate"
_GROUPS = ("lab", "start", "prior", "parameters", "compass", "gps", "drive", "resolution")
_BY_DEFAULT = ("start", "parameters", "compass", "drive")
_IF_SEVERAL = ("prior", "gps")
_COMPARED_BY_DEFAULT = ("lab", "parameters", "compass")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run an evaluation, or sum up one that has been run.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line without the program's name.

    Returns
    -------
    int
        Exit status: 0; 1 if runs failed; 2 for what the user can put right; 130 if interrupted (what was run
        is kept).
    """
    try:
        status = _run(_parser().parse_args(arguments))
        sys.stdout.flush()
        return status
    except BrokenPipeError:
        # The reader of our output has seen enough; what is still buffered must not fail at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except KeyboardInterrupt:
        print(f"\n{PROGRAM}: interrupted; the same command goes on from here", file=sys.stderr)
        return 130
    except CiberratoError as error:
        print(f"{PROGRAM}: {error}", file=sys.stderr)
        return 2


def _run(options: argparse.Namespace) -> int:
    from ciberrato.evaluation.runner import read_evaluation, run_tasks

    if options.replay is not None:
        return _replay(options)
    if options.published:
        return _published(options)
    if options.report:
        evaluation = read_evaluation(options.output)
        if not evaluation.results:
            raise UsageError(f"{options.output}: no outcomes")
    else:
        from ciberrato.localization.belief import compiled

        tasks = _tasks(options)
        _tell(
            options,
            labs=[task.lab for task in tasks],
            grids=[task.grid for task in tasks if task.grid is not None],
            parameters=[task.parameters for task in tasks],
        )
        loops = "numba" if compiled.choice() != "off" and compiled.available() else "numpy"
        if not options.quiet and options.scheduler is None:
            print(f"{PROGRAM}: the filter's loops are those of {loops}", file=sys.stderr)
        evaluation = run_tasks(
            tasks,
            options.output,
            jobs=options.jobs,
            scheduler=options.scheduler,
            progress=None if options.quiet else sys.stderr,
        )
    if evaluation.results:
        _show(options, evaluation.results)
    if evaluation.failures:
        first = evaluation.failures[0]
        number = len(evaluation.failures)
        print(
            f"{PROGRAM}: {number} of {number + len(evaluation.results)} runs failed; {first.task.lab}, "
            f"{first.task.drive}, seed {first.task.seed}: {first.error}",
            file=sys.stderr,
        )
        return 1
    return 0


def _show(options: argparse.Namespace, results: list[Result]) -> None:
    from ciberrato.evaluation.report import group_by, kidnapping_line, table

    fields = options.by or [
        *_BY_DEFAULT,
        *(field for field in _IF_SEVERAL if len({getattr(r.task, field) for r in results}) > 1),
    ]
    groups = group_by(results, *fields)
    print(table(groups))
    for key, group in groups.items():
        line = kidnapping_line(group)
        if line is not None:
            print(f"{' '.join(key)}: {line}")
    if options.compare is not None:
        from ciberrato.evaluation.comparison import compare

        one, other = options.compare
        compared = [field for field in options.by or _COMPARED_BY_DEFAULT if field != "drive"]
        print(f"\n{compare(results, one, other, compared)}")
    if options.figures is not None:
        from ciberrato.evaluation.figures import draw_figures

        for path in draw_figures(results, fields, options.figures):
            print(path)


def _replay(options: argparse.Namespace) -> int:
    from ciberrato.evaluation.replay import draw_replay, replay, replay_table
    from ciberrato.files.lab import read_lab
    from ciberrato.labs import find_lab

    name = (options.lab or ["standard"])[0]
    _tell(options, [name])
    lab = read_lab(find_lab(name))
    for number, folder in enumerate(options.replay):
        found = replay(folder, lab)
        print("\n" * (number > 0) + replay_table(found))
        if options.figures is not None:
            path = options.figures / f"{found.name}.png"
            draw_replay(found, lab, path)
            print(path)
    return 0


def _published(options: argparse.Namespace) -> int:
    from ciberrato.evaluation.published import LabTask, compare_with_published, published_table

    tasks = [
        LabTask(
            lab=lab,
            resolution=_resolution(lab) if options.resolution is None else options.resolution,
            runs=options.seeds,
        )
        for name in options.lab or ["standard"]
        for lab, _ in _find_labs(name, options.labs)
    ]
    _tell(options, [task.lab for task in tasks])
    compared = list(compare_with_published(tasks, jobs=options.jobs))
    print(published_table(compared))
    return 0


def _tasks(options: argparse.Namespace) -> list[Task]:
    labs: list[tuple[str, str | None]] = []
    for name in options.lab or ["standard"]:
        labs.extend(_find_labs(name, options.labs))
    tasks = []
    for (lab, grid), start, prior, parameters, compass, gps, drive, seed in itertools.product(
        labs,
        options.start,
        options.prior or (["told"] if options.told else ["anywhere"]),
        options.parameters,
        options.compass,
        options.gps,
        options.drive,
        range(options.seeds),
    ):
        tasks.append(
            Task(
                lab=lab,
                grid=grid if start == "grid" else None,
                start=start,
                prior="centres" if prior == "told" and start == "centres" else "anywhere",
                parameters=parameters,
                compass=compass == "on",
                gps=gps,
                seed=options.first_seed + seed,
                drive=drive,
                cycles=options.cycles,
                resolution=_resolution(lab) if options.resolution is None else options.resolution,
                kidnap=options.kidnap,
                settle=options.settle,
            )
        )
    return tasks


def _tell(
    options: argparse.Namespace,
    labs: Sequence[str],
    grids: Sequence[str] = (),
    parameters: Sequence[str] = (),
) -> None:
    """Say once what is odd in the files that are to be read."""
    from ciberrato.checks.telling import tell
    from ciberrato.checks.things import thing_findings
    from ciberrato.files.lab import parse_lab_file
    from ciberrato.files.parameters import parse_parameter_file
    from ciberrato.files.start_grid import parse_grid_file
    from ciberrato.files.xml import read_file
    from ciberrato.labs import find_grid, find_lab, find_parameters

    findings = []
    for lab in dict.fromkeys(str(find_lab(name)) for name in labs):
        file = parse_lab_file(read_file(lab), lab)
        findings += [*file.findings, *thing_findings(file)]
    for grid in dict.fromkeys(str(find_grid(name)) for name in grids):
        findings += parse_grid_file(read_file(grid), grid).findings
    for path in dict.fromkeys(str(find_parameters(name)) for name in parameters):
        findings += parse_parameter_file(read_file(path), path).findings
    tell(findings, lambda line: print(f"{PROGRAM}: {line}", file=sys.stderr), strict=options.strict)


def _find_labs(name: str, folder: Path | None) -> list[tuple[str, str | None]]:
    from ciberrato.evaluation.labs import MAPS, judged_labs
    from ciberrato.labs import find_lab

    if name == "maps":
        return [(shipped, None) for shipped in MAPS]
    if name == "judged":
        if folder is None:
            named = os.environ.get("CIBERRATO_LABS")
            if not named:
                raise UsageError("--lab judged: name the folder of public labs by --labs or CIBERRATO_LABS")
            folder = Path(named)
        if not folder.is_dir():
            raise UsageError(f"--labs {folder}: there is no such folder")
        found = [(str(lab.path), None if lab.grid is None else str(lab.grid)) for lab in judged_labs(folder)]
        if not found:
            raise UsageError(f"--labs {folder}: there are no public labs in it")
        return found
    find_lab(name)  # complains if there is none
    return [(name, None)]


@functools.cache
def _resolution(lab: str) -> float:
    from ciberrato.files.lab import read_lab
    from ciberrato.labs import find_lab
    from ciberrato.localization.tables.pose_tables import fine_resolution

    return fine_resolution(read_lab(find_lab(lab)))


def _parser() -> argparse.ArgumentParser:
    parser = ProgramParser(
        PROGRAM,
        description="Run the filter in many labs, from many starts, and say how soon and how surely it knows "
        "where it is. Runs are in lockstep, in this machine's processes or on a Dask cluster.",
    )
    add = parser.add_argument
    add(
        "--lab",
        action="extend",
        nargs="+",
        metavar="LAB",
        help="name or file; `maps`: all that ship, `judged`: the public ones by the rule; may be given again",
    )
    add("--labs", type=Path, metavar="DIR", help="folder of public labs; default: $CIBERRATO_LABS")
    add(
        "--start",
        nargs="+",
        choices=STARTS,
        default=["centres"],
        help="where robots start: in the lab's start grid, in centres of cells, anywhere; default: centres",
    )
    add(
        "--prior",
        nargs="+",
        choices=PRIORS,
        help="told: the filter is told that it starts in a cell's centre, where it does; default: anywhere",
    )
    add("--told", action="store_true", help="the same as --prior told")
    add("--parameters", nargs="+", default=["default"], metavar="FILE", help="names or files")
    add(
        "--compass", nargs="+", choices=("on", "off"), default=["on"], help="with one or without; default: on"
    )
    add("--gps", nargs="+", choices=GPS, default=["announced"], help="announced: as the parameters say")
    add("--drive", nargs="+", choices=DRIVES, default=["explore"], help="default: explore")
    add("--seeds", type=int, default=10, metavar="N", help="runs of each kind; default: 10")
    add("--first-seed", type=int, default=0, metavar="N", help="seeds are counted up from it; default: 0")
    add("--cycles", type=int, default=800, metavar="N", help="of a run; default: 800")
    add("--settle", type=int, default=0, metavar="N", help="end a run N cycles after its first right claim")
    add("--resolution", type=float, metavar="UNITS", help="default: 0.1, coarser in large labs")
    add("--kidnap", type=int, default=0, metavar="CYCLE", help="put the robot elsewhere before that cycle")
    add(
        "--output",
        type=Path,
        default=Path("evaluation.jsonl"),
        metavar="FILE",
        help="outcomes, added to",
    )
    add("--report", action="store_true", help="run nothing, sum up what the output file holds")
    add("--replay", nargs="+", type=Path, metavar="DIR", help="run the filter over recorded sessions instead")
    add(
        "--published",
        action="store_true",
        help="hold the filter against the published method instead, from --seeds cells, without motor noise",
    )
    add("--by", nargs="+", choices=_GROUPS, metavar="AXIS", help=f"groups of the table: {', '.join(_GROUPS)}")
    add(
        "--compare",
        nargs=2,
        choices=DRIVES,
        metavar="DRIVE",
        help="compare two drives by group, where the first is slow above all",
    )
    add("--figures", type=Path, metavar="DIR", help="draw figures there")
    add("--jobs", type=int, default=0, metavar="N", help="processes; default: one a core")
    add("--scheduler", metavar="ADDRESS", help="of a Dask cluster that runs the tasks instead")
    add("--strict", action="store_true", help="refuse labs, grids and parameters with warnings")
    add("--quiet", action="store_true", help="no progress bar")
    return parser
