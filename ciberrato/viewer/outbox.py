"""Messages that wait to be sent to one browser: never more than the newest of each kind."""

from __future__ import annotations

MOST_REPLIES = 4
"""Answers that may wait; the browser's next question is not read while there are so many."""


class Outbox:
    """A browser's queue, bounded whatever the browser does.

    News are kept by topic, and newer news of a topic take the place of older ones that were not sent yet: a
    slow browser skips frames and sees the latest. Answers to questions are kept all, but few: see `full`.
    """

    def __init__(self) -> None:
        self._news: dict[str, str] = {}
        self._replies: list[str] = []
        self._reply_is_next = False

    def __len__(self) -> int:
        return len(self._news) + len(self._replies)

    @property
    def full(self) -> bool:
        """Return whether no more answers should be made now."""
        return len(self._replies) >= MOST_REPLIES

    def put(self, topic: str, text: str) -> None:
        """Queue news; those of one topic that wait already are replaced."""
        self._news[topic] = text

    def reply(self, text: str) -> None:
        """Queue an answer.

        Raises
        ------
        OverflowError
            If it is `full`; the caller has to look first.
        """
        if self.full:
            raise OverflowError("answers wait to be sent; do not read more questions")
        self._replies.append(text)

    def take(self) -> str | None:
        """Return the next message to send: news and answers by turns, news in the order of their topics."""
        if self._news and not (self._replies and self._reply_is_next):
            self._reply_is_next = True
            return self._news.pop(next(iter(self._news)))
        self._reply_is_next = False
        return self._replies.pop(0) if self._replies else None
