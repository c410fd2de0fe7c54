"""An agent's log as something to watch: where it believed to be, and how its belief developed.

The log (`ciberrato.files.run_log`) has estimates, not the true pose. Those of a live pose filter are shown as
they are. Those relative to the first cell's centre are laid into the lab from the start cell that is most
likely in the end, or from the one that the user names.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.errors import LabError, UsageError
from ciberrato.files.beliefs import read_beliefs
from ciberrato.files.lab import parse_lab
from ciberrato.files.run_log import read_run
from ciberrato.files.run_records import Cycle, RecordedRun, RunHeader, Step
from ciberrato.files.xml import read_file
from ciberrato.infrared.model import cell_openings, cell_readings, reading_log_likelihood
from ciberrato.labs import find_lab
from ciberrato.overlay import GridBelief, OverlayMessage
from ciberrato.protocol import Acceptance, RobotStatus
from ciberrato.viewer.session import Session
from ciberrato.world.lab import CELL_SIZE, Lab

SOURCE = "log"


def load_recording(
    path: Path,
    lab_name: str | None,
    start: tuple[int, int] | None,
    beliefs: Path | None = None,
    *,
    salvage: Callable[[str], None] | None = None,
) -> Session:
    """Create a session that shows a log.

    Parameters
    ----------
    path : Path
    lab_name : str or None
        File or name of the lab; None = the one that the log names.
    start : (column, row) or None
        The start cell from the lower left; None = the most likely one.
    beliefs : Path or None
        The localization.out that the agent wrote; None = filter the readings here.
    salvage : callable, optional
        Told of lines that cannot be read and are left out; see `read_run`.

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
    run = read_run(path, salvage=salvage)
    header, steps = run.header, run.steps
    lab = _find(header, lab_name, path)
    if not run.drives_right and not any(cycle.estimate for cycle in run.cycles):
        raise UsageError(
            f"{path}: holds no poses to show: log with a live filter (localize=), or show the simulator's log"
        )
    if beliefs is not None:
        posteriors = _read_beliefs(beliefs, len(steps), lab)
    else:
        # Only a run to the right has readings from cell after cell, for the published method.
        posteriors = _filtered(header, steps, lab) if run.drives_right else []
    column, row = start if start is not None else _start_cell(posteriors)
    session = Session(path.name, recording=True)
    session.world.lab = lab
    session.world.receive(Acceptance(parameters=header.parameters), 0.0)
    _show_frames(session, run, (CELL_SIZE * (column + 0.5), CELL_SIZE * (row + 0.5)))
    robot = _robot_id(header)
    shown = [(step.time, posterior) for step, posterior in zip(steps, posteriors, strict=False)]
    if not shown:
        shown = [(cycle.time, _logged_belief(cycle.cells, lab)) for cycle in run.cycles if cycle.cells]
    for time, posterior in shown:
        message = OverlayMessage(
            source=SOURCE,
            robot=robot,
            time=time,
            angles=header.sensor_angles,
            belief=GridBelief(cells=posterior),
        )
        session.overlays.receive(message, now=0.0, lab=lab)  # the true cell is not known
    return session


def _logged_belief(cells: tuple[tuple[int, int, float], ...], lab: Lab) -> Floats:
    """Return the cells that a live filter logged as possible; the others have next to nothing."""
    belief = np.full((lab.rows, lab.columns), 1e-12)
    for row, column, probability in cells:
        belief[row, column] += probability
    return belief


def _find(header: RunHeader, lab_name: str | None, path: Path) -> Lab:
    name = header.lab_name
    if not name and lab_name is None:
        raise LabError(
            "does not say in which lab it was recorded; name that with -m", source=str(path), line=1
        )
    file = find_lab(lab_name if lab_name is not None else name)
    data = read_file(file)
    if name and hashlib.sha256(data).hexdigest() != header.lab_sha256:
        raise LabError(
            f"recorded in another lab ({name}) than {file.name}; give it with -m", source=str(path), line=1
        )
    return parse_lab(data, str(file))


def _robot_id(header: RunHeader) -> int:
    return header.robot_position if header.robot_position > 0 else 1


def _filtered(header: RunHeader, steps: Sequence[Step], lab: Lab) -> list[Floats]:
    """Filter the readings of the steps: one column to the right a step, where no wall is between.

    A plain filter for looking at: the readings of cell centres, with noise widened for robots that cross
    them a little beside. What the agent itself computed is in its localization.out.
    """
    from ciberrato.bayes import update

    ideal = cell_readings(lab, header.sensor_angles)
    east, _ = cell_openings(lab)
    parameters = header.parameters
    sigma = math.hypot(max(parameters.obstacle_noise, 0.05), 0.15 if parameters.motors_noise else 0.0)
    belief = np.full((lab.rows, lab.columns), 1.0 / (lab.rows * lab.columns))
    posteriors = []
    for index, step in enumerate(steps):
        if index:
            moved = np.zeros_like(belief)
            moved[:, 1:] = np.where(east, belief[:, :-1], 0.0)
            belief = moved if moved.sum() > 0.0 else np.full_like(belief, 1.0 / belief.size)
        log_likelihood = sum(
            (
                reading_log_likelihood(value, ideal[..., sensor], sigma)
                for sensor, value in enumerate(step.readings)
                if value is not None
            ),
            start=np.zeros_like(belief),
        )
        belief = update(belief, log_likelihood, on_impossible="likelihood").posterior
        posteriors.append(belief.copy())
    return posteriors


def _read_beliefs(path: Path, steps: int, lab: Lab) -> list[Floats]:
    """Read the blocks of a localization.out after its first, the prior."""
    # Where all was lost and the filter began again, the file reads like one of several runs.
    blocks = [belief for run in read_beliefs(path) for belief in run.beliefs]
    shape = (lab.rows, lab.columns)
    if len(blocks) != steps + 1 or any(block.shape != shape for block in blocks):
        raise LabError(
            f"{len(blocks)} blocks; the log has {steps} steps, so {steps + 1} of "
            f"{shape[0]} x {shape[1]} were expected",
            source=str(path),
        )
    return [np.where(np.isfinite(block), block, 0.0) + 1e-12 for block in blocks[1:]]


def _start_cell(posteriors: list[Floats]) -> tuple[int, int]:
    if not posteriors:
        return 0, 0
    row, column = np.unravel_index(int(posteriors[-1].argmax()), posteriors[-1].shape)
    return max(0, int(column) - (len(posteriors) - 1)), int(row)


def _show_frames(session: Session, run: RecordedRun, origin: tuple[float, float]) -> None:
    robot = _robot_id(run.header)
    name = run.header.robot_name or "agent"
    collisions, colliding = 0, False
    for cycle in run.cycles:
        hit = cycle.collision is True
        collisions += hit and not colliding
        colliding = hit
        state = "Finished" if cycle.leds[0] else "Running" if cycle.start else "Stopped"
        x, y, direction = _pose(cycle, origin)
        session.show(
            RobotStatus(
                name=name,
                robot_id=robot,
                time=cycle.time,
                collisions=collisions,
                collision=hit,
                state=state,
                x=x,
                y=y,
                direction_deg=direction,
            )
        )


def _pose(cycle: Cycle, origin: tuple[float, float]) -> tuple[float, float, float]:
    """Return the agent's own estimate: by its live pose filter if it had one, or by dead reckoning."""
    if cycle.estimate is not None:
        x, y, direction, _ = cycle.estimate
        return x, y, direction
    return origin[0] + (cycle.displacement or 0.0), origin[1] + (cycle.lateral or 0.0), cycle.heading or 0.0
