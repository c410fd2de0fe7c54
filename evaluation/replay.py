"""Runs the pose filter over a recorded session of another agent, and compares both with the true poses.

A recording is a folder with ``datagrams.jsonl`` (what went over the wire, base64), ``truth.csv`` (time,
x, y, dir_deg) and, if the agent wrote one, ``localization.out``.
"""

from __future__ import annotations

import base64
import csv
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from agent.belieffile import read_beliefs
from agent.pose_filter.cache import cached_tables
from agent.pose_filter.staged import StagedFilter
from agent.pose_filter.tables import COARSE, FINE
from agent.pose_filter.trace import cell_beliefs
from ciberrato.errors import LabError
from ciberrato.lab import Lab
from ciberrato.parameters import Parameters
from ciberrato.protocol import (
    Acceptance,
    Measures,
    RobotRegistration,
    decode_actions,
    decode_registration,
    decode_simulator_message,
)

Command = tuple[float, float]


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
    angles, parameters = None, None
    inputs: list[tuple[Measures, Command | None]] = []
    command: Command | None = None
    try:
        lines = (folder / "datagrams.jsonl").read_text().splitlines()
        with (folder / "truth.csv").open(newline="") as file:
            truth = {
                int(row["time"]): (float(row["x"]), float(row["y"]), float(row["dir_deg"]))
                for row in csv.DictReader(file)
            }
    except (OSError, KeyError, ValueError) as error:
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


def replay(folder: Path, lab: Lab) -> Iterator[str]:
    """Run the filter over a recording and say, line by line, how it and the recorded agent fared.

    Parameters
    ----------
    folder : Path
    lab : Lab

    Yields
    ------
    str
        For every true cell: when it was entered, our probability of the true pose and errors then, what our
        smoothed belief file holds, and what that of the recorded agent holds in the block of this number.
    """
    recording = read_recording(folder)
    coarse = cached_tables(lab, recording.angles, COARSE)
    fine = cached_tables(lab, recording.angles, FINE)
    pose_filter = StagedFilter(lab, coarse, fine, recording.parameters)
    entered: list[tuple[int, tuple[int, int], str]] = []
    claims = wrong = 0
    for measures, command in recording.inputs:
        pose_filter.observe(measures, command)
        if measures.time not in recording.truth:
            continue
        x, y, degrees = recording.truth[measures.time]
        found = pose_filter.estimate()
        away = math.hypot(found.x - x, found.y - y)
        turn = abs(math.degrees(math.remainder(found.heading - math.radians(degrees), 2.0 * math.pi)))
        claims += found.certain
        wrong += found.certain and (away > 0.5 or turn > 10.0)
        cell = (int(y // 2.0), int(x // 2.0))
        if not entered or entered[-1][1] != cell:
            live = f"live p {found.probability:.2f}, off by {away:.2f} units, {turn:.1f} degrees"
            entered.append((measures.time, cell, live))
    ours = cell_beliefs(lab, fine, recording.parameters, recording.inputs, smooth=True)
    path = folder / "localization.out"
    theirs = read_beliefs(path)[0].beliefs if path.exists() else np.zeros((0, 1, 1))
    yield (
        f"{folder.name}: {len(entered)} cells; belief files: ours {len(ours)} blocks, theirs {len(theirs)} "
        f"({int(np.isnan(theirs).any(axis=(1, 2)).sum())} of them nan); our claims {claims}, wrong {wrong}"
    )
    for number, (time, cell, live) in enumerate(entered, start=1):
        blocks = f"ours {_peak(ours, number)}; theirs {_peak(theirs, number)}"
        yield f"time {time}: true cell {cell}; {live}; {blocks}"


def _peak(blocks: np.ndarray[tuple[int, ...], np.dtype[np.float64]], number: int) -> str:
    if number >= len(blocks):
        return "nothing"
    block = blocks[number]
    if np.isnan(block).any():
        return "nan"
    row, column = np.unravel_index(int(block.argmax()), block.shape)
    return f"({row}, {column}) {block.max():.3f}"
