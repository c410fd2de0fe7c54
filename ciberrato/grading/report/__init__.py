"""Reports of a grading: a site, and files for other programs.

What a clock or a meter has measured stands in ``measured.csv`` and ``measured.js`` alone: all other files
follow from agents, labs and seeds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from ciberrato.grading.course import Course
    from ciberrato.grading.standing import Standing

__all__ = [
    "gradescope",
    "junit",
    "meetings",
    "parquet",
    "pieces",
    "player",
    "publish_report",
    "replay",
    "site",
    "tables",
    "write_report",
]


def write_report(course: Course, ranked: Sequence[Standing], folder: Path, *, missing: int) -> None:
    """Write all files of the report.

    Parameters
    ----------
    course : Course
    ranked : sequence of Standing
    folder : Path
        With the recordings in it.
    missing : int
        Runs that are still to be done.

    Raises
    ------
    UsageError
        If they cannot be written.
    """
    from ciberrato.errors import UsageError
    from ciberrato.files.atomic import replace_file
    from ciberrato.grading.report import gradescope, junit, parquet, pieces, player, replay, site, tables
    from ciberrato.grading.task import file_part

    texts = {
        "index.html": site.index_page(course, ranked, folder, missing=missing),
        "report.css": pieces.asset("report.css"),
        "report.js": pieces.asset("report.js"),
        "results.csv": tables.results_csv(ranked),
        "measured.csv": tables.measured_csv(ranked),
        "measured.js": tables.measured_script(ranked),
        "results.json": tables.results_json(course, ranked, missing=missing),
        "junit.xml": junit.junit_document(course, ranked),
        **player.player_files(),
        **replay.parameter_files(course),
    }
    # Numbered as in the course, not by place: a folder is the same agent's whatever the ranking.
    numbers = {agent.name: number for number, agent in enumerate(course.agents, 1)}
    for standing in ranked:
        name = f"{numbers[standing.agent]:03d}-{file_part(standing.agent, 40)}"
        texts[f"gradescope/{name}/results.json"] = gradescope.results(course, standing)
    for path in folder.glob("gradescope/*/results.json"):
        if path.relative_to(folder).as_posix() not in texts:
            path.unlink()  # of an agent that is no longer there
            path.parent.rmdir()
    for name, text in texts.items():
        path = folder / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UsageError(f"{path.parent}: cannot be created: {error.strerror}") from None
        replace_file(path, text.encode("utf-8", "replace"))
    if parquet.available():
        parquet.write_table(ranked, folder / "results.parquet")
    else:
        (folder / "results.parquet").unlink(missing_ok=True)  # one from before would say something else


def publish_report(
    course: Course, ranked: Sequence[Standing], source: Path, folder: Path, *, missing: int
) -> None:
    """Write the public report: without what is secret, and without ``runs.jsonl``.

    Parameters
    ----------
    course : Course
    ranked : sequence of Standing
    source : Path
        Folder of the whole report.
    folder : Path
        Recordings and folders for Gradescope that are there from before, and no longer belong, are removed.
    missing : int

    Raises
    ------
    UsageError
        If it cannot be written.
    """
    import shutil

    from ciberrato.errors import UsageError
    from ciberrato.files.atomic import replace_file
    from ciberrato.grading.secret import published

    course, ranked = published(course, ranked)
    names = {f"{run.task.file}.js" for standing in ranked for run, _ in standing.runs}
    try:
        if (folder / "runs.jsonl").exists():
            raise UsageError(f"{folder}: holds a whole report (runs.jsonl); publish into another folder")
        if folder.is_dir() and any(folder.iterdir()) and not (folder / "play.html").exists():
            raise UsageError(f"{folder}: holds something else than a report; publish into another folder")
        (folder / "recordings").mkdir(parents=True, exist_ok=True)
        for path in (folder / "recordings").iterdir():
            path.unlink()
        shutil.rmtree(folder / "gradescope", ignore_errors=True)
        for name in sorted(names):
            if (source / "recordings" / name).exists():
                replace_file(folder / "recordings" / name, (source / "recordings" / name).read_bytes())
    except OSError as error:
        raise UsageError(f"{folder}: cannot be written: {error.strerror}") from None
    write_report(course, ranked, folder, missing=missing)
