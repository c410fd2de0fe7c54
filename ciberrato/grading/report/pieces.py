"""Pieces that the report's pages share."""

from __future__ import annotations

import importlib.resources
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from ciberrato.plaintext import plain, plain_lines

MOST_NAME_SHOWN = 40

if TYPE_CHECKING:
    from ciberrato.grading.runner import Graded


def asset(name: str) -> str:
    """Read a file that belongs to the report."""
    return importlib.resources.files("ciberrato.grading").joinpath("assets", name).read_text(encoding="utf-8")


def named(name: str) -> str:
    """Write a name of others: as text without unseen signs, cut when long, and then whole on hover."""
    whole, short = escape(plain(name)), escape(plain(name, MOST_NAME_SHOWN))
    return whole if whole == short else f'<span title="{whole}">{short}</span>'


def told(text: str) -> str:
    """Write lines of others, without unseen signs."""
    return escape(plain_lines(text))


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
