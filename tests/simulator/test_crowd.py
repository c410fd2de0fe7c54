from __future__ import annotations

import pytest

from benchmarks.simulator_crowd import ROBOTS, crowd


@pytest.mark.slow
@pytest.mark.parametrize("transport", ["udp", "tcp"])
def test_twenty_robots_at_once_are_told_of_every_cycle(transport: str) -> None:
    run = crowd(transport, seconds=2.0)
    assert (run.cycles, run.missing) == (200, 0)
    assert run.wall > 1.9, "in real time"
    assert ROBOTS == 20
