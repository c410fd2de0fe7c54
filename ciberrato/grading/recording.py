"""A run as the report plays it: what the viewer's page is sent of a log, made small.

Poses are differences from frame to frame, in thousandths of units and tenths of degrees; what rarely changes
is written where it does.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from ciberrato.errors import CiberratoError

FORMAT = 1
_SCALES = (1000, 1000, 10)


def write_recording(log: Path, target: Path, title: str, names: Mapping[str, str] | None = None) -> bool:
    """Write the recording of a log.

    Parameters
    ----------
    log : Path
        As the simulator writes it.
    target : Path
        Its file: a script that hands the recording to the page: so it can be opened from a disk.
    title : str
        Title on the page.
    names : mapping of str to str, optional
        Names of robots by their ids, in place of their own.

    Returns
    -------
    bool
        False if nothing happened that could be played.
    """
    from ciberrato.files.atomic import replace_file
    from ciberrato.viewer.simulator_log import load_simulator_log

    try:
        session = load_simulator_log(log)
    except CiberratoError:
        return False
    document = compact(session)
    for news in document["news"]:
        if news["type"] == "status":
            news["simulator"] = title
        for robot in news["robots"] if news["type"] == "roster" and names else ():
            robot["name"] = (names or {}).get(str(robot["id"]), robot["name"])
    if not document["times"]:
        return False
    text = json.dumps(document, separators=(",", ":"))
    replace_file(target, f"ciberratoRecording({text});\n".encode())
    return True


def compact(session: Any) -> dict[str, Any]:
    """Create a recording of a session.

    Parameters
    ----------
    session : ciberrato.viewer.session.Session
        One that shows a log.

    Returns
    -------
    dict
        ``format``; ``news``, what the page is sent at first; ``marks``; ``times``, that of the first frame
        and differences; ``phases``, pairs of frame and phase; ``robots``, each with its ``id``, three rows
        of differences ``moves`` (x, y, direction), and ``changes``, rows of frame, score, arrival,
        returning, collisions, hit, mask, state.
    """
    from ciberrato.viewer.page_messages import AskFrames, AskMarks

    frames = json.loads(session.answer(AskFrames(0, 2**31 - 1, 2**31 - 1)))["frames"]
    robots: dict[int, dict[str, Any]] = {}
    phases: list[list[Any]] = []
    for number, (_, phase, rows) in enumerate(frames):
        if not phases or phases[-1][1] != phase:
            phases.append([number, phase])
        for row in rows:
            _add(
                robots.setdefault(
                    row[0], {"id": row[0], "first": number, "rows": [[], [], []], "changes": []}
                ),
                number,
                row,
            )
    return {
        "format": FORMAT,
        "news": [json.loads(text) for _, text in session.snapshot()],
        "marks": json.loads(session.answer(AskMarks(0)))["marks"],
        "times": _differences([frame[0] for frame in frames]),
        "phases": phases,
        "robots": [
            {
                "id": robot["id"],
                "first": robot["first"],
                "moves": [_differences(row) for row in robot["rows"]],
                "changes": robot["changes"],
            }
            for robot in robots.values()
        ],
    }


def _add(robot: dict[str, Any], number: int, row: list[Any]) -> None:
    for values, value, scale in zip(robot["rows"], row[1:4], _SCALES, strict=True):
        # What is nowhere stays where it was last.
        values.append(round(value * scale) if value is not None else values[-1] if values else 0)
    rest = row[4:]
    if not robot["changes"] or robot["changes"][-1][1:] != rest:
        robot["changes"].append([number, *rest])


def _differences(values: list[int]) -> list[int]:
    return values[:1] + [after - before for before, after in pairwise(values)]
