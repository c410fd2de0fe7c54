"""Records between the agent and the process that answers for it, on a stream, without ever blocking."""

from __future__ import annotations

import pickle
import select
import socket
import struct
from typing import Any

_LENGTH = struct.Struct("!I")
_MOST = 1 << 16


class Channel:
    """Sends and receives records of any kind; both ends are of this program.

    Parameters
    ----------
    sock : socket
        A connected stream.
    """

    def __init__(self, sock: socket.socket) -> None:
        self._socket = sock
        self._socket.setblocking(False)
        self._arrived = bytearray()
        self._leaving = bytearray()
        self.ended = False
        """Whether the other end is gone."""

    def fileno(self) -> int:
        """Return the stream's descriptor."""
        return self._socket.fileno()

    @property
    def is_waiting(self) -> bool:
        """Whether something waits to be sent."""
        return bool(self._leaving) and not self.ended

    def send(self, record: object) -> None:
        """Send a record; what the stream does not take yet waits for `flush`."""
        data = pickle.dumps(record)
        self._leaving += _LENGTH.pack(len(data)) + data
        self.flush()

    def flush(self) -> None:
        """Send what waits, as far as the stream takes it."""
        while self.is_waiting:
            try:
                del self._leaving[: self._socket.send(self._leaving)]
            except BlockingIOError:
                return
            except OSError:
                self.ended = True

    def receive(self) -> list[Any]:
        """Return the records that have arrived."""
        while not self.ended:
            try:
                data = self._socket.recv(_MOST)
            except BlockingIOError:
                break
            except OSError:
                data = b""
            self._arrived += data
            self.ended = not data
        records, begin = [], 0
        while len(self._arrived) - begin >= _LENGTH.size:
            first = begin + _LENGTH.size
            (length,) = _LENGTH.unpack_from(self._arrived, begin)
            if len(self._arrived) < first + length:
                break
            records.append(pickle.loads(bytes(self._arrived[first : first + length])))
            begin = first + length
        del self._arrived[:begin]
        return records

    def wait(self, timeout: float) -> bool:
        """Wait until something arrives or the other end is gone; return whether that is so."""
        return bool(select.select((self._socket,), (), (), timeout)[0])

    def close(self) -> None:
        """Close this end."""
        self.ended = True
        self._socket.close()
