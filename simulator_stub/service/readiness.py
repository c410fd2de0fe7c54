"""Poll of the sockets with something to read: a thin layer, as the standard library's takes too long."""

from __future__ import annotations

import socket
from collections.abc import Callable

from ciberrato.system.sockets import READING, WRITING, poller

Ready = Callable[[], None]


class Readiness:
    """Sockets under watch, each with a function that is called when it is ready.

    Level-triggered: a handler reads as much as it likes, and is called again while something is left.
    """

    def __init__(self) -> None:
        self._calls: dict[int, Ready] = {}
        self._poller = poller()

    def watch(self, sock: socket.socket, call: Ready) -> None:
        """Call a function whenever there is something to read."""
        self._calls[sock.fileno()] = call
        self._poller.register(sock, READING)

    def watch_for(self, sock: socket.socket, *, reading: bool, writing: bool = False) -> None:
        """Call a watched socket's function when it can be read from, or written to, or only if it breaks."""
        self._poller.modify(sock, READING * reading | WRITING * writing)

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
        for descriptor, _ in self._poller.poll(seconds):
            any_ready = True
            call = self._calls.get(descriptor)
            if call is not None:  # it may have been forgotten just now
                call()
        return any_ready

    def close(self) -> None:
        """Stop watching everything."""
        self._calls.clear()
        self._poller.close()
