from __future__ import annotations

import base64
import gzip
import json
import socket
import threading
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.recordings import OWN

SECONDS = 300.0  # how long a test waits for what must come, so that a failure does not hang


def transcripts() -> list[Path]:
    """Recorded sessions of the real simulator."""
    return sorted((OWN / "transcripts").glob("*.jsonl.gz"))


@dataclass
class ViewSession:
    """What one socket of the recorder said and heard as a view, in order."""

    events: list[tuple[str, bytes]] = field(default_factory=list)

    @property
    def received(self) -> list[bytes]:
        return [data for direction, data in self.events if direction == "sim"]


def view_sessions(path: Path) -> list[ViewSession]:
    """Split a recording into the talks of its views; one that registers again after a Restart goes on."""
    with gzip.open(path, "rt") as file:
        lines = [json.loads(line) for line in file]
    sessions: dict[int, ViewSession] = {}
    waiting: set[int] = set()  # sockets that registered as a view and have no reply yet
    view_ports: dict[int, int] = {}  # the simulator's port of each view to the view's own
    for line in lines:
        data = base64.b64decode(line["payload_b64"])
        if line["direction"] == "client->sim":
            own = line["from_port"]
            if data.strip(b" \n\0").startswith(b"<View"):
                sessions.setdefault(own, ViewSession()).events.append(("view", data))
                waiting.add(own)
            elif line["to_port"] in view_ports:
                sessions[view_ports[line["to_port"]]].events.append(("view", data))
        elif line["direction"] == "sim->client":
            own = line["to_port"]
            if own in waiting and data.startswith(b"<Reply"):
                waiting.discard(own)
                view_ports[line["from_port"]] = own
            if line["from_port"] in view_ports:
                sessions[own].events.append(("sim", data))
    return [session for session in sessions.values() if session.received]


Row = tuple[int, float, float, float, int, int, str, str]


def recorded_frames(received: list[bytes]) -> dict[int, dict[int, Row]]:
    """Last state of all robots at each time since the last Restart or Reply, read with another parser."""
    frames: dict[int, dict[int, Row]] = {}
    robots: dict[int, Row] = {}
    for data in received:
        text = data.rstrip(b"\0\n").decode("latin-1")
        if text.startswith(("<Restart", "<Reply")):
            frames, robots = {}, {}
        if not text.startswith("<Robot"):
            continue
        try:
            root = ET.fromstring(text)
        except ET.ParseError:
            continue
        get = root.attrib.__getitem__
        position = root.find("Position")
        assert position is not None
        score = int(get("Score"))
        row = (
            int(get("Id")),
            *(float(position.attrib[name]) for name in ("X", "Y", "Dir")),
            score - 2**32 if score >= 2**31 else score,
            int(get("Collisions")),
            get("VisitedMask"),
            get("State"),
        )
        robots[row[0]] = row
        frames[int(get("Time"))] = dict(robots)
    return frames


class ReplayingSimulator:
    """Sends a view what a simulator once sent, in step with the view's own requests.

    Registrations are waited for, and the first LabReq and GridReq after each; what else the recorder sent, a
    person would have to command.
    """

    def __init__(self, session: ViewSession) -> None:
        self.heard: list[bytes] = []
        self.registrations = 0
        self.failure: BaseException | None = None
        self._events = session.events
        self._due: list[bytes] = []
        self._main = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._main.bind(("127.0.0.1", 0))
        self._main.settimeout(SECONDS)
        self.port: int = self._main.getsockname()[1]
        self._peer = ("127.0.0.1", 0)
        self._talk: socket.socket | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            for direction, data in self._events:
                wanted = data.strip(b" \n\0")
                if direction == "sim":
                    assert self._talk is not None
                    self._talk.sendto(data, self._peer)
                elif wanted.startswith(b"<View"):
                    self._register()
                elif wanted in self._due:
                    self._due.remove(wanted)
                    self._await_request()
        except BaseException as error:
            self.failure = error

    def _register(self) -> None:
        data, self._peer = self._main.recvfrom(65536)
        assert data.startswith(b"<View")
        self.registrations += 1
        self._due = [b"<LabReq/>", b"<GridReq/>"]
        self._close_talk()
        self._talk = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._talk.bind(("127.0.0.1", 0))
        self._talk.settimeout(SECONDS)

    def _await_request(self) -> None:
        assert self._talk is not None
        data, sender = self._talk.recvfrom(65536)
        assert sender == self._peer
        self.heard.append(data.rstrip(b"\0"))

    def _close_talk(self) -> None:
        if self._talk is not None:
            self._talk.close()

    def close(self) -> None:
        self._thread.join(SECONDS)
        self._main.close()
        self._close_talk()


@pytest.fixture
def full_session() -> ViewSession:
    """The session in which a viewer did everything that it can do, Reset included."""
    [path] = [path for path in transcripts() if path.name.startswith("01_")]
    return view_sessions(path)[0]
