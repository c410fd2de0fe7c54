"""Records that the agent sends to the process that answers for it, and that come back.

Back come lists of `ciberrato.net.link.Arrival`, and `agent.drives.exchange.Answered` for what was sent. They
are not in the process's own module, which has another name while it runs as a program.
"""

from __future__ import annotations

from typing import NamedTuple

from agent.run.answerer import AnswererSetup


class Begin(NamedTuple):
    """First record to the process: the link, whose socket came before, and what is known of the run."""

    host: str
    port: int
    peer: tuple[str, int]
    following: tuple[bytes, ...]
    setup: AnswererSetup


class Decision(NamedTuple):
    """A decision on the message of a time, encoded."""

    time: int
    data: bytes


class End(NamedTuple):
    """The last record to the process: it sends nothing any more."""


class Fault(NamedTuple):
    """The link does not carry messages."""

    text: str
