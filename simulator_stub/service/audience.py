"""Views and panels: who may be one, how many there may be, and when one has gone.

Nothing in the protocol says that a view over UDP has ended. What can be told: its machine says that no
program is there, or it has never asked for anything, which every view that draws something does. One
that was registered with another's address cannot ask, either: it never learns the port to ask at.
"""

from __future__ import annotations

import hmac
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

from ciberrato.protocol import PanelRegistration, ViewRegistration
from simulator_stub.service.clients import ViewClient
from simulator_stub.service.transports import Peer

SOURCE_LIMIT = 64
"""Views and panels at a time, of one address."""

VIEW_LIMIT = 256
"""Views and panels at a time. The real simulator takes any number, until it has no sockets left."""

NEVER_ASKED_SECONDS = 60.0
"""So long a view over UDP may be there without a word."""

GRACE_SECONDS = 2.0
"""So long a view without a word is not made to leave for another one."""

SILENT_SECONDS = 60.0
"""So long a view that has asked once has been silent when it may be made to leave for another one."""


@dataclass(frozen=True, slots=True)
class Admission:
    """Admission of views: only those of this machine, or those with the token.

    Attributes
    ----------
    local_only : bool
    own : str
        The address that the simulator is bound to.
    token : str or None
        None lets in those without one.
    limit : int
        Views and panels at a time.
    """

    local_only: bool = False
    own: str = "127.0.0.1"
    token: str | None = None
    limit: int = VIEW_LIMIT

    def refusal(self, registration: ViewRegistration | PanelRegistration, source: str) -> str | None:
        """Return why a view is refused, None if it is not."""
        if self.local_only and source and not source.startswith("127.") and source != self.own:
            return "only this machine may be a view (--views local)"
        if self.token is not None and not hmac.compare_digest(
            self.token.encode(), (registration.token or "").encode()
        ):
            return "it does not have the token (--view-token)"
        return None


class Audience:
    """Views and panels that take part.

    Parameters
    ----------
    admission : Admission
    dropped : Counter
        Counts ``views`` that had to leave, and ``view_messages``.
    notify : callable
        Told, in one line, who had to leave.

    Attributes
    ----------
    views, panels : list of ViewClient
        In order of their registration.
    """

    def __init__(self, admission: Admission, dropped: Counter[str], notify: Callable[[str], None]) -> None:
        self.views: list[ViewClient] = []
        self.panels: list[ViewClient] = []
        self._admission = admission
        self._dropped = dropped
        self._notify = notify

    def admit(self, peer: Peer, registration: ViewRegistration | PanelRegistration, now: float) -> str | None:
        """Admit a view or a panel.

        Returns
        -------
        str or None
            Reason for its refusal; None if it is admitted.
        """
        refusal = self._admission.refusal(registration, peer.source)
        if refusal is not None:
            return refusal
        self.forget_closed()
        everybody = [*self.views, *self.panels]
        neighbours = [client for client in everybody if client.peer.source == peer.source]
        if len(neighbours) >= SOURCE_LIMIT and not self._make_room(neighbours, now):
            return f"there are {SOURCE_LIMIT} of this address"
        strangers = [client for client in everybody if not client.asked]
        limit = self._admission.limit
        if len(everybody) >= limit and not self._make_room(strangers, now):
            return f"{limit} at a time" if limit else "there are to be none (--views 0)"
        obeyed = isinstance(registration, ViewRegistration)
        (self.views if obeyed else self.panels).append(ViewClient(peer, now, obeyed=obeyed))
        return None

    def _make_room(self, clients: list[ViewClient], now: float) -> bool:
        """Remove one that seems to have gone."""
        candidates = [
            client
            for client in clients
            if not client.peer.connected
            and now - client.since > (SILENT_SECONDS if client.asked else GRACE_SECONDS)
        ]
        if not candidates:
            return False
        self._expel(min(candidates, key=lambda client: (client.asked, client.since)), "for another one")
        return True

    def tick(self, now: float) -> None:
        """Record who was heard, and remove those that have gone."""
        for client in (*self.views, *self.panels):
            if client.heard:
                client.heard, client.asked, client.since = False, True, now
            elif client.peer.lost:
                self._expel(client, "no client is there any more")
            elif not (client.asked or client.peer.connected) and now - client.since > NEVER_ASKED_SECONDS:
                self._expel(client, f"it has not asked for anything in {NEVER_ASKED_SECONDS:g} s")
        self.forget_closed()

    def _expel(self, client: ViewClient, why: str) -> None:
        self._dropped["views"] += 1
        if self._dropped["views"] <= 1:
            self._notify(
                f"removed a view at {client.peer.label}: {why} (reported once; --result has the count)"
            )
        client.peer.close()
        self.forget_closed()

    def forget_closed(self) -> None:
        """Remove those whose connection has ended."""
        for clients in (self.views, self.panels):
            if any(client.peer.closed for client in clients):
                clients[:] = [client for client in clients if not client.peer.closed]

    def count(self) -> None:
        """Add up what was dropped of their messages."""
        for client in self.views:
            self._dropped["view_messages"] += client.dropped
            client.dropped = 0
