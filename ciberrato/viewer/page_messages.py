"""The page's side: what is sent to it, as JSON, and what it may ask for. docs/viewer.md lists them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ciberrato.errors import CiberratoError
from ciberrato.protocol import RobotStatus
from ciberrato.reprs import short_repr
from ciberrato.viewer.timeline import Mark
from ciberrato.viewer.world import Frame
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid

MOST_COMMAND_BYTES = 1024
"""Length of a message from the page; longer ones end the connection."""

MOST_WINDOW = 512
"""Frames in one answer."""

_GREATEST_SIDE = 1e5
"""Units; no lab is longer, and no page can draw one."""


class PageError(CiberratoError):
    """A browser sent what no page of ours sends."""


@dataclass(frozen=True, slots=True)
class Control:
    """The page wants the simulator to do something: ``start``, ``stop``, ``reset`` or ``remove`` a robot."""

    __repr__ = short_repr

    do: str
    robot: int = 0


@dataclass(frozen=True, slots=True)
class AskFrames:
    """The page asks for frames, from one time to another, at most so many."""

    __repr__ = short_repr

    first: int
    last: int
    most: int


@dataclass(frozen=True, slots=True)
class AskMarks:
    """The page asks for the marks after the first `skip`."""

    __repr__ = short_repr

    skip: int


@dataclass(frozen=True, slots=True)
class AskBelief:
    """The page asks for the belief in effect at a time."""

    __repr__ = short_repr

    source: str
    time: int


@dataclass(frozen=True, slots=True)
class AskSeries:
    """The page asks for the entropy and the like of all beliefs of a source."""

    __repr__ = short_repr

    source: str


Question = AskFrames | AskMarks | AskBelief | AskSeries


def read_page_message(text: str | bytes) -> Control | Question:
    """Read what a browser sent.

    Parameters
    ----------
    text : str or bytes

    Returns
    -------
    Control or one of the questions

    Raises
    ------
    PageError
        If it is anything else.
    """
    if not isinstance(text, str):
        raise PageError("binary data")
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        raise PageError("not JSON") from None
    if not isinstance(document, dict):
        raise PageError("not an object")
    match document.get("do"), document.get("ask"):
        case ("start" | "stop" | "reset") as do, None:
            return Control(str(do))
        case "remove", None:
            return Control("remove", _whole(document, "robot", least=1))
        case None, "frames":
            return AskFrames(
                first=_whole(document, "from"),
                last=_whole(document, "to"),
                most=_whole(document, "most", least=2, greatest=MOST_WINDOW),
            )
        case None, "marks":
            return AskMarks(_whole(document, "skip"))
        case None, "belief":
            return AskBelief(_source(document), _whole(document, "time"))
        case None, "series":
            return AskSeries(_source(document))
    raise PageError("neither a command nor a question")


def _whole(document: dict[str, Any], name: str, *, least: int = 0, greatest: int = 2**31 - 1) -> int:
    value = document.get(name)
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= greatest:
        raise PageError(f"{name}: a whole number from {least} to {greatest} was expected")
    return value


def _source(document: dict[str, Any]) -> str:
    source = document.get("source")
    if not isinstance(source, str):
        raise PageError("source: text was expected")
    return source


def to_json(document: Any) -> str:
    """Write JSON without blanks; nan and infinity are errors."""
    return json.dumps(document, separators=(",", ":"), allow_nan=False, ensure_ascii=False)


def frame_text(frame: Frame) -> str:
    """Write a frame: ``[time, phase, [[id, x, y, direction, score, ...], ...]]``.

    Parameters
    ----------
    frame : Frame

    Returns
    -------
    str
        JSON. Numbers that are not finite become null.
    """
    return to_json([frame.time, frame.phase, [_robot_row(robot) for robot in frame.robots]])


def _robot_row(robot: RobotStatus) -> list[Any]:
    return [
        robot.robot_id,
        _finite(robot.x),
        _finite(robot.y),
        _finite(robot.direction_deg),
        robot.score,
        robot.arrival_time,
        robot.returning_time,
        robot.collisions,
        int(robot.collision),
        robot.visited_mask,
        robot.state,
    ]


def _finite(value: float) -> float | None:
    # As many digits as the wire has: what a simulator sends goes through unchanged.
    return float(f"{value:.6g}") if math.isfinite(value) else None


def live_frame(frame: str, *, epoch: int, rate: float, marks: int) -> str:
    """Write the news of a frame: as in `frame_text`, cycles a second, and how many marks there are."""
    return f'{{"type":"frame","epoch":{epoch},"rate":{rate:.1f},"marks":{marks},"frame":{frame}}}'


def frames_answer(frames: Sequence[str], epoch: int, question: AskFrames) -> str:
    """Answer `AskFrames`."""
    return (
        f'{{"type":"frames","epoch":{epoch},"from":{question.first},"to":{question.last},'
        f'"frames":[{",".join(frames)}]}}'
    )


def marks_answer(marks: Sequence[Mark], epoch: int, skip: int) -> str:
    """Answer `AskMarks`."""
    rows = [[mark.time, mark.kind, mark.robot] for mark in marks[skip:]]
    return to_json({"type": "marks", "epoch": epoch, "skip": skip, "marks": rows})


def lab_document(lab: Lab) -> dict[str, Any]:
    """Write a lab; corners are flat lists x, y, x, y. What has no finite place cannot be drawn: left out."""
    walls = [
        (wall.height, [value for corner in wall.corners for value in corner])
        for wall in lab.walls
        if all(map(math.isfinite, (wall.height, *(value for corner in wall.corners for value in corner))))
    ]
    return {
        "name": lab.name,
        "width": lab.width if 0.0 < lab.width < _GREATEST_SIDE else 1.0,
        "height": lab.height if 0.0 < lab.height < _GREATEST_SIDE else 1.0,
        "beacons": _finite_rows((beacon.x, beacon.y, beacon.height) for beacon in lab.beacons),
        "targets": _finite_rows((target.x, target.y, target.radius) for target in lab.targets),
        "walls": walls,
    }


def _finite_rows(rows: Iterable[tuple[float, ...]]) -> list[tuple[float, ...]]:
    return [row for row in rows if all(map(math.isfinite, row))]


def world_text(
    *,
    epoch: int,
    lab: Lab | None,
    grid: StartGrid | None,
    parameters: Parameters | None,
    span: tuple[int, int],
    facts: Mapping[str, Any],
) -> str:
    """Write what changes rarely: the lab, the start grid, the parameters that matter to a viewer."""
    return to_json(
        {
            "type": "world",
            "epoch": epoch,
            "lab": None if lab is None else lab_document(lab),
            "grid": _finite_rows((p.x, p.y, p.direction_deg) for p in grid.positions) if grid else [],
            "simTime": parameters.sim_time if parameters is not None else 0,
            "cycleTime": parameters.cycle_time if parameters is not None else 50,
            "span": span,
            **facts,
        }
    )
