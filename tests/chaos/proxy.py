"""A bad network between a client and a simulator, over UDP and TCP, with a seed.

A client is pointed at the proxy's port instead of the simulator's. Each message that passes may be dropped,
delayed, reordered, duplicated, corrupted or cut short, in each direction as `Faults` says; outages let none
through. What is done to the n-th message of a client in a direction depends on the seed, the client's number
and n alone.

As the simulator does, the proxy answers a UDP client from a new port for each port that it is answered from.
Of a TCP stream whole messages (up to their NUL) are treated; delays keep their order there.

As a program (Ctrl-C ends it and tells what was done)::

    python -m tests.chaos.proxy --to 127.0.0.1:6000 --port 7000 --seed 1 --down drop=0.1,jitter=0.3
"""

from __future__ import annotations

import argparse
import contextlib
import heapq
import itertools
import select
import selectors
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields

import numpy as np

Address = tuple[str, int]
Send = Callable[[bytes], object]

DIRECTIONS = ("up", "down")
"""From the client to the simulator, and back."""


@dataclass(frozen=True)
class Faults:
    """What happens to messages in one direction; all shares are probabilities a message.

    Attributes
    ----------
    drop, duplicate, reorder, corrupt, truncate : float
        Reordered messages are held back until the next one of that client has passed; one to four bytes of
        a corrupted one are replaced; a truncated one ends after a random number of bytes.
    digits : bool
        Corrupt digits only, each into another digit, so that the message stays well formed.
    delay : float
        Seconds, of every message.
    jitter : float
        Seconds; a uniform random delay from 0 to this is added.
    outages : tuple of (float, float)
        From and to, in seconds since the client's first message: nothing passes, all is lost.
    cut_after : int
        TCP: the connection is closed after so many messages; 0 = never.
    """

    drop: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    corrupt: float = 0.0
    truncate: float = 0.0
    digits: bool = False
    delay: float = 0.0
    jitter: float = 0.0
    outages: tuple[tuple[float, float], ...] = ()
    cut_after: int = 0


@dataclass
class Flow:
    """One direction of one client: its random numbers, and what is held back or under way."""

    direction: str
    rng: np.random.Generator
    keep_order: bool
    close: Callable[[], None] = lambda: None
    began: float | None = None
    messages: int = 0
    last_due: float = 0.0
    held: list[tuple[Send, bytes]] = field(default_factory=list)


class Proxy:
    """Passes messages on, badly: a context manager with a thread of its own.

    Parameters
    ----------
    to : (str, int)
        The simulator's main port, the same on UDP and TCP.
    up, down : Faults
        From clients to the simulator, and back; these attributes may be replaced at any time.
    seed : int
    port : int
        To listen on; 0 takes any that is free.

    Attributes
    ----------
    port : int
    blocked : set of str
        Directions in which nothing passes for now (`cut`).
    counts : Counter
        By (direction, what was done).
    """

    def __init__(
        self,
        to: Address,
        *,
        up: Faults | None = None,
        down: Faults | None = None,
        seed: int = 0,
        port: int = 0,
    ) -> None:
        self.to = to
        self.up = up or Faults()
        self.down = down or Faults()
        self.blocked: set[str] = set()
        self.counts: Counter[tuple[str, str]] = Counter()
        self._seed = seed
        self._numbers = itertools.count()
        self._order = itertools.count()
        self._due: list[tuple[float, int, Callable[[], object]]] = []
        self._selector = selectors.DefaultSelector()
        self._udp_clients: dict[Address, Send] = {}
        self._going = True
        self._main, self._listener = _open(port)
        self.port: int = self._main.getsockname()[1]
        self._wake, self._alarm = socket.socketpair()
        self._watch(self._wake, lambda: None)
        self._watch(self._main, self._from_udp_client)
        self._watch(self._listener, self._accept)
        self._thread = threading.Thread(target=self._run, daemon=True)

    @property
    def address(self) -> Address:
        """Where clients find it."""
        return ("127.0.0.1", self.port)

    def __enter__(self) -> Proxy:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._going = False
        self._alarm.send(b"\0")
        self._thread.join(30.0)
        for key in tuple(self._selector.get_map().values()):
            key.fileobj.close()  # type: ignore[union-attr]
        self._selector.close()
        self._alarm.close()

    @contextlib.contextmanager
    def cut(self, *directions: str) -> Iterator[None]:
        """Let nothing through while the block runs; without names in both directions."""
        self.blocked |= set(directions or DIRECTIONS)
        try:
            yield
        finally:
            self.blocked -= set(directions or DIRECTIONS)

    def _run(self) -> None:
        while self._going:
            wait = max(0.0, self._due[0][0] - time.monotonic()) if self._due else None
            for key, _ in self._selector.select(wait):
                if key.fileobj.fileno() >= 0:  # type: ignore[union-attr]
                    key.data()
            while self._due and self._due[0][0] <= time.monotonic():
                with contextlib.suppress(OSError):  # gone meanwhile: lost
                    heapq.heappop(self._due)[2]()

    def _watch(self, sock: socket.socket, call: Callable[[], None]) -> None:
        sock.setblocking(False)
        self._selector.register(sock, selectors.EVENT_READ, call)

    def _forget(self, *socks: socket.socket) -> None:
        for sock in socks:
            with contextlib.suppress(KeyError, ValueError):
                self._selector.unregister(sock)
            sock.close()

    def _flow(self, number: int, direction: str, *, keep_order: bool) -> Flow:
        rng = np.random.default_rng([self._seed, number, DIRECTIONS.index(direction)])
        return Flow(direction, rng, keep_order)

    # --- UDP -------------------------------------------------------------------------------------

    def _from_udp_client(self) -> None:
        with contextlib.suppress(OSError):
            data, client = self._main.recvfrom(65536)
            if client not in self._udp_clients:
                self._udp_clients[client] = self._udp_client(client)
            self._udp_clients[client](data)

    def _udp_client(self, client: Address) -> Send:
        """Make what a client needs; return what takes its messages to the main port."""
        number = next(self._numbers)
        up, down = (self._flow(number, direction, keep_order=False) for direction in DIRECTIONS)
        ours = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)  # the client, as the simulator sees it
        ours.bind(("127.0.0.1", 0))
        faces: dict[Address, socket.socket] = {}  # the simulator's ports, as the client sees them

        def face(address: Address) -> socket.socket:
            sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            sock.bind(("127.0.0.1", 0))

            def from_client() -> None:
                with contextlib.suppress(OSError):
                    data, sender = sock.recvfrom(65536)
                    if sender == client:
                        self._take(up, data, lambda data: ours.sendto(data, address))

            self._watch(sock, from_client)
            return sock

        def from_simulator() -> None:
            with contextlib.suppress(OSError):
                data, address = ours.recvfrom(65536)
                if address not in faces:
                    faces[address] = face(address)
                self._take(down, data, lambda data: faces[address].sendto(data, client))

        self._watch(ours, from_simulator)
        return lambda data: self._take(up, data, lambda data: ours.sendto(data, self.to))

    # --- TCP -------------------------------------------------------------------------------------

    def _accept(self) -> None:
        try:
            client, _ = self._listener.accept()
        except OSError:
            return
        try:
            simulator = socket.create_connection(self.to, timeout=5.0)
        except OSError:
            client.close()
            return
        number = next(self._numbers)
        for sock in (client, simulator):
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._pipe(number, "up", client, simulator)
        self._pipe(number, "down", simulator, client)

    def _pipe(self, number: int, direction: str, here: socket.socket, there: socket.socket) -> None:
        flow = self._flow(number, direction, keep_order=True)
        flow.close = lambda: self._forget(here, there)
        rest = bytearray()

        def send(data: bytes) -> None:
            view = memoryview(data)
            while view:
                try:
                    view = view[there.send(view) :]
                except BlockingIOError:
                    select.select((), (there,), (), 1.0)

        def read() -> None:
            try:
                data = here.recv(65536)
            except (BlockingIOError, InterruptedError):
                return
            except OSError:
                data = b""
            *messages, tail = (bytes(rest) + data).split(b"\0")
            rest[:] = tail
            for message in messages:
                self._take(flow, message + b"\0", send)
            if not data:
                self._selector.unregister(here)  # readable for ever from now on
                if rest:
                    self._take(flow, bytes(rest), send)
                self._push(max(flow.last_due, time.monotonic()), flow.close)

        self._watch(here, read)

    # --- faults ----------------------------------------------------------------------------------

    def _take(self, flow: Flow, data: bytes, send: Send) -> None:
        """Decide what becomes of a message; the same random numbers are drawn whatever the faults are."""
        faults: Faults = getattr(self, flow.direction)
        now = time.monotonic()
        flow.began = now if flow.began is None else flow.began
        flow.messages += 1
        drop, duplicate, reorder, corrupt, truncate, jitter = flow.rng.random(6)
        details = np.random.default_rng(int(flow.rng.integers(2**63)))
        passed = now - flow.began

        def count(what: str) -> None:
            self.counts[flow.direction, what] += 1

        count("messages")
        if flow.direction in self.blocked or any(begin <= passed < end for begin, end in faults.outages):
            count("cut off")
        elif drop < faults.drop:
            count("dropped")
        else:
            if corrupt < faults.corrupt:
                count("corrupted")
                data = corrupted(data, details, digits=faults.digits)
            if truncate < faults.truncate:
                count("truncated")
                data = data[: int(details.integers(max(len(data), 1)))]
            due = now + faults.delay + jitter * faults.jitter
            if flow.keep_order:
                due = flow.last_due = max(due, flow.last_due)
            if reorder < faults.reorder:
                count("reordered")
                flow.held.append((send, data))
            else:
                if duplicate < faults.duplicate:
                    count("duplicated")
                    self._push(due, lambda: send(data))
                self._push(due, lambda: send(data))
                for late, held in flow.held:
                    self._push(due, lambda late=late, held=held: late(held))
                flow.held.clear()
        if flow.messages == faults.cut_after:
            count("connections cut")
            self._push(max(now, flow.last_due), flow.close)

    def _push(self, due: float, action: Callable[[], object]) -> None:
        heapq.heappush(self._due, (due, next(self._order), action))


def corrupted(data: bytes, rng: np.random.Generator, *, digits: bool) -> bytes:
    """Replace one to four bytes, or digits by other digits."""
    places = [i for i, byte in enumerate(data) if not digits or chr(byte).isdigit()]
    changed = bytearray(data)
    for place in rng.choice(places, size=min(int(rng.integers(1, 5)), len(places)), replace=False):
        if digits:
            changed[place] = ord("0") + (changed[place] - ord("0") + int(rng.integers(1, 10))) % 10
        else:
            changed[place] ^= int(rng.integers(1, 256))
    return bytes(changed)


def _open(port: int) -> tuple[socket.socket, socket.socket]:
    """Open one port on both transports."""
    for _ in range(20):
        udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        tcp = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        tcp.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            udp.bind(("127.0.0.1", port))
            tcp.bind(udp.getsockname())
        except OSError:
            udp.close()
            tcp.close()
            if port:
                raise
            continue
        tcp.listen()
        return udp, tcp
    raise OSError("no port is free on both transports")


def parse_faults(text: str) -> Faults:
    """Read ``drop=0.1,jitter=0.3,outages=5:6.5/20:21``; fields as in `Faults`."""
    values: dict[str, object] = {}
    kinds = {entry.name: entry.default for entry in fields(Faults)}
    for part in filter(None, text.split(",")):
        name, _, value = part.partition("=")
        if name not in kinds:
            raise argparse.ArgumentTypeError(f"{name!r} is not one of {', '.join(kinds)}")
        if name == "outages":
            values[name] = tuple(tuple(map(float, span.split(":"))) for span in value.split("/"))
        elif name == "digits":
            values[name] = value in ("", "1", "true", "True")
        else:
            values[name] = type(kinds[name])(value)  # type: ignore[call-arg]
    return Faults(**values)  # type: ignore[arg-type]


def main() -> None:
    """Run a proxy until Ctrl-C."""
    parser = argparse.ArgumentParser(prog="python -m tests.chaos.proxy")
    parser.add_argument("--to", default="127.0.0.1:6000", help="the simulator")
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--up", type=parse_faults, default=Faults(), help="to the simulator")
    parser.add_argument("--down", type=parse_faults, default=Faults(), help="to the client")
    options = parser.parse_args()
    host, _, port = options.to.partition(":")
    with Proxy(
        (host, int(port)), up=options.up, down=options.down, seed=options.seed, port=options.port
    ) as proxy:
        print(f"listening on udp and tcp 127.0.0.1:{proxy.port}", flush=True)
        with contextlib.suppress(KeyboardInterrupt):
            threading.Event().wait()
        for (direction, what), number in sorted(proxy.counts.items()):
            print(f"{direction}: {number} {what}")


if __name__ == "__main__":
    main()
