"""Sending overlays to a viewer: one datagram a message, nothing ever waits for the viewer."""

from __future__ import annotations

import contextlib
import socket

from ciberrato.net.address import resolve
from ciberrato.overlay import OVERLAY_PORT, OverlayMessage, encode_overlay


class OverlayClient:
    """An agent's way to a viewer on the same machine.

    Nothing that happens to the viewer reaches the agent: a viewer that is not there, or too busy to read, is
    no error, and nothing blocks.

    Parameters
    ----------
    host : str
        The viewer's machine; viewers listen on 127.0.0.1 only.
    port : int

    Raises
    ------
    UsageError
        If there is no such host.

    Examples
    --------
    >>> from ciberrato.overlay import OverlayMessage, PoseMark
    >>> with OverlayClient() as viewer:
    ...     viewer.send(OverlayMessage(source="me", shapes=(PoseMark(id="here", x=3, y=5, direction=90),)))
    """

    def __init__(self, host: str = "127.0.0.1", port: int = OVERLAY_PORT) -> None:
        self._address = resolve(host, port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        # The longest message must fit, whatever the system's default is.
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 18)

    def send(self, message: OverlayMessage) -> None:
        """Send a message; lost where no viewer listens.

        Parameters
        ----------
        message : OverlayMessage

        Raises
        ------
        ProtocolError
            If it cannot be written as a datagram; see `ciberrato.overlay.encode_overlay`.
        """
        data = encode_overlay(message)
        with contextlib.suppress(OSError):  # refused, no buffer: as lost on the way
            self._socket.sendto(data, self._address)

    def close(self) -> None:
        """Close the socket; again is harmless."""
        self._socket.close()

    def __enter__(self) -> OverlayClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
