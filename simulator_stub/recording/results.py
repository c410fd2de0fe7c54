"""Results of runs: as JSON for programs, and in a few lines for people."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from textwrap import indent
from typing import TYPE_CHECKING, Any

from ciberrato.errors import UsageError
from ciberrato.files.atomic import replace_file
from simulator_stub.recording.observer import Lost, Observer, lose_nothing

if TYPE_CHECKING:
    from simulator_stub.simulation import Simulation
    from simulator_stub.world.robot import Robot

FORMAT = 1
"""Number of the format of the result file; counted up when something in it changes its meaning."""


class Results(Observer):
    """Keeps the outcome of every run in which time passed.

    Parameters
    ----------
    scoring : int or str
        Scoring mode.
    path : Path or None
        The result file, written anew after each run; None for no file.
    notify : callable
        Told the outcome of each run, a line for each robot.
    lost : callable
        Told when the file cannot be written; the next run tries again, with all runs.

    Attributes
    ----------
    seed : int or None
        Seed of the run that is going on; None if it has none of its own, as after a Reset.
    count : int
        Number of runs so far.
    answers : callable or None
        Tells by a robot's id which Measures it answered.
    lockstep : callable or None
        Tells by a robot's id how lockstep dealt with its answers.
    dropped : callable or None
        Tells what was dropped in this world, by what it was, and by robots' ids.
    losses : list of str
        Losses to report: records that could not be kept so far; shared with those who keep them.
    current : bool
        Whether the file holds all runs so far.

    Raises
    ------
    UsageError
        If the file cannot be made.
    """

    def __init__(
        self,
        *,
        seed: int,
        scoring: int | str,
        path: Path | None,
        notify: Callable[[str], None],
        lost: Lost = lose_nothing,
    ) -> None:
        self.seed: int | None = seed
        self.count = 0
        # As text, encoded once: there may be thousands of runs, and records take three times the memory.
        self._runs: list[bytes] = []
        self.answers: Callable[[int], dict[str, int | None]] | None = None
        self.lockstep: Callable[[int], dict[str, int]] | None = None
        self._scoring = scoring
        self._path = path
        self._notify = notify
        self._lost = lost
        self.dropped: Callable[[], tuple[dict[str, int], dict[int, int]]] | None = None
        self.losses: list[str] = []
        self._told_losses = 0
        self.current = True
        if path is not None:
            if path.is_dir() or not os.access(path.parent, os.W_OK):
                raise UsageError(f"{path}: cannot be written; name a file in a folder that can be")
            self._save()

    def world_ended(self, simulation: Simulation) -> None:
        """Store the outcome, write it, and report it."""
        if simulation.time > 0:
            run = outcome(simulation) | {
                "run": self.count + 1,
                "seed": self.seed,
                "scoring": self._scoring,
            }
            for robot in run["robots"]:
                if self.answers is not None:
                    robot |= self.answers(robot["id"])
                if self.lockstep is not None:
                    robot["lockstep"] = self.lockstep(robot["id"])
            if self.dropped is not None:
                run["dropped"], by_robot = self.dropped()
                for robot in run["robots"]:
                    robot["dropped"] = by_robot[robot["id"]]
            run["losses"] = self.losses[self._told_losses :]
            self._told_losses = len(self.losses)
            self.count += 1
            if self._path is not None:
                self._runs.append(indent(json.dumps(run, indent=2), "    ").encode())
            self._save()
            for line in summary(run):
                self._notify(line)
        self.seed = None

    def _save(self) -> None:
        if self._path is None:
            return
        runs = b"[\n" + b",\n".join(self._runs) + b"\n  ]" if self._runs else b"[]"
        try:
            replace_file(self._path, b'{\n  "format": %d,\n  "runs": %s\n}\n' % (FORMAT, runs))
        except UsageError as error:
            self.current = False
            self._lost(f"{error}; the run goes on")
        else:
            self.current = True


def outcome(simulation: Simulation) -> dict[str, Any]:
    """Return how a run came out, or how it stands.

    Parameters
    ----------
    simulation : Simulation

    Returns
    -------
    dict
        ``lab`` (name), ``time`` and ``sim_time`` in cycles, ``state`` of the simulator, and ``robots``, a
        list of dicts in order of the ids: ``id``, ``name``, ``state``, ``score``, ``arrival_time``,
        ``returning_time``, ``collisions``, ``visited`` (numbers of targets), ``x``, ``y``, ``direction``
        (units, degrees).
    """
    return {
        "lab": simulation.world.lab.name,
        "time": simulation.time,
        "sim_time": simulation.world.parameters.sim_time,
        "state": simulation.state.value,
        "robots": [_robot(robot) for robot in simulation.robots],
    }


def _robot(robot: Robot) -> dict[str, Any]:
    return {
        "id": robot.robot_id,
        "name": robot.name,
        "state": robot.state.value,
        "score": robot.score,
        "arrival_time": robot.arrival_time,
        "returning_time": robot.returning_time,
        "collisions": robot.collisions,
        "visited": sorted(robot.visited),
        "x": robot.x,
        "y": robot.y,
        "direction": robot.heading_degrees,
    }


def summary(run: dict[str, Any]) -> list[str]:
    """Return the outcome of a run as lines of text.

    Parameters
    ----------
    run : dict
        As `outcome` gives it.

    Returns
    -------
    list of str
        One for the run, one for each robot.
    """
    limit = f" of {run['sim_time']}" if run["sim_time"] else ""
    lines = [f"run {run['run']}: time {run['time']}{limit}"]
    for robot in run["robots"]:
        visited = ", ".join(str(number) for number in robot["visited"]) or "none"
        lines.append(
            f"robot {robot['id']}, {robot['name']!r}: {robot['state'].lower()}, score {robot['score']}, "
            f"targets visited: {visited}, collisions: {robot['collisions']}"
        )
    return lines
