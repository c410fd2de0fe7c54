"""Ways for messages to come and go, one module each. A new one is a new module and a line in `TRANSPORTS`."""

from __future__ import annotations

from simulator_stub.service.transports.base import NO_ROOM, Newcomer, Peer, Transport, Welcome
from simulator_stub.service.transports.tcp import TcpTransport
from simulator_stub.service.transports.udp import UdpTransport

__all__ = ["NO_ROOM", "TRANSPORTS", "Newcomer", "Peer", "Transport", "Welcome"]

TRANSPORTS: dict[str, type[Transport]] = {
    transport.name: transport for transport in (UdpTransport, TcpTransport)
}
"""By name. The first one chooses the port where any will do; the others take the same number."""
