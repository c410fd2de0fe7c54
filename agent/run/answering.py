"""The process that answers for the agent: it has the link, and next to nothing to do.

A process that needs a fraction of a millisecond now and then is let in early, on however busy a machine; one
that computes waits for its turn. So the pose filter's process decides, and this one answers.
"""

from __future__ import annotations

import gc
import select
import sys
import time
from typing import Any

from agent.run.answerer import Answerer
from agent.run.channel import Channel
from agent.run.relay_records import Begin, Decision, End, Fault
from ciberrato.errors import ProtocolError
from ciberrato.net.link import Arrival, LinkError
from ciberrato.net.udp import UdpLink
from ciberrato.protocol import Actions, decode_actions
from ciberrato.system.process import ask_for_short_slices
from ciberrato.system.sockets import inherited_channel, receive_socket

_LONGEST_WAIT = 3600.0


def serve(channel: Channel, link: UdpLink, begin: Begin, records: list[Decision | End]) -> None:
    """Answer until the agent wants no more, or is gone.

    Parameters
    ----------
    channel : Channel
    link : UdpLink
    begin : Begin
    records : list of Decision or End
        Those that came right behind it.
    """

    def send(data: bytes) -> None:
        try:
            link.send(data)
        except LinkError as error:
            channel.send(Fault(str(error)))

    answerer = Answerer(begin.setup, send, channel.send)
    arrivals = [Arrival(data, time.time()) for data in begin.following]
    while True:
        arrivals += link.receive_arrivals()
        if arrivals:
            now = time.time()
            stamped = [one if one.time is not None else Arrival(one.data, now) for one in arrivals]
            channel.send(stamped)  # first, so that the agent can begin to think
            answerer.take(stamped, now)
            arrivals = []
        for record in [*records, *channel.receive()]:
            if isinstance(record, End):
                return
            actions = _decode(record.data)
            if actions is not None:
                answerer.decide(record.time, actions, time.time())
        records = []
        if channel.ended:  # the agent was killed: there will be no decision any more
            answerer.stop(time.time())
            return
        now = time.time()
        answerer.tick(now)
        channel.flush()
        wait = min(max(answerer.due - now, 0.0), _LONGEST_WAIT)
        leaving = [channel.fileno()] if channel.is_waiting else []
        select.select([link.fileno(), channel.fileno()], leaving, [], wait)


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
        link = UdpLink.handed_over(handed, begin.host, begin.port, begin.peer)
        try:
            serve(channel, link, begin, more)
        finally:
            link.close()


if __name__ == "__main__":
    main()
