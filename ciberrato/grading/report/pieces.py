"""Pieces that the report's pages share."""

from __future__ import annotations

import importlib.resources
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ciberrato.grading.runner import Graded


def asset(name: str) -> str:
    """Read a file that belongs to the report."""
    return importlib.resources.files("ciberrato.grading").joinpath("assets", name).read_text(encoding="utf-8")


def play_link(run: Graded, folder: Path) -> str:
    """Write the link that plays a run; nothing if there is no recording of it."""
    file = run.task.file
    if not (folder / "recordings" / f"{file}.js").exists():
        return ""
    return (
        f'<a class="play" href="play.html?run={file}" title="Play this run" aria-label="Play this run">▶</a>'
    )


def rounded(value: float) -> str:
    """Write points with two decimals at most."""
    return f"{value:.2f}".rstrip("0").rstrip(".")
