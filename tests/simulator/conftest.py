from __future__ import annotations

from pathlib import Path

import pytest

from ciberrato.world.lab import Lab, Target
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.service.transports import Newcomer, Peer

REPOSITORY = Path(__file__).parents[2]

QUIET = Parameters(
    compass_noise=0.0,
    obstacle_noise=0.0,
    motors_noise=0.0,
    beacon_noise=0.0,
    gps_linear_noise=0.0,
    line_sensor_true_probability=1.0,
)


@pytest.fixture
def quiet() -> Parameters:
    """Parameters without any noise."""
    return QUIET


@pytest.fixture
def open_lab() -> Lab:
    """A lab of 20 x 10 without walls; target 1 lies inside target 0."""
    return Lab(
        name="open",
        width=20.0,
        height=10.0,
        targets=(Target(x=15.0, y=5.0, radius=2.0), Target(x=15.5, y=5.0, radius=1.0)),
    )


@pytest.fixture
def three_places() -> StartGrid:
    return StartGrid(
        positions=(
            GridPosition(x=3.0, y=5.0),
            GridPosition(x=8.0, y=5.0, direction_deg=90.0),
            GridPosition(x=12.0, y=5.0, direction_deg=225.0),
        )
    )


class FakePeer(Peer):
    """A client that keeps what it is sent."""

    def __init__(self) -> None:
        super().__init__("fake")
        self.received: list[bytes] = []

    def send(self, data: bytes) -> None:
        if not self.closed:
            self.received.append(data)

    def close(self) -> None:
        self.closed = True


class FakeNewcomer(Newcomer):
    def __init__(self) -> None:
        self.label = "fake"
        self.peer = FakePeer()

    def accept(self) -> Peer:
        return self.peer


@pytest.fixture
def newcomer() -> type[FakeNewcomer]:
    return FakeNewcomer
