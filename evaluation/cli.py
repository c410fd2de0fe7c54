"""The command line of the evaluation."""

from __future__ import annotations

import argparse
import itertools
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

# Small products on several threads cost a hundred times what they save; before numpy is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from ciberrato.errors import CiberratoError, UsageError
from evaluation.task import DRIVES, STARTS, Task

PROGRAM = "ciberrato-evaluate"
_GROUPS = ("lab", "start", "parameters", "compass", "drive", "prior", "resolution")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run an evaluation, or sum up one that has been run.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line without the program's name.

    Returns
    -------
    int
        Exit status: 0, or 2 for what the user can put right; 130 if interrupted (what was run is kept).
    """
    try:
        return _run(_parser().parse_args(arguments))
    except KeyboardInterrupt:
        print(f"\n{PROGRAM}: interrupted; the same command goes on from here", file=sys.stderr)
        return 130
    except CiberratoError as error:
        print(f"{PROGRAM}: {error}", file=sys.stderr)
        return 2


def _run(options: argparse.Namespace) -> int:
    from evaluation.report import draw_figures, group_by, kidnapping_line, table
    from evaluation.runner import read_results, run_tasks

    if options.replay is not None:
        return _replay(options)
    if options.report:
        results = read_results(options.output)
        if not results:
            raise UsageError(f"{options.output}: no outcomes")
    else:
        tasks = _tasks(options)
        results = run_tasks(
            tasks,
            options.output,
            jobs=options.jobs,
            scheduler=options.scheduler,
            progress=None if options.quiet else sys.stderr,
        )
    groups = group_by(results, *options.by)
    print(table(groups))
    for key, group in groups.items():
        line = kidnapping_line(group)
        if line is not None:
            print(f"{' '.join(key)}: {line}")
    if options.figures is not None:
        for path in draw_figures(groups, options.figures):
            print(path)
    return 0


def _replay(options: argparse.Namespace) -> int:
    from ciberrato.labfile import read_lab
    from evaluation.replay import replay
    from maps import find_lab

    lab = read_lab(find_lab((options.lab or ["standard"])[0]))
    for folder in options.replay:
        for line in replay(folder, lab):
            print(line)
    return 0


def _tasks(options: argparse.Namespace) -> list[Task]:
    labs: list[tuple[str, str | None]] = []
    for name in options.lab or ["standard"]:
        labs.extend(_find_labs(name, options.labs))
    tasks = []
    for (lab, grid), start, parameters, compass, drive, seed in itertools.product(
        labs, options.start, options.parameters, options.compass, options.drive, range(options.seeds)
    ):
        tasks.append(
            Task(
                lab=lab,
                grid=grid if start == "grid" else None,
                start=start,
                prior="centres" if options.told and start == "centres" else "anywhere",
                parameters=parameters,
                compass=compass == "on",
                seed=options.first_seed + seed,
                drive=drive,
                cycles=options.cycles,
                resolution=_resolution(lab, options.resolution),
                kidnap=options.kidnap,
                settle=options.settle,
            )
        )
    return tasks


def _find_labs(name: str, folder: Path) -> list[tuple[str, str | None]]:
    from evaluation.labs import MAPS, judged_labs
    from maps import find_lab

    if name == "maps":
        return [(shipped, None) for shipped in MAPS]
    if name == "judged":
        if not folder.is_dir():
            raise UsageError(f"--labs {folder}: there is no such folder")
        return [(str(lab.path), None if lab.grid is None else str(lab.grid)) for lab in judged_labs(folder)]
    find_lab(name)  # complains if there is none
    return [(name, None)]


def _resolution(lab: str, wanted: float | None) -> float:
    from ciberrato.labfile import read_lab
    from maps import find_lab

    if wanted is not None:
        return wanted
    from agent.pose_filter.tables import fine_resolution

    return fine_resolution(read_lab(find_lab(lab)))


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message} (see --help)")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog=PROGRAM,
        description="Run the filter in many labs, from many starts, and say how soon and how surely it knows "
        "where it is. Runs are in lockstep, in this machine's processes or on a Dask cluster.",
        allow_abbrev=False,
    )
    add = parser.add_argument
    add(
        "--lab",
        action="append",
        metavar="LAB",
        help="name or file; `maps`: all that ship, `judged`: the public ones by the rule; may be given again",
    )
    add("--labs", type=Path, default=Path("../shared/labs"), metavar="DIR", help="folder of public labs")
    add("--start", nargs="+", choices=STARTS, default=["centres"])
    add("--told", action="store_true", help="tell the filter that it starts at a cell's centre")
    add("--parameters", nargs="+", default=["default"], metavar="FILE", help="names or files")
    add("--compass", nargs="+", choices=("on", "off"), default=["on"])
    add("--drive", nargs="+", choices=DRIVES, default=["explore"])
    add("--seeds", type=int, default=10, metavar="N", help="runs of each kind; default: 10")
    add("--first-seed", type=int, default=0, metavar="N")
    add("--cycles", type=int, default=800, metavar="N", help="default: 800")
    add("--settle", type=int, default=0, metavar="N", help="end a run N cycles after its first right claim")
    add("--resolution", type=float, metavar="UNITS", help="default: 0.1, coarser in large labs")
    add("--kidnap", type=int, default=0, metavar="CYCLE", help="put the robot elsewhere before that cycle")
    add("--output", type=Path, default=Path("evaluation.jsonl"), metavar="FILE", help="outcomes, added to")
    add("--report", action="store_true", help="run nothing, sum up what the output file holds")
    add("--replay", nargs="+", type=Path, metavar="DIR", help="run the filter over recorded sessions instead")
    add("--by", nargs="+", choices=_GROUPS, default=["start", "parameters", "compass", "drive"])
    add("--figures", type=Path, metavar="DIR", help="draw figures there")
    add("--jobs", type=int, default=0, metavar="N", help="processes; default: one a core")
    add("--scheduler", metavar="ADDRESS", help="of a Dask cluster that runs the tasks instead")
    add("--quiet", action="store_true", help="no progress bar")
    return parser
