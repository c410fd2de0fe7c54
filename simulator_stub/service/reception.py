"""Registrations: examined on arrival, admitted in a cycle.

What is no registration is dropped at once and costs no other client anything.
"""

from __future__ import annotations

import re
from collections import Counter, deque
from collections.abc import Callable, Iterator

from ciberrato.errors import ProtocolError
from ciberrato.protocol import Registration, decode_registration
from simulator_stub.service.transports import Newcomer

WAITING_LIMIT = 1000
"""Registrations that may wait."""

SOURCE_LIMIT = 250
"""Those of one address."""

ADMISSION_LIMIT = 100
"""Registrations that are answered in a cycle; the rest waits for the next one."""

FOLLOWERS_LIMIT = 100
"""Messages that may follow a registration before it is answered."""

FAULTS_LIMIT = 3
"""So many messages that are no registrations, and a connection is closed."""

TOLD = 100
"""Messages that are no registrations that are put into words; how many are said is the session's business."""

_PERHAPS = re.compile(rb"<(Robot|RobotBeacon|View|Panel)\b")
"""Every registration has one of these somewhere; what has not need not be parsed."""


class Reception:
    """Registrations that wait to be answered.

    Parameters
    ----------
    dropped : Counter
        Counts ``junk`` and ``registrations`` that found no room.
    complain : callable
        Told, in one line, of what is no registration.
    """

    def __init__(self, dropped: Counter[str], complain: Callable[[str], None]) -> None:
        self._dropped = dropped
        self._complain = complain
        self._waiting: deque[tuple[Newcomer, Registration]] = deque()
        self._by_source: Counter[str] = Counter()

    def __bool__(self) -> bool:
        """Return whether a client waits."""
        return bool(self._waiting)

    def welcome(self, newcomer: Newcomer, data: bytes) -> bool:
        """Process a message of a client that has not registered.

        Parameters
        ----------
        newcomer : Newcomer
        data : bytes
            A registration, or what follows one that waits.

        Returns
        -------
        bool
            False if it was evidently neither, and has cost next to nothing.
        """
        if newcomer.followers is not None:
            if len(newcomer.followers) < FOLLOWERS_LIMIT:
                newcomer.followers.append(data)
            else:
                self._dropped["registrations"] += 1
            return True
        if not _PERHAPS.search(data):
            self._refuse(newcomer, data, "not a registration; Robot, RobotBeacon, View and Panel are")
            return False
        source = newcomer.source
        # Looked at before the message is read, which takes longest.
        if len(self._waiting) >= WAITING_LIMIT or self._by_source[source] >= SOURCE_LIMIT:
            self._dropped["registrations"] += 1
            return True
        try:
            registration = decode_registration(data)
        except ProtocolError as error:
            self._refuse(newcomer, b"", str(error))
            return True
        newcomer.followers = []
        self._by_source[source] += 1
        self._waiting.append((newcomer, registration))
        return True

    def _refuse(self, newcomer: Newcomer, data: bytes, why: str) -> None:
        self._dropped["junk"] += 1
        if self._dropped["junk"] <= TOLD:
            shown = f"{data[:40]!r}: " if data else ""
            self._complain(f"registration from {newcomer.label}: {shown}{why}")
        newcomer.faults += 1
        if newcomer.faults >= FAULTS_LIMIT:
            newcomer.turn_away()

    def admit(self) -> Iterator[tuple[Newcomer, Registration]]:
        """Yield those who are to be answered in this cycle, in order of their arrival."""
        for _ in range(min(len(self._waiting), ADMISSION_LIMIT)):
            newcomer, registration = self._waiting.popleft()
            self._by_source[newcomer.source] -= 1
            yield newcomer, registration

    def put_back(self, newcomer: Newcomer, registration: Registration) -> None:
        """Queue a yielded client again, behind those that wait already."""
        self._by_source[newcomer.source] += 1
        self._waiting.append((newcomer, registration))
