"""The clients that take part, as the session keeps them: robots and views, each with what it has sent."""

from __future__ import annotations

from collections import deque

from ciberrato.errors import ProtocolError
from ciberrato.protocol import Actions, ViewCommand, decode_actions, decode_view_command
from simulator_stub.service.allowance import MESSAGES, VIEW_MESSAGES
from simulator_stub.service.answers import Answers
from simulator_stub.service.attendance import Attendance
from simulator_stub.service.transports import Peer

QUEUE_LIMIT = 1000
"""Messages of one client that may wait, where broken ones end the reading; further ones are dropped."""

ANSWERS = 4
"""Requests for lab and grid of a view that are answered in a cycle; further ones are dropped."""


class RobotClient:
    """A robot's client.

    Attributes
    ----------
    robot_id : int
    peer : Peer
    messages : deque of Actions or ProtocolError
        Messages that have arrived and have not been read.
    answered : bool
        Whether anything has arrived since the last Measures.
    complete : bool
        Whether the last message that arrived can stand alone (see `stands_alone`).
    arrived : int
        Messages taken so far.
    taken : int
        Those since the session has read them last.
    dropped : int
        Messages that were too many, in this world.
    commands : int
        Motor commands among them since its reader set it to 0.
    braked, moving : bool
        Whether the last of them stops the robot, though the one before did not; whether it moves it.
    answers : Answers
        Record of its answers, for lockstep.
    attendance : Attendance
        Count of the Measures that it answers.
    silent : bool
        Whether it was waited for in vain: it is not waited for until it sends something.
    """

    __slots__ = (
        "answered",
        "answers",
        "arrived",
        "attendance",
        "braked",
        "commands",
        "complete",
        "dropped",
        "messages",
        "moving",
        "peer",
        "robot_id",
        "silent",
        "taken",
    )

    def __init__(self, robot_id: int, peer: Peer) -> None:
        self.robot_id = robot_id
        self.peer = peer
        self.messages: deque[Actions | ProtocolError] = deque()
        self.answered = False
        self.complete = True
        self.silent = False
        self.arrived = 0
        self.taken = 0
        self.dropped = 0
        self.commands = 0
        self.braked = False
        self.moving = False
        self.answers = Answers(robot_id)
        self.attendance = Attendance()
        peer.deliver = self.take
        peer.serve_every_cycle()

    def take(self, data: bytes) -> None:
        """Process a message as it arrives."""
        if self.taken >= MESSAGES or len(self.messages) >= QUEUE_LIMIT:
            self.dropped += 1
            return
        self.taken += 1
        try:
            actions = decode_actions(data)
        except ProtocolError as error:
            self.messages.append(error)
        else:
            self.messages.append(actions)
            moves = bool(actions.left_motor or actions.right_motor)
            self.complete = moves or stands_alone(actions)
            if self.complete:
                self.commands += 1
                self.braked = self.moving and not moves
                self.moving = moves
        self.arrived += 1
        self.answered = True
        self.silent = False


class ViewClient:
    """A view's client, or a panel's.

    Parameters
    ----------
    peer : Peer
    since : float
        Now, in seconds.
    obeyed : bool
        Whether its commands count: those of panels do not.

    Attributes
    ----------
    peer : Peer
    messages : deque of ViewCommand or ProtocolError
    taken, answers : int
        Messages, and answers to requests, since the session has read them last.
    dropped : int
        Messages and requests that were too many, since that was last counted.
    heard : bool
        Whether anything has come since that was last looked at.
    asked : bool
        Whether anything has come ever.
    since : float
        Time at which it was heard last, or registered.
    """

    __slots__ = ("answers", "asked", "dropped", "heard", "messages", "obeyed", "peer", "since", "taken")

    def __init__(self, peer: Peer, since: float = 0.0, *, obeyed: bool = True) -> None:
        self.peer = peer
        self.messages: deque[ViewCommand | ProtocolError] = deque()
        self.taken = self.answers = self.dropped = 0
        self.heard = self.asked = False
        self.since = since
        self.obeyed = obeyed
        peer.deliver = self.take

    def take(self, data: bytes) -> None:
        """Process a message as it arrives."""
        self.heard = True
        if not self.obeyed:
            return
        if self.taken >= VIEW_MESSAGES or len(self.messages) >= QUEUE_LIMIT:
            self.dropped += 1
            return
        self.taken += 1
        try:
            self.messages.append(decode_view_command(data))
        except ProtocolError as error:
            self.messages.append(error)


def stands_alone(actions: Actions) -> bool:
    """Return whether a message looks like a robot's whole answer.

    The usual client libraries have one call for the motors, and others for each LED (which command both
    motors to 0), for saying and for requesting. A robot that uses one of the others often follows it up with
    a motor command in the same cycle.
    """
    if actions.left_motor or actions.right_motor:
        return True
    lights = any(led is not None for led in (actions.end_led, actions.returning_led, actions.visiting_led))
    commands = actions.left_motor is not None or actions.right_motor is not None
    return commands and not lights
