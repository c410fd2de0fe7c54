"""Reads recorded datagrams: sessions of the real simulator, and runs of the original agent."""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Port = Literal["main", "robot", "view", "panel", "unread"]

_OUTPUT_MARK = "simulator stdout+stderr"


@dataclass(frozen=True, slots=True, kw_only=True)
class Datagram:
    """One recorded datagram.

    Attributes
    ----------
    source : str
        File and line from which it was read.
    data : bytes
    port : str
        Owner, in the simulator, of the port it was sent to, or from; "unread" where it does not read.
    """

    source: str
    data: bytes
    port: Port


@dataclass(frozen=True, slots=True, kw_only=True)
class Session:
    """One recorded session.

    Attributes
    ----------
    name : str
    from_clients, from_simulator : tuple of Datagram
        In the order of the recording.
    output : str
        Output of the real simulator; its complaints are always there, since they are not buffered.
    died : bool
        Whether the real simulator came to an end by itself, with datagrams unread.
    """

    name: str
    from_clients: tuple[Datagram, ...]
    from_simulator: tuple[Datagram, ...]
    output: str
    died: bool


def read_session(path: Path) -> Session:
    """Read one file of `transcripts`."""
    with gzip.open(path, "rt", encoding="utf-8") as lines:
        events = [json.loads(line) for line in lines]
    name = path.name.removesuffix(".jsonl.gz")
    from_clients, from_simulator, output, died = [], [], "", False
    ports = _Ports(_raw(event) for event in events)
    for number, event in enumerate(events, 1):
        source = f"{name}:{number}"
        if event["direction"] == "note":
            if _OUTPUT_MARK in event["text"]:
                output = event["text"]
            died = died or "still alive at end: False" in event["text"]
        elif event["direction"] == "client->sim":
            data = _raw(event)[3]
            port = ports.of_client_datagram(event["to_port"], data)
            from_clients.append(Datagram(source=source, data=data, port=port))
        else:
            data = _raw(event)[3]
            port = ports.of_simulator_datagram(event["from_port"], data)
            from_simulator.append(Datagram(source=source, data=data, port=port))
    return Session(
        name=name,
        from_clients=tuple(from_clients),
        from_simulator=tuple(from_simulator),
        output=output,
        died=died,
    )


def read_seed_run(folder: Path) -> Session:
    """Read one folder of `seed_runs`: one agent, one simulator, the first datagram is the registration."""
    from_clients: list[Datagram] = []
    from_simulator: list[Datagram] = []
    with (folder / "datagrams.jsonl").open(encoding="utf-8") as lines:
        for number, line in enumerate(lines, 1):
            event = json.loads(line)
            data = base64.b64decode(event["bytes"])
            source = f"{folder.name}:{number}"
            if event["from"] == "simulator":
                from_simulator.append(Datagram(source=source, data=data, port="robot"))
            else:
                port: Port = "robot" if from_clients else "main"
                from_clients.append(Datagram(source=source, data=data, port=port))
    return Session(
        name=folder.name,
        from_clients=tuple(from_clients),
        from_simulator=tuple(from_simulator),
        output="",
        died=False,
    )


class _Ports:
    """Tells what is behind each of the simulator's ports, from the traffic alone."""

    def __init__(self, raw_events: Iterable[tuple[str, int | None, int | None, bytes]]) -> None:
        self.kinds: dict[int, Port] = {}
        self._open: set[int] = set()
        asked: dict[int, list[bytes]] = {}
        for direction, source, target, data in raw_events:
            if direction == "client->sim" and source is not None and target is not None:
                if not self.kinds:
                    self.kinds[target] = "main"
                if self.kinds.get(target) == "main":
                    asked.setdefault(source, []).append(data)
            elif direction == "sim->client" and source is not None and target is not None:
                if data.startswith(b"<Measures"):
                    self.kinds[source] = "robot"
                elif data.startswith((b"<Robot", b"<Lab", b"<Grid", b"<Restart")):
                    self.kinds[source] = "view"
                elif source not in self.kinds:
                    # A port that said nothing but Reply: what was last asked for from there tells.
                    last = asked.get(target, [b""])[-1]
                    self.kinds[source] = (
                        "panel" if b"<Panel" in last else "view" if b"<View" in last else "robot"
                    )

    def of_simulator_datagram(self, port: int, data: bytes) -> Port:
        """Return what is behind a port; a Reply is what opens it."""
        if data.startswith(b"<Reply"):
            self._open.add(port)
        return self.kinds.get(port, "unread")

    def of_client_datagram(self, port: int, data: bytes) -> Port:
        """Return who reads a datagram, as things stand; after a Reset only the main port is left."""
        kind = self.kinds.get(port, "unread")
        if kind != "main" and (kind == "panel" or port not in self._open):
            return "unread"
        if kind == "view" and re.match(rb"\s*<Reset\s*(/>|>)", data):
            self._open.clear()
        return kind


def _raw(event: dict[str, object]) -> tuple[str, int | None, int | None, bytes]:
    return (
        str(event["direction"]),
        _port(event.get("from_port")),
        _port(event.get("to_port")),
        base64.b64decode(str(event["payload_b64"])),
    )


def _port(value: object) -> int | None:
    return value if isinstance(value, int) else None


def sessions(golden: Path) -> Iterator[Session]:
    """Read all of `transcripts`, by name."""
    for path in sorted((golden / "transcripts").glob("*.jsonl.gz")):
        yield read_session(path)


def seed_runs(golden: Path) -> Iterator[Session]:
    """Read all of `seed_runs`, by name."""
    for path in sorted((golden / "seed_runs").glob("*/datagrams.jsonl")):
        yield read_seed_run(path.parent)
