"""From the options of the command line to the tasks that they ask for."""

from __future__ import annotations

import argparse
import functools
import itertools
import os
from pathlib import Path

from ciberrato.errors import UsageError
from ciberrato.evaluation.judged import code_of
from ciberrato.evaluation.options import PUBLIC
from ciberrato.evaluation.settings import sweep
from ciberrato.evaluation.task import Task


def tasks_of(options: argparse.Namespace) -> list[Task]:
    """List the tasks of a command line.

    Raises
    ------
    UsageError
        If it names no lab, or one that is not there, or a part that cannot be loaded.
    """
    from ciberrato.localization.tables.pose_tables import FINE

    labs: list[tuple[str, str | None]] = []
    for name in named_labs(options):
        labs.extend(find_labs(name, options.labs))
    tasks = []
    codes = {pair: code_of(*pair) for pair in itertools.product(options.filter, options.drive)}
    for (
        lab,
        grid,
    ), start, prior, parameters, settings, compass, gps, drive, judged, seed in itertools.product(
        labs,
        options.start,
        options.prior or (["told"] if options.told else ["anywhere"]),
        options.parameters,
        sweep(options.set),
        options.compass,
        options.gps,
        options.drive,
        options.filter,
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
                resolution=FINE if options.resolution is None else options.resolution,
                kidnap=options.kidnap,
                settle=options.settle,
                settings=settings,
                filter=judged,
                code=codes[judged, drive],
            )
        )
    return tasks


def named_labs(options: argparse.Namespace) -> list[str]:
    """Return the words of ``--lab``; with ``--labs`` alone they are ``all``.

    Raises
    ------
    UsageError
        If there are neither; it says what would be run.
    """
    words: list[str] | None = options.lab or (["all"] if options.labs is not None else None)
    if words:
        return words
    axes = ("start", "parameters", "set", "compass", "gps", "drive", "filter")
    kinds = {axis: getattr(options, axis) for axis in axes if getattr(options, axis)}
    number = options.seeds * len(sweep(options.set))
    for axis, values in kinds.items():
        number *= 1 if axis == "set" else len(values)
    said = "; ".join(f"{axis} {' '.join(values)}" for axis, values in kinds.items())
    raise UsageError(
        f"in each lab that --lab names this would do {number} runs of {options.cycles} cycles ({said}) and "
        f"add what comes of them to {options.output}; name labs, like --lab maze, or --lab maps for all "
        f"that ship ({PUBLIC})"
    )


def find_labs(name: str, folder: Path | None) -> list[tuple[str, str | None]]:
    """Find the labs that a word of ``--lab`` stands for, each with its start grid if it lies beside."""
    from ciberrato.evaluation.labs import MAPS, all_labs, judged_labs, lab_in
    from ciberrato.labs import find_lab

    if name == "maps":
        return [(shipped, None) for shipped in MAPS]
    if folder is None and os.environ.get("CIBERRATO_LABS"):
        folder = Path(os.environ["CIBERRATO_LABS"])
    if name in ("judged", "all"):
        if folder is None:
            raise UsageError(
                f"--lab {name}: name the folder of public labs by --labs or CIBERRATO_LABS ({PUBLIC})"
            )
        if not folder.is_dir():
            raise UsageError(f"--labs {folder}: no such folder; check the path")
        labs = judged_labs(folder) if name == "judged" else all_labs(folder)
        if not labs:
            raise UsageError(f"--labs {folder}: there are no public labs in it ({PUBLIC})")
        return [(str(lab.path), None if lab.grid is None else str(lab.grid)) for lab in labs]
    if folder is not None and not os.path.isfile(name):
        lab = lab_in(folder, name)
        if lab is not None:
            return [(str(lab.path), None if lab.grid is None else str(lab.grid))]
    find_lab(name)  # complains if there is none
    return [(name, None)]


@functools.cache
def resolution_of(lab: str) -> float:
    """Return the finest resolution of tables of all of a lab."""
    from ciberrato.files.lab import read_lab
    from ciberrato.labs import find_lab
    from ciberrato.localization.tables.pose_tables import fine_resolution

    return fine_resolution(read_lab(find_lab(lab)))
