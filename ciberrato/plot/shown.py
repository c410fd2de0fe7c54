"""Labs, beliefs, runs and estimates as notebooks show them: a picture with a caption, of bounded size.

What is drawn never depends on how large a record is: pictures have at most `MOST_INCHES` by as many, beliefs
at most `MOST_PANELS` panels, tables at most `MOST_ROWS` rows.
"""

from __future__ import annotations

import base64
import html
import io
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ciberrato.bayes.summaries import entropy_bits
from ciberrato.files.beliefs import BeliefRun
from ciberrato.files.run_records import RecordedRun
from ciberrato.localization.pose_filter import Estimate, PoseFilter
from ciberrato.plaintext import plain
from ciberrato.plot.beliefs import cells, poses
from ciberrato.plot.canvas import label_outer, new_figure, step_names
from ciberrato.plot.curves import series
from ciberrato.plot.labs import draw_robot
from ciberrato.plot.labs import lab as draw_lab
from ciberrato.plot.tracks import track
from ciberrato.world.lab import Lab

MOST_INCHES = 9.0
MOST_PANELS = 6
MOST_ROWS = 8
_DPI = 80
_LEAST_SHAPE = 0.1  # height by width, and the other way round: flatter labs are not drawn


def html_of(record: Any) -> str:
    """Return a record as HTML: the picture inside it, the caption escaped.

    Parameters
    ----------
    record : Lab, BeliefRun, RecordedRun, Estimate or PoseFilter

    Returns
    -------
    str

    Raises
    ------
    TypeError
        If it is something else.
    """
    if isinstance(record, Lab):
        return _figure_html(_lab(record), repr(record))
    if isinstance(record, BeliefRun):
        blocks, rows, columns = record.beliefs.shape
        said = f"belief of {rows} x {columns} cells: prior and {blocks - 1} steps, {record.decimals} decimals"
        return _figure_html(_beliefs(record), said)
    if isinstance(record, RecordedRun):
        return _figure_html(_run(record), _about(record))
    if isinstance(record, Estimate):
        return _estimate(record)
    if isinstance(record, PoseFilter):
        found = record.estimate()
        return _figure_html(_filter(record), f"pose filter in {record.lab.name[:60]}: {_said(found)}")
    raise TypeError(f"record: {record!r:.60} is not shown as a picture")


def _figure_html(figure: Any, caption: str) -> str:
    """Embed a figure, if there is one, and its caption."""
    text = html.escape(plain(caption, 200))
    image = ""
    if figure is not None:
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", dpi=_DPI)
        data = base64.b64encode(buffer.getvalue()).decode("ascii")
        image = f'<img style="max-width:100%" alt="{text}" src="data:image/png;base64,{data}">'
    return f'<figure style="margin:0">{image}<figcaption><code>{text}</code></figcaption></figure>'


def _map_figure(width: float, height: float) -> Any:
    """Create a figure for a map, or None where its shape is none that could be seen."""
    if not (width > 0.0 and height > 0.0 and _LEAST_SHAPE <= height / width <= 1.0 / _LEAST_SHAPE):
        return None
    scale = min((MOST_INCHES - 1.0) / width, (MOST_INCHES - 1.5) / height)
    return new_figure(max(scale * width, 2.0) + 0.8, max(scale * height, 0.8) + 0.8)


def _lab(lab: Lab) -> Any:
    if (figure := _map_figure(lab.width, lab.height)) is not None:
        draw_lab(lab, figure.subplots(), legend=True).set_title("")  # the caption says it
    return figure


def _beliefs(run: BeliefRun) -> Any:
    blocks, rows, columns = run.beliefs.shape
    shown = sorted({round(place) for place in np.linspace(0, blocks - 1, MOST_PANELS)})
    across = min(len(shown), 3)
    down = math.ceil(len(shown) / across)
    if not _LEAST_SHAPE <= rows / columns <= 1.0 / _LEAST_SHAPE:
        return None
    width = (MOST_INCHES - 1.0) / across
    height = min(width * rows / columns + 0.4, MOST_INCHES / down - 0.2)
    figure = new_figure(MOST_INCHES, down * height + 0.4, layout="compressed")
    axes = figure.subplots(down, across, squeeze=False)
    names = step_names(blocks)
    for axis in axes.flat[len(shown) :]:
        axis.set_axis_off()
    for axis, block in zip(axes.flat, shown, strict=False):
        belief = run.beliefs[block]
        cells(belief, axis)
        said = "undefined" if np.isnan(belief).any() else f"{entropy_bits(belief):.2f} bits"
        axis.set_title(f"{names[block]}: {said}", fontsize=9)
    label_outer(axes, len(shown))
    bar = figure.colorbar(axes.flat[0].images[-1], ax=axes, shrink=0.9, fraction=0.03, pad=0.015)
    bar.set_label("probability of the cell", fontsize=9)
    return figure


def _run(run: RecordedRun) -> Any:
    """Draw the estimates of the live filter, if there are any, over its entropy; else the IR readings."""
    if not run.cycles:
        return None
    times = [cycle.time for cycle in run.cycles]
    found = _numbers([cycle.estimate for cycle in run.cycles], 4)
    if not np.isfinite(found).any():
        figure = new_figure(MOST_INCHES - 1.0, 3.4)
        infrared = _numbers([cycle.infrared for cycle in run.cycles], 4)
        labels = [f"sensor {number} at {angle:g}°" for number, angle in enumerate(run.header.sensor_angles)]
        axis = series(times, infrared, figure.subplots(), name="IR reading (1/units)", labels=labels)
        figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
        return figure
    figure = new_figure(MOST_INCHES - 1.0, MOST_INCHES - 2.0)
    above, below = figure.subplots(2, 1, height_ratios=(3, 1))
    known = np.where(found[:, 3:] > 0.5, found[:, :2], np.nan)  # before that it jumps from guess to guess
    track(known, above)
    entropy = [math.nan if cycle.entropy is None else cycle.entropy for cycle in run.cycles]
    series(times, entropy, below, name="entropy (bits)")
    return figure


def _numbers(rows: Sequence[Sequence[float | None] | None], columns: int) -> Any:
    missing = (None,) * columns
    return np.array([row or missing for row in rows], np.float64)


def _about(run: RecordedRun) -> str:
    header = run.header
    where = f"in {header.lab_name}" if header.lab_name else "in a lab that it did not know"
    steps = sum(cycle.step is not None for cycle in run.cycles)
    return f"run of {header.robot_name or 'a robot'} {where}: {len(run.cycles)} cycles, {steps} steps"


def _said(found: Estimate) -> str:
    if not math.isfinite(found.x):
        return f"nothing known yet, {found.behind} messages wait"
    place = f"({found.x:.2f}, {found.y:.2f}), {math.degrees(found.heading):.1f}°"
    claim = "certain" if found.certain else "a guess"
    return f"{place}, probability {found.probability:.3f} ({claim}), {found.entropy:.2f} bits"


def _estimate(found: Estimate) -> str:
    """Tabulate the poses that it may be."""
    rows = [
        f"<tr><td>{mode.x:.2f}</td><td>{mode.y:.2f}</td>"
        f"<td>{math.degrees(mode.heading):.1f}</td><td>{mode.probability:.3f}</td></tr>"
        for mode in found.modes[:MOST_ROWS]
    ]
    names = "".join(f"<th>{name}</th>" for name in ("x (units)", "y (units)", "heading (°)", "probability"))
    table = f"<table><tr>{names}</tr>{''.join(rows)}</table>" if rows else ""
    when = "before the first message" if found.time is None else f"cycle {found.time}"
    caption = html.escape(f"{when}: {_said(found)}")
    return f'<figure style="margin:0"><figcaption><code>{caption}</code></figcaption>{table}</figure>'


def _filter(localizer: PoseFilter) -> Any:
    lab, found = localizer.lab, localizer.estimate()
    if (figure := _map_figure(lab.width, lab.height)) is not None:
        states, weights = localizer.states()
        axis = poses(states, weights, figure.subplots(), lab=lab, legend=True)
        if found.certain:
            draw_robot(axis, found.x, found.y, found.heading)
    return figure
