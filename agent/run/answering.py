"""The process that answers for the agent: it has the link, and next to nothing to do.

A process that needs a fraction of a millisecond now and then is let in early, on however busy a machine; one
that computes waits for its turn. So the pose filter's process decides, and this one answers.
"""

from __future__ import annotations

import gc
import math
import select
import sys
import time
from typing import Any

from agent.run.answerer import Answerer, AnswererSetup
from agent.run.channel import Channel
from agent.run.relay_records import Begin, Decision, End, Fault, Peer, Register, Registered
from ciberrato.errors import ProtocolError
from ciberrato.net.link import Arrival, LinkError
from ciberrato.net.udp import UdpLink
from ciberrato.protocol import Acceptance, Actions, decode_actions, decode_simulator_message
from ciberrato.system.process import ask_for_short_slices
from ciberrato.system.sockets import inherited_channel, receive_socket

_LONGEST_WAIT = 3600.0


class Service:
    """What the process does: it passes on, and answers once a simulator has accepted the robot.

    So the messages that follow the acceptance are answered from the first, whatever the agent does meanwhile.

    Parameters
    ----------
    channel : Channel
        To the agent.
    link : UdpLink
    begin : Begin
    """

    def __init__(self, channel: Channel, link: UdpLink, begin: Begin) -> None:
        self._channel, self._link, self._begin = channel, link, begin
        self._answerer: Answerer | None = None

    def serve(self, records: list[Register | Decision | End]) -> None:
        """Serve until the agent wants no more, or is gone.

        Parameters
        ----------
        records : list of Register, Decision or End
            Those that came right behind the first.
        """
        channel, link = self._channel, self._link
        while True:
            self._hear()
            for record in [*records, *channel.receive()]:
                if isinstance(record, End):
                    return
                self._obey(record)
            records = []
            now = time.time()
            if channel.ended:  # the agent was killed: there will be no decision any more
                if self._answerer is not None:
                    self._answerer.stop(now)
                return
            due = math.inf
            if self._answerer is not None:
                self._answerer.tick(now)
                due = self._answerer.due
            channel.flush()
            wait = min(max(due - now, 0.0), _LONGEST_WAIT)
            leaving = [channel.fileno()] if channel.is_waiting else []
            select.select([link.fileno(), channel.fileno()], leaving, [], wait)

    def _obey(self, record: Register | Decision) -> None:
        if isinstance(record, Decision):
            actions = _decode(record.data)
            if actions is not None and self._answerer is not None:
                self._answerer.decide(record.time, actions, time.time())
        elif self._answerer is None:  # else it has crossed the acceptance: a second robot is not wanted
            self._channel.send(Registered(time.time()))
            try:
                self._link.register(record.data)
            except LinkError as error:
                self._channel.send(Fault(str(error)))

    def _hear(self) -> None:
        """Pass on what has come, and take it for what is to be answered."""
        arrivals = self._link.receive_arrivals()
        if not arrivals:
            return
        now = time.time()
        stamped = [one if one.time is not None else Arrival(one.data, now) for one in arrivals]
        if self._answerer is None and self._link.peer is not None:
            self._channel.send(Peer(*self._link.peer))
        self._channel.send(stamped)  # first, so that the agent can begin to think
        if self._answerer is None:
            stamped = self._begin_to_answer(stamped)
        if self._answerer is not None:
            self._answerer.take(stamped, now)

    def _begin_to_answer(self, arrivals: list[Arrival]) -> list[Arrival]:
        """Look for the acceptance; return what came behind it."""
        begin = self._begin
        for number, arrival in enumerate(arrivals):
            try:
                message = decode_simulator_message(arrival.data)
            except ProtocolError:
                continue  # the agent complains of it
            if isinstance(message, Acceptance):
                setup = AnswererSetup(
                    parameters=message.parameters,
                    lockstep=message.lockstep,
                    angles=begin.angles,
                    cruise=begin.cruise,
                    roams=begin.roams,
                )
                self._answerer = Answerer(setup, self._send, self._channel.send)
                return arrivals[number + 1 :]
        return []

    def _send(self, data: bytes) -> None:
        try:
            self._link.send(data)
        except LinkError as error:
            self._channel.send(Fault(str(error)))


def _decode(data: bytes) -> Actions | None:
    try:
        return decode_actions(data)
    except ProtocolError:
        return None


def main() -> None:
    """Run the process; its channel's number is the last argument."""
    ask_for_short_slices()
    sock = inherited_channel(int(sys.argv[-1]))
    with sock:
        handed = receive_socket(sock)
        if handed is None:
            return  # there will be no run
        channel = Channel(sock)
        records: list[Any] = []
        while not records and not channel.ended:
            channel.wait(_LONGEST_WAIT)
            records = channel.receive()
        if not records:
            handed.close()
            return
        begin, *more = records
        gc.collect()
        gc.freeze()
        link = UdpLink.handed_over(handed, begin.host, begin.port)
        try:
            Service(channel, link, begin).serve(more)
        finally:
            link.close()


if __name__ == "__main__":
    main()
