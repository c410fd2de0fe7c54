"""Runs the pose filter over a recorded session of another agent, and compares both with the true poses.

A recording is a folder with ``datagrams.jsonl`` (what went over the wire, base64), ``truth.csv`` (time,
x, y, dir_deg) and, if the agent wrote one, ``localization.out``.

When the recorded agent wrote which block of its file is told by the rule of the published method's own agent:
it takes a reading whenever the distance that its motor commands should have led is a whole number of cells.
Where that does not give as many times as there are blocks, a block is compared with the cell entered of its
number.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from agent.offline.summary import cell_name, peak
from ciberrato.arrays import Floats
from ciberrato.errors import LabError
from ciberrato.evaluation.report import MOST_NAME, aligned
from ciberrato.files.beliefs import read_beliefs
from ciberrato.files.truth import read_truth
from ciberrato.geometry.angles import short_turn
from ciberrato.localization.cell_beliefs import cell_beliefs
from ciberrato.localization.filtering.staged_filter import staged_filter
from ciberrato.localization.tables.cache import cached_tables
from ciberrato.localization.tables.pose_tables import COARSE, FINE
from ciberrato.physics.kinematics import STANDSTILL, Command, filter_wheels
from ciberrato.plaintext import plain
from ciberrato.protocol import (
    Acceptance,
    Measures,
    RobotRegistration,
    decode_actions,
    decode_registration,
    decode_simulator_message,
)
from ciberrato.reprs import short_repr
from ciberrato.world.coordinates import Cell
from ciberrato.world.lab import CELL_SIZE, Lab
from ciberrato.world.parameters import Parameters

_MOST_BLOCKS = 8
"""Number of blocks that a figure shows at most."""


@dataclass(frozen=True, slots=True)
class Recording:
    """A recorded session.

    Attributes
    ----------
    angles : tuple of float
        Mounting angles of the IR sensors in degrees.
    parameters : Parameters
        As announced.
    inputs : list of (Measures, (left, right) or None)
        Every message, and the motor command in effect before it.
    truth : dict of int to (x, y, degrees)
        By time.
    """

    __repr__ = short_repr

    angles: tuple[float, float, float, float]
    parameters: Parameters
    inputs: list[tuple[Measures, Command | None]]
    truth: dict[int, tuple[float, float, float]]


def read_recording(folder: Path) -> Recording:
    """Read a recording.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    Recording

    Raises
    ------
    LabError
        If there is none, or it lacks a registration or its answer.
    """
    truth = read_truth(folder / "truth.csv")
    angles, parameters = None, None
    inputs: list[tuple[Measures, Command | None]] = []
    command: Command | None = None
    try:
        lines = (folder / "datagrams.jsonl").read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError) as error:
        raise LabError(f"not a recording: {error}", source=str(folder)) from None
    for line in lines:
        event = json.loads(line)
        data = base64.b64decode(event["bytes"])
        if event["from"] == "simulator":
            message = decode_simulator_message(data)
            if isinstance(message, Acceptance):
                parameters = message.parameters
            elif isinstance(message, Measures):
                inputs.append((message, command))
        elif angles is None:
            registration = decode_registration(data)
            assert isinstance(registration, RobotRegistration)
            angles = registration.angles
        else:
            actions = decode_actions(data)
            left, right = command or (0.0, 0.0)
            command = (
                left if actions.left_motor is None else actions.left_motor,
                right if actions.right_motor is None else actions.right_motor,
            )
    if angles is None or parameters is None:
        raise LabError("no registration, or no answer to it", source=str(folder))
    return Recording(angles, parameters, inputs, truth)


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """Statements at one time.

    Attributes
    ----------
    time : int
        Cycles.
    cell : (int, int)
        Row and column in which the robot really is.
    live : (float, float, float)
        Our probability of our estimate at that time; how far off it is, in units and degrees.
    ours, theirs : array, shape (rows, columns), or None
        Block of our smoothed belief file for the cell that the robot is in; of the recorded agent's file, the
        block that it wrote at this time.
    """

    __repr__ = short_repr

    time: int
    cell: Cell
    live: tuple[float, float, float]
    ours: Floats | None
    theirs: Floats | None


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """A recording and what both agents make of it.

    Attributes
    ----------
    name : str
    path : array, shape (cycles, 2)
        True places in units.
    cells : int
        Cells in which the robot was, in order.
    moments : tuple of Moment
    blocks : (int, int)
        In our belief file and in that of the recorded agent, the prior included.
    claims, wrong : int
        Cycles in which our filter claimed to know the pose, and in which that was wrong.
    """

    __repr__ = short_repr

    name: str
    path: Floats
    cells: int
    moments: tuple[Moment, ...]
    blocks: tuple[int, int]
    claims: int
    wrong: int


def replay(folder: Path, lab: Lab) -> Replay:
    """Run the filter over a recording.

    Parameters
    ----------
    folder : Path
    lab : Lab

    Returns
    -------
    Replay

    Raises
    ------
    LabError
        If there is no recording.
    """
    recording = read_recording(folder)
    coarse = cached_tables(lab, recording.angles, COARSE)
    fine = cached_tables(lab, recording.angles, FINE)
    pose_filter = staged_filter(lab, coarse, fine, recording.parameters)
    live: dict[int, tuple[Cell, tuple[float, float, float]]] = {}
    entered: list[tuple[int, Cell]] = []
    claims = wrong = 0
    for measures, command in recording.inputs:
        pose_filter.observe(measures, command)
        if measures.time not in recording.truth:
            continue
        x, y, degrees = recording.truth[measures.time]
        found = pose_filter.estimate()
        away = math.hypot(found.x - x, found.y - y)
        turn = abs(math.degrees(short_turn(found.heading - math.radians(degrees))))
        claims += found.certain
        wrong += found.certain and (away > 0.5 or turn > 10.0)
        cell = (int(y // CELL_SIZE), int(x // CELL_SIZE))
        live[measures.time] = cell, (found.probability, away, turn)
        if not entered or entered[-1][1] != cell:
            entered.append((measures.time, cell))
    ours = cell_beliefs(lab, fine, recording.parameters, recording.inputs, smooth=True)
    file = folder / "localization.out"
    theirs = list(read_beliefs(file)[0].beliefs) if file.exists() else []
    times = _reading_times(recording)
    if len(times) != len(theirs) - 1:
        times = [time for time, _ in entered]
    moments = []
    for number, time in enumerate(times, start=1):
        if time not in live:
            continue
        cell, said = live[time]
        step = sum(at <= time for at, _ in entered)
        moments.append(
            Moment(
                time=time,
                cell=cell,
                live=said,
                ours=ours[step] if step < len(ours) else None,
                theirs=theirs[number] if number < len(theirs) else None,
            )
        )
    return Replay(
        name=folder.name,
        path=np.array([recording.truth[time][:2] for time in sorted(recording.truth)]),
        cells=len(entered),
        moments=tuple(moments),
        blocks=(len(ours), len(theirs)),
        claims=claims,
        wrong=wrong,
    )


def _reading_times(recording: Recording) -> list[int]:
    """Return when the published method's own agent takes the readings to which its file refers."""
    driven, wheels = 0.0, STANDSTILL
    times = []
    for number, (measures, command) in enumerate(recording.inputs):
        if number > 0:
            wheels = filter_wheels(command or STANDSTILL, wheels)
            driven += (wheels[0] + wheels[1]) / 2.0
        whole = round(math.fmod(round(driven, 3), CELL_SIZE), 1) == 0.0
        if number == 0 or (whole and driven >= CELL_SIZE / 2.0):
            times.append(measures.time)
    return times


def verdict(block: Floats | None, cell: Cell) -> str:
    """Return in a word whether a block of a belief file is right.

    Parameters
    ----------
    block : array, shape (rows, columns), or None
    cell : (int, int)
        The true one.

    Returns
    -------
    str
        ``right``, ``wrong``, ``undecided`` (the true cell is one of several that are equal), ``nan`` or
        ``nothing``.
    """
    if block is None:
        return "nothing"
    if np.isnan(block).any():
        return "nan"
    best = peak(block)
    if cell not in best.cells:
        return "wrong"
    return "right" if len(best.cells) == 1 else "undecided"


def replay_table(found: Replay) -> str:
    """Return a replay as a table for readers who know neither agent.

    Parameters
    ----------
    found : Replay

    Returns
    -------
    str
    """
    rows = [
        ["time", "robot is in", "the original's file says", "", "our file says", "", "ours live", "off by"]
    ]
    shown: list[tuple[int, int, list[str]]] = []
    for moment in found.moments:
        probability, away, turn = moment.live
        row = [
            cell_name(moment.cell),
            *_said(moment.theirs, moment.cell),
            *_said(moment.ours, moment.cell),
            f"P {probability:.2f}",
            f"{away:.2f} units, {turn:.1f} deg",
        ]
        # A robot that stands for long before a wall is not worth a line for every block.
        if shown and row[:5] == shown[-1][2][:5]:
            shown[-1] = (shown[-1][0], moment.time, row)
        else:
            shown.append((moment.time, moment.time, row))
    for first, last, row in shown:
        rows.append([str(first) if first == last else f"{first}-{last}", *row])
    return "\n".join(
        [
            f"{plain(found.name, MOST_NAME)}: the robot was in {found.cells} cells, one after the other.",
            f"The original wrote {found.blocks[1]} blocks: {_tally(found.moments, 'theirs')}.",
            f"Ours has {found.blocks[0]} blocks (the prior, one a cell, by the whole run); at those times: "
            f"{_tally(found.moments, 'ours')}.",
            f"Live, ours claimed to know the pose in {found.claims} cycles and was wrong in {found.wrong}.",
            aligned(rows),
            "Cells by their centres, in units. P: probability of the cell or of the live estimate.",
        ]
    )


def _said(block: Floats | None, cell: Cell) -> tuple[str, str]:
    word = verdict(block, cell)
    if block is None or word == "nan":
        return "-", word
    best = peak(block)
    more = f" or {len(best.cells) - 1} more" if len(best.cells) > 1 else ""
    named = cell if cell in best.cells else best.cells[0]
    return f"{cell_name(named)}{more}, P {best.probability:.3f}", word


def _tally(moments: Sequence[Moment], who: str) -> str:
    words = [verdict(getattr(moment, who), moment.cell) for moment in moments]
    names = [word for word in ("right", "undecided", "wrong", "nan", "nothing") if word in words]
    return ", ".join(f"{words.count(word)} {'not a number' if word == 'nan' else word}" for word in names)


def draw_replay(found: Replay, lab: Lab, path: Path) -> None:
    """Draw the true path, and below it the blocks of both belief files side by side.

    Parameters
    ----------
    found : Replay
    lab : Lab
    path : Path
        The ending chooses the format.

    Raises
    ------
    UsageError
        If the file cannot be written.
    """
    from agent.views.figures.canvas import save_figure
    from ciberrato import plot
    from ciberrato.plot.canvas import TRUE_COLOUR, new_figure, set_title

    moments = found.moments[:_MOST_BLOCKS]
    rows = max(-(-len(moments) // 2), 1)
    figure = new_figure(12.0, 3.4 + 2.0 * rows)
    top, below = figure.subfigures(2, 1, height_ratios=(3.2, 2.0 * rows + 0.2))
    axes = plot.track(found.path, top.subplots(), lab=lab, colour=TRUE_COLOUR)
    set_title(axes, f"{plain(found.name, MOST_NAME)}: where the robot really drove", size="large")
    panels = list(below.subplots(rows, 4, squeeze=False).flat)
    nothing = np.full((lab.rows, lab.columns), np.nan)
    for axis in panels:
        axis.set_axis_off()
    for number, moment in enumerate(moments):
        for axis, who in zip(panels[2 * number : 2 * number + 2], ("theirs", "ours"), strict=True):
            block = getattr(moment, who)
            plot.cells(nothing if block is None else block, axis, lab=lab, truth=moment.cell)
            name = "original" if who == "theirs" else "ours"
            axis.set_title(f"{name}, cycle {moment.time}:\n{_panel_words(block, moment.cell)}", fontsize=9)
            axis.set_axis_on()
            axis.set_xticks([])
            axis.set_yticks([])
            axis.set(xlabel="", ylabel="")
    left = len(found.moments) - len(moments)
    more = f"; {left} later blocks are not shown" if left else ""
    below.suptitle(
        f"blocks of both belief files; ring: the true cell; bright: probable; grey: no number{more}",
        fontsize=9,
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, path)


def _panel_words(block: Floats | None, cell: Cell) -> str:
    said, word = _said(block, cell)
    return "not a number" if word == "nan" else word if block is None else f"{said}, {word}"
