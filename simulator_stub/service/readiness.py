"""Which sockets have something to read: a thin layer over epoll, as the standard one takes too long."""

from __future__ import annotations

import math
import select
import socket
from collections.abc import Callable

Ready = Callable[[], None]


class Readiness:
    """Sockets under watch, each with a function that is called when it is ready.

    Level-triggered: a handler reads as much as it likes, and is called again while something is left.
    """

    def __init__(self) -> None:
        self._calls: dict[int, Ready] = {}
        # Where there is no epoll (it is Linux's), poll does; it counts milliseconds.
        self._has_epoll = hasattr(select, "epoll")
        self._poller = select.epoll() if self._has_epoll else select.poll()

    def watch(self, sock: socket.socket, call: Ready) -> None:
        """Call a function whenever there is something to read."""
        self._calls[sock.fileno()] = call
        self._poller.register(sock, select.POLLIN)

    def watch_writing(self, sock: socket.socket, *, wanted: bool) -> None:
        """Call a watched socket's function also when it can be written to, or no more."""
        self._poller.modify(sock, select.POLLIN | select.POLLOUT if wanted else select.POLLIN)

    def forget(self, sock: socket.socket) -> None:
        """Stop watching; before the socket is closed."""
        del self._calls[sock.fileno()]
        self._poller.unregister(sock)

    def wait(self, seconds: float) -> bool:
        """Wait until something is ready, or time is up; then call the handlers of what is ready.

        Parameters
        ----------
        seconds : float
            Rounded up to milliseconds; 0 only looks.

        Returns
        -------
        bool
            Whether anything was ready.
        """
        any_ready = False
        for descriptor, _ in self._poller.poll(seconds if self._has_epoll else math.ceil(seconds * 1000.0)):
            any_ready = True
            call = self._calls.get(descriptor)
            if call is not None:  # it may have been forgotten just now
                call()
        return any_ready

    def close(self) -> None:
        """Stop watching everything."""
        self._calls.clear()
        if isinstance(self._poller, select.epoll):
            self._poller.close()
