"""Pipes from several processes, read as something comes."""

from __future__ import annotations

import os
import queue
import select
import selectors
import threading
from collections.abc import Callable
from typing import Any

_PIECE = 1 << 16
_MOST_WAITING = 64
"""Pieces between the threads and the one that takes them; with more, writers are held up, as by a pipe."""

Take = Callable[[bytes], object]
"""Given each piece; an empty one at the end."""

# What POSIX watches pipes with; without these there is only `select.select`, for Windows' sockets.
_CAN_WATCH_PIPES = any(hasattr(select, name) for name in ("epoll", "poll", "kqueue"))


def streams() -> Streams:
    """Return what reads pipes here: a selector, or where that knows sockets only (Windows) threads."""
    return Streams() if _CAN_WATCH_PIPES else ThreadedStreams()


class Streams:
    """Pipes under watch, each with a function that is given what comes."""

    _patience = 0.0

    def __init__(self) -> None:
        self._selector = selectors.DefaultSelector()

    def watch(self, stream: Any, take: Take) -> None:
        """Watch a binary stream until it ends."""
        self._selector.register(stream, selectors.EVENT_READ, take)

    def read(self, seconds: float) -> bool:
        """Wait for something to come, and hand it out.

        Parameters
        ----------
        seconds : float
            Longest time to wait.

        Returns
        -------
        bool
            Whether anything came that was not an end.
        """
        any_news = False
        for key, _ in self._selector.select(seconds):
            data = os.read(key.fd, _PIECE)
            key.data(data)
            any_news = any_news or bool(data)
            if not data:
                self._selector.unregister(key.fileobj)
        return any_news

    def rest(self) -> None:
        """Return what is left when the writers have ended."""
        while self.read(self._patience):
            pass


class ThreadedStreams(Streams):
    """The same with a thread for each."""

    _patience = 0.2

    def __init__(self) -> None:
        self._pieces: queue.Queue[tuple[Take, bytes]] = queue.Queue(_MOST_WAITING)

    def watch(self, stream: Any, take: Take) -> None:
        """Watch a binary stream until it ends."""

        def read() -> None:
            data = b"?"
            while data:
                try:
                    data = os.read(stream.fileno(), _PIECE)
                except (OSError, ValueError):  # a pipe whose writer was killed, or that was closed
                    data = b""
                self._pieces.put((take, data))

        threading.Thread(target=read, name="stream", daemon=True).start()

    def read(self, seconds: float) -> bool:
        """Wait for something to come, and hand it out; see `Streams.read`."""
        any_news = False
        wait = seconds
        for _ in range(_MOST_WAITING):
            try:
                take, data = self._pieces.get(wait > 0.0, wait or None)
            except queue.Empty:
                break
            take(data)
            any_news = any_news or bool(data)
            wait = 0.0
        return any_news
