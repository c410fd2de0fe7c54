"""The way home in mode 0: recorded sessions of 60 robots, one cycle at a time, replayed; scores and poses."""

from __future__ import annotations

import gzip
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.conformance.finding import Finding
from ciberrato.files.lab import parse_lab_with_warnings
from ciberrato.files.parameters import parse_parameters
from ciberrato.files.start_grid import parse_grid
from simulator_stub.service.session import Session
from simulator_stub.service.transports import Newcomer, Peer
from simulator_stub.simulation import Simulation


def rows(golden: Path, labs: Path | None) -> Iterator[Finding]:
    """Yield a row for each recorded session."""
    del labs
    paths = sorted((golden / "homeward").glob("*.json.gz"))
    if not paths:
        yield Finding("homeward", 0, None, True, "not recorded here")
    for path in paths:
        recorded = json.loads(gzip.decompress(path.read_bytes()))
        name = path.name.removesuffix(".json.gz")
        unlike = []
        for theirs, ours in zip(recorded["statuses"], replay(recorded, name), strict=True):
            if theirs != ours:
                unlike.append(f"step {theirs[0]}, robot {theirs[1]}: {ours[3:]} not {theirs[3:]}")
        note = f"{len(unlike)} unlike, first {unlike[0]}" if unlike else "score, collisions and place"
        yield Finding(f"homeward: {name}", len(recorded["statuses"]), None, not unlike, note)


def replay(recorded: dict[str, Any], name: str) -> list[list[Any]]:
    """Send the recorded messages, one step per cycle, and return what a view sees.

    Parameters
    ----------
    recorded : dict
        Texts of ``lab``, ``grid``, ``parameters``; ``scoring``; ``steps``, each a list of (client,
        message); the client ``new:NAME`` registers as NAME.
    name : str
        Of the recording, for error messages.

    Returns
    -------
    list of [step, robot, time, score, collisions, x, y]
        For each step and robot; the score without its sign and the place as text, as views get them.
    """
    simulation = Simulation(
        parse_lab_with_warnings(recorded["lab"].encode(), name)[0],
        parse_grid(recorded["grid"].encode(), name),
        parse_parameters(recorded["parameters"].encode(), name),
        scoring=recorded["scoring"],
    )
    session = Session(simulation)
    clients: dict[str, _Client] = {}
    seen: list[list[Any]] = []
    for step, messages in enumerate(recorded["steps"]):
        for client, message in messages:
            if client.startswith("new:"):
                peer = clients[client.removeprefix("new:")] = _Client()
                session.welcome(_Newcomer(peer), message.encode())
            else:
                clients[client].deliver(message.encode())
        session.cycle()
        for robot in simulation.robots:
            counts = (simulation.time, robot.score % 2**32, robot.collisions)
            seen.append([step, robot.robot_id, *counts, f"{robot.x:g}", f"{robot.y:g}"])
    return seen


class _Client(Peer):
    def __init__(self) -> None:
        super().__init__("recorded client")

    def send(self, data: bytes) -> None:
        """Send nothing: what is compared comes from the simulation."""

    def close(self) -> None:
        self.closed = True


class _Newcomer(Newcomer):
    label = "recorded client"

    def __init__(self, peer: _Client) -> None:
        self._peer = peer

    def accept(self) -> Peer:
        return self._peer
