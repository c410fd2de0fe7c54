"""The viewer's page for an environment: it is served to the viewer as by a simulator."""

from __future__ import annotations

import contextlib
import socket
import time

from ciberrato.errors import ProtocolError
from ciberrato.protocol import (
    GridRequest,
    LabRequest,
    Restart,
    ViewRegistration,
    decode_registration,
    decode_view_command,
    encode,
    fit_reply,
)
from simulator_stub.service.viewer_process import viewer_beside
from simulator_stub.simulation import Simulation

_MESSAGE_BYTES = 65536
_MOST_AT_ONCE = 64


class Window:
    """A viewer in a process of its own, and the datagrams that it takes and gets.

    Where the page is, the viewer prints. It comes up while the environment goes on.

    Parameters
    ----------
    simulation : Simulation
    frames_per_second : int
        At most so many cycles are shown in a second: `show` waits.
    http : str
        [HOST:]PORT of the page.
    """

    def __init__(self, simulation: Simulation, frames_per_second: int, http: str = "127.0.0.1:0") -> None:
        self._period = 1.0 / frames_per_second
        self._due = time.monotonic()
        self._main = _loopback_socket()
        self.port: int = self._main.getsockname()[1]
        self._views: dict[tuple[str, int], socket.socket] = {}
        self._simulation = simulation
        self._stack = contextlib.ExitStack()
        self._stack.enter_context(viewer_beside(f"127.0.0.1:{self.port}", http))

    def begin(self, simulation: Simulation) -> None:
        """Announce to the viewer that another world has begun; it requests the lab again."""
        self._simulation = simulation
        self._send(encode(Restart()))
        self._forget_views()

    def show(self, simulation: Simulation) -> None:
        """Answer the viewer, send it the robot's position, and wait until the next frame is due."""
        self._simulation = simulation
        self.answer()
        for status in simulation.statuses():
            self._send(encode(status))
        now = time.monotonic()
        self._due = max(self._due + self._period, now)
        time.sleep(self._due - now)

    def answer(self) -> None:
        """Answer the messages that have arrived."""
        for data, sender in _arrived(self._main):
            with contextlib.suppress(ProtocolError):
                if isinstance(decode_registration(data), ViewRegistration):
                    self._welcome(sender)
        for sender, link in self._views.items():
            for data, _ in _arrived(link):
                for message in self._answers(data):
                    _send(link, message, sender)

    def _welcome(self, sender: tuple[str, int]) -> None:
        """Answer a registration from a port of its own, by which the viewer distinguishes worlds."""
        former = self._views.pop(sender, None)
        if former is not None:
            former.close()
        link = self._views[sender] = _loopback_socket()
        _send(link, encode(fit_reply(self._simulation.acceptance())), sender)

    def _answers(self, data: bytes) -> list[bytes]:
        with contextlib.suppress(ProtocolError):
            asked = decode_view_command(data)
            if isinstance(asked, LabRequest):
                return [encode(self._simulation.lab_shown())]
            if isinstance(asked, GridRequest):
                return [encode(self._simulation.world.grid)]
        return []

    def _send(self, data: bytes) -> None:
        for sender, link in self._views.items():
            _send(link, data, sender)

    def _forget_views(self) -> None:
        for link in self._views.values():
            link.close()
        self._views.clear()

    def close(self) -> None:
        """Stop the viewer."""
        self._stack.close()
        self._forget_views()
        self._main.close()


def _loopback_socket() -> socket.socket:
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    link.bind(("127.0.0.1", 0))
    link.setblocking(False)
    return link


def _arrived(link: socket.socket) -> list[tuple[bytes, tuple[str, int]]]:
    """Process what has arrived."""
    taken = []
    for _ in range(_MOST_AT_ONCE):
        try:
            taken.append(link.recvfrom(_MESSAGE_BYTES))
        except (BlockingIOError, ConnectionError):  # nothing more, or a viewer that is gone
            break
    return taken


def _send(link: socket.socket, data: bytes, address: tuple[str, int]) -> None:
    with contextlib.suppress(BlockingIOError, ConnectionError):  # as lost on the way
        link.sendto(data, address)
