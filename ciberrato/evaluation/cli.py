"""The command line of the evaluation."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ciberrato.plaintext import plain

# Small products on several threads cost a hundred times what they save; before numpy is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from ciberrato.command_line import run_program
from ciberrato.errors import UsageError
from ciberrato.evaluation.options import PROGRAM, make_parser
from ciberrato.system.ending import word_and_status

if TYPE_CHECKING:
    from ciberrato.evaluation.attempt import Result

_BY_DEFAULT = ("start", "parameters", "compass", "drive")
_IF_SEVERAL = ("prior", "gps", "settings", "filter")
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
        Exit status: 0; 1 if runs failed; 2 for what the user can put right; 130 if interrupted, 143 if
        terminated (what was run is kept, and no process of ours is left).
    """

    def body() -> int:
        try:
            return _run(make_parser().parse_args(arguments))
        except KeyboardInterrupt as interrupt:
            word, status = word_and_status(interrupt)
            print(f"\n{PROGRAM}: {word}; the same command continues from here", file=sys.stderr)
            return status

    return run_program(PROGRAM, body)


def _run(options: argparse.Namespace) -> int:
    from ciberrato.evaluation.planning import tasks_of
    from ciberrato.evaluation.runner import read_evaluation, run_tasks

    if options.replay is not None:
        return _replay(options)
    if options.published:
        return _published(options)
    if options.table is not None:
        from ciberrato.evaluation.results import check_table

        check_table(options.table)
    if options.report:
        evaluation = read_evaluation(options.output)
        if not evaluation.results:
            raise UsageError(f"{options.output}: no outcomes")
    else:
        from ciberrato.localization.belief import compiled

        tasks = tasks_of(options)
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
    if options.table is not None:
        from ciberrato.evaluation.results import write_table

        write_table(options.table, [*evaluation.results, *evaluation.failures])
        print(options.table)
    if evaluation.failures:
        first = evaluation.failures[0]
        number = len(evaluation.failures)
        which = f"{first.task.lab}, {first.task.drive}, seed {first.task.seed}: {first.error}"
        print(
            f"{PROGRAM}: {number} of {number + len(evaluation.results)} runs failed; {plain(which)}",
            file=sys.stderr,
        )
        return 1
    return 0


def _show(options: argparse.Namespace, results: list[Result]) -> None:
    from ciberrato.evaluation.report import group_by, kidnapping_line, said_table, table

    fields = options.by or [
        *_BY_DEFAULT,
        *(field for field in _IF_SEVERAL if len({getattr(r.task, field) for r in results}) > 1),
    ]
    codes = {(result.task.filter, result.task.drive, result.task.code) for result in results}
    if not options.by and len(codes) > len({names[:2] for names in codes}):
        fields.append("code")  # a filter or a drive has been changed between runs
    groups = group_by(results, *fields)
    print(table(groups))
    for key, group in groups.items():
        line = kidnapping_line(group)
        if line is not None:
            print(f"{' '.join(key)}: {line}")
        if options.calibration:
            print(f"\n{' '.join(key)}\n{said_table(group)}")
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
    from ciberrato.evaluation.planning import find_labs, resolution_of
    from ciberrato.evaluation.published import LabTask, compare_with_published, published_table

    tasks = [
        LabTask(
            lab=lab,
            resolution=resolution_of(lab) if options.resolution is None else options.resolution,
            runs=options.seeds,
        )
        for name in options.lab or ["standard"]
        for lab, _ in find_labs(name, options.labs)
    ]
    _tell(options, [task.lab for task in tasks])
    compared = list(compare_with_published(tasks, jobs=options.jobs))
    print(published_table(compared))
    return 0


def _tell(
    options: argparse.Namespace,
    labs: Sequence[str],
    grids: Sequence[str] = (),
    parameters: Sequence[str] = (),
) -> None:
    """Report once the findings about the files that will be read."""
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
    tell(findings, lambda line: print(f"{PROGRAM}: {plain(line)}", file=sys.stderr), strict=options.strict)
