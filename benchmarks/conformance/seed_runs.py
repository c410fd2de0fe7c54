"""The published method, replayed: from recorded datagrams the blocks that its author's program wrote.

In the recordings without motor noise the `seed` preset must give the same blocks to the file's three
decimals. With motor noise the author's program dreams up cells and ends in nan; there our tracker must find
just the cells that the robot really entered, and the belief must stay a belief.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from agent.drives.right.tracker import CellTracker, Crossing
from agent.offline.expected_readings import compute_expected_readings
from agent.offline.localizer import Localization, localize
from agent.offline.summary import peak
from benchmarks.conformance.finding import Finding
from ciberrato.files.beliefs import read_beliefs
from ciberrato.files.lab import default_lab
from ciberrato.files.truth import read_truth
from ciberrato.protocol import (
    Acceptance,
    Actions,
    Measures,
    RobotRegistration,
    decode_actions,
    decode_registration,
    decode_simulator_message,
)
from ciberrato.world.lab import CELL_SIZE

TOLERANCE = 0.001
"""The file has three decimals."""


@dataclass(frozen=True, slots=True)
class Recording:
    """One recorded session of one robot."""

    registration: RobotRegistration
    acceptance: Acceptance
    exchange: tuple[Measures | Actions, ...]

    @property
    def noisy(self) -> bool:
        return self.acceptance.parameters.motors_noise > 0


def rows(golden: Path, labs: Path | None) -> Iterator[Finding]:
    """Yield a row for each recorded run."""
    folders = sorted(path.parent for path in golden.glob("seed_runs/*/datagrams.jsonl"))
    if not folders:
        yield Finding(check="seed runs", cases=0, difference=None, passed=True, note="none recorded: skipped")
    for folder in folders:
        recording = read_recording(folder / "datagrams.jsonl")
        crossings = replay(recording)
        yield (noisy_row if recording.noisy else exact_row)(folder, recording, crossings)


def read_recording(path: Path) -> Recording:
    """Decode all datagrams of a session, in the order of the wire."""
    registration: RobotRegistration | None = None
    acceptance: Acceptance | None = None
    exchange: list[Measures | Actions] = []
    for line in path.read_text().splitlines():
        event = json.loads(line)
        data = base64.b64decode(event["bytes"])
        if event["from"] == "simulator":
            message = decode_simulator_message(data)
            if isinstance(message, Acceptance):
                acceptance = message
            elif isinstance(message, Measures):
                exchange.append(message)
        elif registration is None:
            asked = decode_registration(data)
            assert isinstance(asked, RobotRegistration)
            registration = asked
        else:
            exchange.append(decode_actions(data))
    assert registration is not None
    assert acceptance is not None
    return Recording(registration, acceptance, tuple(exchange))


def replay(recording: Recording) -> list[Crossing]:
    """Replay a transcript to the tracker."""
    tracker = CellTracker(recording.acceptance.parameters, recording.registration.angles)
    command: tuple[float, float] | None = None
    crossings = []
    for message in recording.exchange:
        if isinstance(message, Actions):
            left, right = command or (0.0, 0.0)
            command = (
                left if message.left_motor is None else message.left_motor,
                right if message.right_motor is None else message.right_motor,
            )
        else:
            crossing = tracker.observe(message, command)
            if crossing is not None:
                crossings.append(crossing)
    return crossings


def filtered(recording: Recording, crossings: list[Crossing], *, calibrated: bool) -> Localization:
    """Run a preset over the readings."""
    parameters = recording.acceptance.parameters
    truth = compute_expected_readings(default_lab(), recording.registration.angles, parameters)
    return localize(
        [crossing.readings for crossing in crossings],
        truth,
        preset="calibrated" if calibrated else "seed",
        obstacle_noise=parameters.obstacle_noise,
    )


def exact_row(folder: Path, recording: Recording, crossings: list[Crossing]) -> Finding:
    """Compare block by block with the file that the author's program wrote."""
    theirs = read_beliefs(folder / "localization.out")[0].beliefs
    ours = filtered(recording, crossings, calibrated=False).beliefs
    times = " ".join(str(crossing.time) for crossing in crossings)
    if ours.shape != theirs.shape:
        note = f"{len(ours)} blocks, the recording has {len(theirs)} (readings at {times})"
        return Finding(
            check=f"seed run {folder.name}", cases=len(theirs), difference=None, passed=False, note=note
        )
    difference = float(np.abs(ours - theirs).max())
    return Finding(
        check=f"seed run {folder.name}",
        cases=len(theirs),
        difference=difference,
        passed=difference <= TOLERANCE,
        note=f"blocks, preset seed; readings at {times}",
    )


def noisy_row(folder: Path, recording: Recording, crossings: list[Crossing]) -> Finding:
    """Compare with the true poses: as many cells as were entered, and the last belief in the right one."""
    poses = read_truth(folder / "truth.csv")
    start = poses[min(poses)]
    entered = round((max(x for x, _, _ in poses.values()) - start[0]) / CELL_SIZE - 0.25)
    verdicts = []
    for calibrated in (False, True):
        beliefs = filtered(recording, crossings, calibrated=calibrated).beliefs
        sane = bool(np.isfinite(beliefs).all() and np.allclose(beliefs.sum(axis=(1, 2)), 1))
        x, y, _ = poses[crossings[-1].time]
        verdicts.append(sane and peak(beliefs[-1]).cells == ((int(y // CELL_SIZE), int(x // CELL_SIZE)),))
    theirs = read_beliefs(folder / "localization.out")[0].beliefs
    undefined = int(np.isnan(theirs).any(axis=(1, 2)).sum())
    return Finding(
        check=f"seed run {folder.name}",
        cases=len(crossings),
        difference=None,
        passed=all(verdicts) and len(crossings) == entered + 1,
        note=f"{len(crossings) - 1} cells entered (true: {entered}), last belief right with seed: "
        f"{verdicts[0]}, calibrated: {verdicts[1]}; the original: {len(theirs)} blocks, {undefined} nan",
    )
