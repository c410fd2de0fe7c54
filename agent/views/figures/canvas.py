"""Writing of figures to files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ciberrato.errors import UsageError
from ciberrato.files.atomic import replace_file


def save_figure(figure: Any, path: Path) -> None:
    """Write a figure under a temporary name, then rename it.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    path : Path
        Its ending chooses the format.

    Raises
    ------
    UsageError
        If the format is unknown or the file cannot be written.
    """
    import io

    kind = figure_kind(path)
    buffer = io.BytesIO()
    # What the maps' fixed shapes leave empty round the figure is cut off.
    figure.savefig(buffer, format=kind, dpi=120, bbox_inches="tight", pad_inches=0.08)
    replace_file(path, buffer.getvalue())


def figure_kind(path: Path) -> str:
    """Return the format of a figure's file, by its ending.

    Raises
    ------
    UsageError
        If the format is unknown, or no file can be there.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    kind = path.suffix.lstrip(".").lower() or "png"
    known = FigureCanvasAgg.get_supported_filetypes()
    if kind not in known:
        raise UsageError(
            f"{path}: cannot write a figure of kind {kind!r}; use one of {', '.join(sorted(known))}"
        )
    if path.is_dir() or not path.parent.is_dir():
        reason = "Is a directory" if path.is_dir() else "No such file or directory"
        raise UsageError(f"{path}: cannot be written: {reason}")
    return kind
