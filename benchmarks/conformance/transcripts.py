"""Recorded sessions of the real simulator, replayed: the same datagrams in the same cycles, the same answers.

What clients sent goes into a `simulator_stub.service.session.Session`, cycle by cycle; its answers are
compared byte by byte with those recorded. Left out of the comparison are readings that carry noise (their
values only), and what our simulator does differently on purpose; every such answer is counted under its
reason.
"""

from __future__ import annotations

import html
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from benchmarks.conformance.finding import Finding
from benchmarks.conformance.timeline import Timeline, read_timeline
from ciberrato.errors import CiberratoError
from ciberrato.protocol import Refusal, Registration, RobotRegistration, decode_registration, encode
from ciberrato.world.parameters import Parameters
from simulator_stub.assembly import read_world
from simulator_stub.options import parse_arguments
from simulator_stub.service.session import NAME_LIMIT, Session
from simulator_stub.service.transports import Newcomer, Peer
from simulator_stub.simulation import Simulation

GPS_OFFSET = (840.1877167634666, 394.38292663544416)
"""Attributes that the real simulator adds until its first Reset, always."""

UNSENT_SLACK = 2
"""Cycles at the end of a recording whose answers the recorder may not have waited for."""

NAN = "NaN motors, which make the robot's pose invalid for good, are refused"
NAMES = "names go out escaped and as UTF-8; what is left is equal"
LONG_NAME = "a name of more than 600 characters, which kills the real simulator, is refused"
FOREIGN = "taken from a socket that is not the robot's (our UDP transport drops these; the replay does not)"


@dataclass(slots=True)
class Replay:
    """Outcome of one session.

    Attributes
    ----------
    equal : int
        Answers that are equal.
    deliberate : Counter of str
        Answers that differ on purpose, by the reason.
    wrong : list of str
        Other differences.
    foreign : int
        Datagrams that the real simulator took from a stranger.
    moved : frozenset of int
        Lines of the datagrams that were read a cycle away from where their time puts them.
    """

    equal: int = 0
    deliberate: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)
    foreign: int = 0
    moved: frozenset[int] = frozenset()


def rows(golden: Path, labs: Path | None) -> Iterator[Finding]:
    """Yield a row for each session, and one for each kind of deliberate difference."""
    del labs
    folder = golden / "transcripts"
    paths = sorted(folder.glob("*.jsonl.gz"))
    if not paths:
        yield Finding("transcripts", 0, None, True, "skipped: no transcripts here")
    deliberate: dict[str, Counter[str]] = defaultdict(Counter)
    total = 0
    for path in paths:
        try:
            result = replay(path, folder / "files")
        except CiberratoError as error:  # a file that it names is not here
            yield Finding(f"transcript {path.name.removesuffix('.jsonl.gz')}", 0, None, False, str(error))
            continue
        special = result.deliberate.total()
        total += result.equal + special
        for reason, count in result.deliberate.items():
            deliberate[reason][path.name.split("_")[0]] += count
        if result.foreign:
            deliberate[FOREIGN][path.name.split("_")[0]] += result.foreign
        note = f"answers equal: {result.equal}" + (f", {special} differ on purpose" if special else "")
        if result.moved:
            note += f"; read a cycle off: line {', '.join(map(str, sorted(result.moved)))}"
        if result.wrong:
            note = f"{len(result.wrong)} differ, first: {result.wrong[0]}"
        name = path.name.removesuffix(".jsonl.gz")
        yield Finding(
            f"transcript {name}", result.equal + special + len(result.wrong), None, not result.wrong, note
        )
    for reason, places in deliberate.items():
        listed = ", ".join(f"{name}: {count}" for name, count in sorted(places.items()))
        yield Finding("transcripts, on purpose", places.total(), None, True, f"{reason} ({listed})")


def replay(path: Path, files: Path) -> Replay:
    """Replay one session and compare its answers.

    Where a datagram raced with the end of a cycle the recording does not tell which came first, so the other
    order is tried if the answers are not equal.
    """
    timeline = read_timeline(path, files)
    result = _replay(timeline, files)
    for line in timeline.uncertain:
        if result.wrong:
            other = _replay(read_timeline(path, files, result.moved | {line}), files)
            if len(other.wrong) < len(result.wrong):
                result = replace(other, moved=result.moved | {line})
    return result


def _replay(timeline: Timeline, files: Path) -> Replay:
    session = _session(timeline, files)
    replayer = _Replayer(timeline, session)
    result = Replay(foreign=replayer.run())
    mask = _mask(session.simulation.world.parameters)
    long_name = any(
        isinstance(asked, RobotRegistration) and len(asked.name or "") > NAME_LIMIT
        for asked in replayer.asked
    )
    for port, recorded in timeline.answers.items():
        ours = replayer.peers[port].received if port in replayer.peers else []
        for place, event in enumerate(recorded):
            answer = ours[place][1] if place < len(ours) else b""
            if mask(event.data) == mask(answer):
                result.equal += 1
            elif reason := _reason(event.data, answer, long_name=long_name):
                result.deliberate[reason] += 1
            else:
                result.wrong.append(f"line {event.number}: {_contrast(event.data, answer)}")
        for cycle, data in ours[len(recorded) :]:
            if cycle <= timeline.last_cycle - UNSENT_SLACK and not timeline.died:
                result.wrong.append(f"port {port}, cycle {cycle}: too much: {data[:60]!r}")
    return result


def _contrast(theirs: bytes, ours: bytes) -> str:
    """Return where two answers differ first."""
    place = next((i for i, (a, b) in enumerate(zip(theirs, ours, strict=False)) if a != b), 0)
    low = max(place - 30, 0)
    return f"theirs ...{theirs[low : place + 40]!r}, ours ...{ours[low : place + 40]!r}"


# --- what may differ -----------------------------------------------------------------------------------


def _mask(parameters: Parameters) -> Callable[[bytes], bytes]:
    """Create the function that masks what noise decides."""
    p = parameters
    moves = p.motors_noise > 0.0  # then everything that depends on the pose is noisy
    blots = [
        (p.line_sensor_true_probability < 1.0, rb'(<LineSensor Value=)"[01]*"'),
        (p.compass_noise > 0.0 or moves, rb'( Compass=)"[^"]*"'),
        (p.obstacle_noise > 0.0 or moves, rb'(<IRSensor Id="\d" Value=)"[^"]*"'),
        (p.beacon_noise > 0.0 or moves, rb'(<BeaconSensor Id="\d+" Value=)"-?[0-9]+"'),
        (p.gps_linear_noise > 0.0 or moves, rb'(<GPS X=)"[^"]*" Y="[^"]*"'),
        (moves, rb'(<Position X=)"[^"]*" Y="[^"]*" Dir="[^"]*"'),
    ]
    patterns = [re.compile(pattern) for wanted, pattern in blots if wanted]

    def mask(data: bytes) -> bytes:
        for pattern in patterns:
            data = pattern.sub(rb'\1"?"', data)
        return data

    return mask


def _reason(theirs: bytes, ours: bytes, *, long_name: bool) -> str:
    """Return why an answer differs on purpose; empty if it does not."""
    if b'"nan"' in theirs or b'"-nan"' in theirs:
        return NAN
    named = re.match(rb'<Robot Name="([^"]*)" ', ours)
    if named:
        plain = html.unescape(named[1].decode()).encode("latin-1", "replace")
        if ours.replace(named[1], plain, 1) == theirs:
            return NAMES
    if long_name and (not ours or ours == encode(Refusal())):
        return LONG_NAME
    return ""


# --- the replay ------------------------------------------------------------------------------------------


class _RecordingPeer(Peer):
    """A client that keeps what it is sent, with the cycle."""

    def __init__(self, replayer: _Replayer) -> None:
        super().__init__("recorded client")
        self.received: list[tuple[int, bytes]] = []
        self._replayer = replayer
        self._early: list[bytes] = []

    def wait_for_reply(self, data: bytes) -> None:
        """Store a command that is sent as soon as the Reply arrives."""
        self._early.append(data)

    def send(self, data: bytes) -> None:
        if not self.closed:
            self.received.append((self._replayer.cycle, data))
            early, self._early = self._early, []
            for command in early:
                self.deliver(command)

    def close(self) -> None:
        self.closed = True


class _RecordedNewcomer(Newcomer):
    def __init__(self, peer: _RecordingPeer) -> None:
        self.label = "recorded client"
        self._peer = peer

    def accept(self) -> Peer:
        return self._peer


class _Replayer:
    """Feeds a session from a timeline.

    Attributes
    ----------
    peers : dict of int to _RecordingPeer
        By the real simulator's ports.
    asked : list of Registration
        Answers.
    cycle : int
        The cycle that is going on.
    """

    def __init__(self, timeline: Timeline, session: Session) -> None:
        self.asked: list[Registration] = []
        self.timeline = timeline
        self.session = session
        self.cycle = 0
        self.peers = {port: _RecordingPeer(self) for port in timeline.opened_by}
        self._owners = {port: timeline.answers[port][0].client_port for port in timeline.opened_by}

    def run(self) -> int:
        """Run all cycles; returns how many datagrams came from strangers."""
        ports = {line: port for port, line in self.timeline.opened_by.items()}
        registered: set[int] = set()
        foreign = 0
        for cycle in range(self.timeline.last_cycle + 1):
            self.cycle = cycle
            for event in self.timeline.inputs.get(cycle, ()):
                port = event.simulator_port
                if port == self.timeline.main_port:
                    own = ports.get(event.number)
                    if own is not None:
                        self.asked.append(decode_registration(event.data))
                    peer = _RecordingPeer(self) if own is None else self.peers[own]
                    self.session.welcome(_RecordedNewcomer(peer), event.data)
                elif port in self.peers:
                    foreign += event.client_port != self._owners[port]
                    if port in registered:
                        self.peers[port].deliver(event.data)
                    else:
                        self.peers[port].wait_for_reply(event.data)
            self.session.cycle()
            registered.update(port for port, peer in self.peers.items() if peer.received)
        return foreign


def _session(timeline: Timeline, files: Path) -> Session:
    """Create a session from the real simulator's command line."""
    options = parse_arguments(timeline.arguments)
    names = {"lab_file": options.lab, "grid_file": options.grid}
    for what in ("lab", "grid", "param"):
        if getattr(options, what) is not None:
            setattr(options, what, str(files / getattr(options, what)))
    lab, grid, parameters = read_world(options, lambda line: None)
    parameters = replace(parameters, **names)
    simulation = Simulation(lab, grid, parameters, scoring=options.scoring)
    simulation.gps_offset = GPS_OFFSET
    return Session(simulation)
