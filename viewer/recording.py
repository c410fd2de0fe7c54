"""An agent's log as something to watch: where it believed to be, and how its belief developed.

The log (JSON Lines, first line the header, then a line a cycle) has estimates, not the true pose. Those of a
live pose filter are shown as they are. Those relative to the first cell's centre are laid into the lab from
the start cell that is most likely in the end, or from the one that the user names.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ciberrato.errors import LabError
from ciberrato.infrared import cell_openings, cell_readings, reading_log_likelihood
from ciberrato.lab import CELL_SIZE, Lab
from ciberrato.labfile import parse_lab
from ciberrato.overlay import GridBelief, OverlayMessage
from ciberrato.parameters import Parameters
from ciberrato.protocol import Acceptance, RobotStatus
from maps import find_lab
from viewer.session import Session

FORMAT = "ciberrato-run"
FORMAT_VERSION = 1
SOURCE = "log"

Floats = NDArray[np.float64]


@dataclasses.dataclass(frozen=True, slots=True)
class RunLog:
    """What a log says that can be shown.

    Attributes
    ----------
    header : dict
        The first line.
    cycles : list of dict
        The others, up to the last complete one; each has a time.
    """

    header: dict[str, Any]
    cycles: list[dict[str, Any]]

    @property
    def steps(self) -> list[dict[str, Any]]:
        """The cycles at which a step was recorded."""
        return [cycle for cycle in self.cycles if isinstance(cycle.get("step"), int)]


def read_log(path: Path) -> RunLog:
    """Read a log; a last line that is not complete is left out.

    Parameters
    ----------
    path : Path

    Returns
    -------
    RunLog

    Raises
    ------
    LabError
        If it cannot be read or is no such log; with the line's number.
    """
    try:
        lines = path.read_bytes().split(b"\n")[:-1]
    except OSError as error:
        raise LabError(f"cannot read the log: {error.strerror}", source=str(path)) from None
    documents = []
    for number, line in enumerate(lines, start=1):
        try:
            document = json.loads(line)
        except (ValueError, RecursionError):
            raise LabError("not a line of JSON", source=str(path), line=number) from None
        if not isinstance(document, dict) or (number > 1 and not isinstance(document.get("time"), int)):
            raise LabError("an object with a time was expected", source=str(path), line=number)
        documents.append(document)
    header = documents[0] if documents else {}
    if header.get("format") != FORMAT or header.get("format_version") != FORMAT_VERSION:
        raise LabError(
            f'the first line does not say "format":"{FORMAT}","format_version":{FORMAT_VERSION}; '
            "give the run.jsonl of an agent",
            source=str(path),
            line=1,
        )
    return RunLog(header, documents[1:])


def load_recording(
    path: Path, lab_name: str | None, start: tuple[int, int] | None, beliefs: Path | None = None
) -> Session:
    """Make a session that shows a log.

    Parameters
    ----------
    path : Path
    lab_name : str or None
        File or name of the lab; None = the one that the log names.
    start : (column, row) or None
        The start cell from the lower left; None = the most likely one.
    beliefs : Path or None
        The localization.out that the agent wrote; None = filter the readings here.

    Returns
    -------
    Session

    Raises
    ------
    LabError
        If a file is not what it should be, or the lab is another one than the log's.
    UsageError
        If there is no such lab.
    """
    log = read_log(path)
    lab = _find(log, lab_name, path)
    posteriors = _filtered(log, lab) if beliefs is None else _read_beliefs(beliefs, len(log.steps), lab)
    column, row = start if start is not None else _start_cell(log, posteriors)
    session = Session(path.name, recording=True)
    session.world.lab = lab
    parameters = _parameters(log)
    session.world.receive(Acceptance(parameters=parameters), 0.0)
    _show_frames(session, log, (CELL_SIZE * (column + 0.5), CELL_SIZE * (row + 0.5)))
    robot = _robot_id(log)
    for cycle, posterior in zip(log.steps, posteriors, strict=False):
        message = OverlayMessage(
            source=SOURCE,
            robot=robot,
            time=cycle["time"],
            angles=_angles(log),
            belief=GridBelief(cells=posterior),
        )
        session.overlays.receive(message, now=0.0, lab=lab)  # the true cell is not known
    return session


def _find(log: RunLog, lab_name: str | None, path: Path) -> Lab:
    name = str(log.header.get("lab_name", ""))
    file = find_lab(lab_name if lab_name is not None else name)
    data = file.read_bytes()
    if hashlib.sha256(data).hexdigest() != log.header.get("lab_sha256"):
        raise LabError(
            f"recorded in another lab ({name}) than {file.name}; give it with -m", source=str(path), line=1
        )
    return parse_lab(data, str(file))


def _parameters(log: RunLog) -> Parameters:
    given = log.header.get("parameters")
    known = {field.name for field in dataclasses.fields(Parameters)}
    return Parameters(**{key: value for key, value in (given or {}).items() if key in known})


def _robot_id(log: RunLog) -> int:
    position = log.header.get("robot_position")
    return position if isinstance(position, int) and position > 0 else 1


def _angles(log: RunLog) -> tuple[float, float, float, float]:
    front, left, right, back = log.header.get("sensor_angles") or (0.0, 90.0, -90.0, 180.0)
    return float(front), float(left), float(right), float(back)


def _filtered(log: RunLog, lab: Lab) -> list[Floats]:
    """Filter the readings of the steps: one column to the right a step, where no wall is between.

    A plain filter for looking at: the readings of cell centres, with noise widened for robots that cross
    them a little beside. What the agent itself computed is in its localization.out.
    """
    from ciberrato.bayes import update

    ideal = cell_readings(lab, _angles(log))
    east, _ = cell_openings(lab)
    parameters = _parameters(log)
    sigma = math.hypot(max(parameters.obstacle_noise, 0.05), 0.15 if parameters.motors_noise else 0.0)
    belief = np.full((lab.rows, lab.columns), 1.0 / (lab.rows * lab.columns))
    posteriors = []
    for index, cycle in enumerate(log.steps):
        if index:
            moved = np.zeros_like(belief)
            moved[:, 1:] = np.where(east, belief[:, :-1], 0.0)
            belief = moved if moved.sum() > 0.0 else np.full_like(belief, 1.0 / belief.size)
        readings = cycle.get("readings") or cycle.get("infrared") or []
        log_likelihood = sum(
            (
                reading_log_likelihood(value, ideal[..., sensor], sigma)
                for sensor, value in enumerate(readings[:4])
                if value is not None
            ),
            start=np.zeros_like(belief),
        )
        belief = update(belief, log_likelihood, on_impossible="likelihood").posterior
        posteriors.append(belief.copy())
    return posteriors


def _read_beliefs(path: Path, steps: int, lab: Lab) -> list[Floats]:
    """Read the blocks of a localization.out after its first, the prior."""
    try:
        text = path.read_text()
        blocks = [np.array([line.split() for line in block.split("\n") if line.strip()], float)[::-1]
                  for block in text.replace("\r", "").split("\n\n") if block.strip()]  # fmt: skip
    except (OSError, ValueError) as error:
        raise LabError(f"not a localization.out: {error}", source=str(path)) from None
    shape = (lab.rows, lab.columns)
    if len(blocks) != steps + 1 or any(block.shape != shape for block in blocks):
        raise LabError(
            f"{len(blocks)} blocks; the log has {steps} steps, so {steps + 1} of "
            f"{shape[0]} x {shape[1]} were expected",
            source=str(path),
        )
    return [np.where(np.isfinite(block), block, 0.0) + 1e-12 for block in blocks[1:]]


def _start_cell(log: RunLog, posteriors: list[Floats]) -> tuple[int, int]:
    if not posteriors:
        return 0, 0
    row, column = np.unravel_index(int(posteriors[-1].argmax()), posteriors[-1].shape)
    return max(0, int(column) - (len(posteriors) - 1)), int(row)


def _show_frames(session: Session, log: RunLog, origin: tuple[float, float]) -> None:
    robot = _robot_id(log)
    name = str(log.header.get("robot_name") or "agent")
    collisions, colliding = 0, False
    for cycle in log.cycles:
        hit = cycle.get("collision") is True
        collisions += hit and not colliding
        colliding = hit
        leds = cycle.get("leds") or (False, False, False)
        state = "Finished" if leds[0] else "Running" if cycle.get("start") else "Stopped"
        x, y, direction = _pose(cycle, origin)
        session.show(
            RobotStatus(
                name=name,
                robot_id=robot,
                time=cycle["time"],
                collisions=collisions,
                collision=hit,
                state=state,
                x=x,
                y=y,
                direction=direction,
            )
        )


def _pose(cycle: dict[str, Any], origin: tuple[float, float]) -> tuple[float, float, float]:
    """Where the agent took itself to be: by its live pose filter if it had one, or by dead reckoning."""
    estimate = cycle.get("estimate")
    if estimate:
        x, y, direction, _ = estimate
        return float(x), float(y), float(direction)
    way, aside = cycle.get("displacement") or 0.0, cycle.get("lateral") or 0.0
    return origin[0] + float(way), origin[1] + float(aside), float(cycle.get("heading") or 0.0)
