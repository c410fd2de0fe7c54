"""Making and saving figures without a display."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal


def panels(
    rows: int,
    columns: int,
    size: tuple[float, float],
    *,
    layout: Literal["constrained", "compressed"] = "constrained",
    **options: Any,
) -> tuple[Any, Any]:
    """Return a matplotlib figure and its axes, (rows, columns); layout "compressed" for maps."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout=layout)
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def save(figure: Any, path: Path) -> Path:
    """Write a figure as PNG, cut to what is drawn, and return its path."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure)
    figure.savefig(path, dpi=110, bbox_inches="tight", pad_inches=0.08)
    return path
