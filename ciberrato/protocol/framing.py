"""Messages on a byte stream: each ends in its NUL."""

from __future__ import annotations

from ciberrato.errors import ProtocolError
from ciberrato.protocol.limits import MESSAGE_LIMIT


class MessageSplitter:
    """Cuts a stream into messages, however they were split over or joined in segments.

    Parameters
    ----------
    limit : int
        The longest message in bytes, NUL included.
    """

    def __init__(self, limit: int = MESSAGE_LIMIT) -> None:
        self._limit = limit
        self._rest = bytearray()

    @property
    def pending(self) -> int:
        """Bytes of the message that has begun and not ended."""
        return len(self._rest)

    def feed(self, data: bytes) -> list[bytes]:
        """Parse the bytes that arrived and return the messages that they complete.

        Parameters
        ----------
        data : bytes

        Returns
        -------
        list of bytes
            Each with its NUL, as a datagram would have it.

        Raises
        ------
        ProtocolError
            If a message is longer than the limit. The stream is of no use after that.
        """
        if not self._rest and 0 <= data.find(0) == len(data) - 1 < self._limit:
            return [data]  # one whole message: nearly always
        *ends, rest = data.split(b"\0")
        messages = []
        for part in ends:
            self._rest += part
            self._check(len(self._rest) + 1)
            self._rest.append(0)
            messages.append(bytes(self._rest))
            self._rest.clear()
        self._rest += rest
        self._check(len(self._rest) + 1)
        return messages

    def _check(self, length: int) -> None:
        if length > self._limit:
            self._rest.clear()
            raise ProtocolError(
                f"a message on the stream is longer than {self._limit} bytes; each must end in NUL"
            )
