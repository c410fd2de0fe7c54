"""Addresses of simulators."""

from __future__ import annotations

import socket

from ciberrato.errors import UsageError

DEFAULT_HOST = "127.0.0.1"
"""This machine."""
DEFAULT_PORT = 6000
"""The simulator's main port, over UDP and TCP, by default."""
TOKEN_VARIABLE = "CIBERRATO_VIEW_TOKEN"
"""Of the environment: what views show to a simulator, so that it need not stand in a command line."""


def parse_address(text: str, default_port: int = DEFAULT_PORT) -> tuple[str, int]:
    """Split ``HOST[:PORT]`` or ``:PORT``.

    Parameters
    ----------
    text : str
        A host name or an IPv4 address, and a port unless it is the usual one; without a host this machine.
    default_port : int

    Returns
    -------
    host : str
        Not looked up.
    port : int
        1 to 65535.

    Raises
    ------
    UsageError
        If it is no such thing; the message quotes it.
    """
    host, colon, port_text = text.strip().partition(":")
    if ":" in port_text:
        raise UsageError(
            f"address {text!r}: more than one colon; use HOST or HOST:PORT, with IPv4 addresses only"
        )
    host = host or DEFAULT_HOST * bool(port_text)
    if not host or any(character.isspace() for character in host):
        raise UsageError(f"address {text!r}: the host is missing or has blanks; use HOST, HOST:PORT or :PORT")
    if not colon:
        return host, default_port
    port = int(port_text) if port_text.isascii() and port_text.isdigit() and len(port_text) <= 5 else 0
    if not 1 <= port <= 65535:
        raise UsageError(f"address {text!r}: port {port_text!r} is not a number from 1 to 65535")
    return host, port


def resolve(host: str, port: int) -> tuple[str, int]:
    """Resolve a host name, once only.

    Parameters
    ----------
    host : str
        Name or IPv4 address; ``0.0.0.0`` means this machine.
    port : int

    Returns
    -------
    address : str
        In dotted form.
    port : int

    Raises
    ------
    UsageError
        If the name is not known, has no IPv4 address, or the port is out of range.
    """
    if not 1 <= port <= 65535:
        raise UsageError(f"port {port} is not from 1 to 65535")
    try:
        # A name given as text is looked up in tables of Unicode, which take a while to load.
        name = host.encode() if host.isascii() and host.replace(".", "").isdigit() else host
        found = socket.getaddrinfo(name, port, socket.AF_INET)
    except (OSError, ValueError) as error:  # ValueError: characters or lengths that no name has
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        raise UsageError(f"host {host!r} cannot be found: {reason}") from None
    address = str(found[0][4][0])
    return ("127.0.0.1" if address == "0.0.0.0" else address), port


def answers_for(sender: str, asked: str) -> bool:
    """Return whether a sender may answer for an address: 127.0.0.1 does for all of 127/8."""
    return sender == asked or (sender == "127.0.0.1" and asked.startswith("127."))
