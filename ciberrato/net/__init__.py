"""Client links over UDP and TCP: the only input and output in the library."""

from ciberrato.net.address import DEFAULT_PORT, parse_address
from ciberrato.net.link import Link, LinkClosedError, LinkError
from ciberrato.net.tcp import TcpLink
from ciberrato.net.udp import UdpLink

__all__ = [
    "DEFAULT_PORT",
    "Link",
    "LinkClosedError",
    "LinkError",
    "TcpLink",
    "UdpLink",
    "parse_address",
]
