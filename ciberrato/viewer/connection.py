"""The viewer's side of the talk with a simulator, without sockets or clocks.

==========  =========================================  ==========================================
State       Meaning                                    Left by
==========  =========================================  ==========================================
SEARCHING   a View registration is sent, and repeated  a Reply -> LOADING
LOADING     LabReq and GridReq are sent                Lab and Grid -> WATCHING; a Restart, or no
                                                       answer to several requests -> SEARCHING
WATCHING    status messages come in every cycle        a Restart, or no sign of life -> SEARCHING
==========  =========================================  ==========================================

A simulator that has no robots says nothing, and none says goodbye. So the viewer asks for the grid again
after a while of silence: a simulator answers that in every state.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass

from ciberrato.errors import ProtocolError
from ciberrato.protocol import (
    Acceptance,
    GridRequest,
    LabRequest,
    Refusal,
    Restart,
    SimulatorMessage,
    ViewRegistration,
    decode_simulator_message,
    encode,
)
from ciberrato.reprs import short_repr
from ciberrato.world.lab import Lab
from ciberrato.world.start_grid import StartGrid

FIRST_RETRY = 1.0
LONGEST_RETRY = 8.0
"""Seconds between registrations: every one that a simulator reads makes it keep one more view."""

ANSWER_SECONDS = 1.0
"""A request that is not answered in this time is sent again."""

SILENCE_SECONDS = 4.0
"""Silence after which the viewer asks whether anybody is there."""

MOST_UNANSWERED = 4


class ConnectionState(enum.Enum):
    """State of the connection; the value is sent to the page."""

    SEARCHING = "searching"
    LOADING = "loading"
    WATCHING = "watching"


@dataclass(frozen=True, slots=True)
class Outgoing:
    """Bytes to send.

    Attributes
    ----------
    data : bytes
    registration : bool
        To the main port; otherwise to the port that answered.
    """

    __repr__ = short_repr

    data: bytes
    registration: bool = False


class SimulatorConnection:
    """Registers, asks for lab and grid, and does so again when the simulator restarts or disappears.

    Times are seconds of any clock that does not go back.

    Parameters
    ----------
    notify : callable
        Told, in one line each, what people may want to know.
    token : str or None
        Token that a simulator of ours may require of its views.

    Attributes
    ----------
    state : ConnectionState
    undecodable : int
        Datagrams that were no message.
    """

    def __init__(
        self, notify: Callable[[str], None] = lambda line: None, *, token: str | None = None
    ) -> None:
        self._token = token
        self.state = ConnectionState.SEARCHING
        self.undecodable = 0
        self._notify = notify
        self._wait = FIRST_RETRY
        self._deadline = 0.0
        self._unanswered = 0
        self._has_lab = self._has_grid = False

    @property
    def deadline(self) -> float:
        """Time at which `tick` has something to do, unless something is received before."""
        return self._deadline

    def start(self, now: float) -> list[Outgoing]:
        """Start the connection: register.

        Parameters
        ----------
        now : float

        Returns
        -------
        list of Outgoing
        """
        self._wait = FIRST_RETRY
        return self._search(now)

    def receive(self, data: bytes, now: float) -> tuple[SimulatorMessage | None, list[Outgoing]]:
        """Process a datagram.

        Parameters
        ----------
        data : bytes
        now : float

        Returns
        -------
        message : SimulatorMessage or None
            Decoded message; None if it does not matter here.
        outgoing : list of Outgoing
        """
        try:
            message = decode_simulator_message(data)
        except ProtocolError as error:
            self.undecodable += 1
            if self.undecodable == 1:
                self._notify(f"ignored a message from the simulator: {error}")
            return None, []
        if self.state is ConnectionState.SEARCHING:
            return self._receive_reply(message, now)
        self._unanswered = 0
        self._deadline = now + (SILENCE_SECONDS if self.state is ConnectionState.WATCHING else ANSWER_SECONDS)
        match message:
            case Restart():
                self._notify("the simulator was reset; registering again")
                return message, self.start(now)
            case Lab():
                self._has_lab = True
            case StartGrid():
                self._has_grid = True
            case _:
                pass
        if self.state is ConnectionState.LOADING and self._has_lab and self._has_grid:
            self.state = ConnectionState.WATCHING
            self._deadline = now + SILENCE_SECONDS
        return message, []

    def tick(self, now: float) -> list[Outgoing]:
        """Run the tasks that are due.

        Parameters
        ----------
        now : float

        Returns
        -------
        list of Outgoing
        """
        if now < self._deadline:
            return []
        if self.state is ConnectionState.SEARCHING:
            self._wait = min(2.0 * self._wait, LONGEST_RETRY)
            return self._search(now)
        self._unanswered += 1
        if self._unanswered > MOST_UNANSWERED:
            self._notify("the simulator is silent; registering again")
            return self.start(now)
        self._deadline = now + ANSWER_SECONDS
        if self.state is ConnectionState.LOADING:
            return self._requests()
        return [Outgoing(encode(GridRequest()))]

    def lost(self, reason: str, now: float) -> None:
        """Handle a broken link (over TCP only); register again after a while.

        Parameters
        ----------
        reason : str
        now : float
        """
        if self.state is not ConnectionState.SEARCHING:
            self._notify(f"{reason}; registering again")
            self._wait = FIRST_RETRY
        self.state = ConnectionState.SEARCHING
        self._deadline = now + self._wait

    def _search(self, now: float) -> list[Outgoing]:
        self.state = ConnectionState.SEARCHING
        self._deadline = now + self._wait
        return [Outgoing(encode(ViewRegistration(self._token)), registration=True)]

    def _receive_reply(
        self, message: SimulatorMessage, now: float
    ) -> tuple[SimulatorMessage | None, list[Outgoing]]:
        if isinstance(message, Refusal):
            self._notify("the simulator refuses this viewer; trying again (see --view-token)")
            self._wait = self._wait * 2.0
            self._deadline = now + min(self._wait, LONGEST_RETRY)
        if not isinstance(message, Acceptance):
            return None, []
        self.state = ConnectionState.LOADING
        self._has_lab = self._has_grid = False
        self._unanswered = 0
        self._deadline = now + ANSWER_SECONDS
        return message, self._requests()

    def _requests(self) -> list[Outgoing]:
        # In this order and together, as the real viewer does it.
        return [Outgoing(encode(LabRequest())), Outgoing(encode(GridRequest()))]
