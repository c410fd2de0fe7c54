import socket
from collections.abc import Iterator

import pytest

from tests.ports import lasting_port

SECONDS = 300.0  # how long a test waits for what must come, so that a failure does not hang


@pytest.fixture
def udp_socket() -> Iterator[object]:
    """Make UDP sockets on loopback, on ports that are free."""
    opened = []

    def make(address: str = "127.0.0.1") -> socket.socket:
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        made.bind((address, 0))
        made.settimeout(SECONDS)
        opened.append(made)
        return made

    yield make
    for made in opened:
        made.close()


@pytest.fixture
def tcp_server() -> Iterator[socket.socket]:
    """Listen on loopback, on a port that is free."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(SECONDS)
        yield server


@pytest.fixture
def closed_port() -> int:
    """Name a port on which nobody listens."""
    return lasting_port()
