"""The benchmark of waking tells how long datagrams were under way, asleep and awake."""

from __future__ import annotations

import os

import pytest

from benchmarks.waking import latencies


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no such call on this system")
@pytest.mark.parametrize("awake", [False, True])
def test_latencies_are_of_all_datagrams_and_leave_the_processors_as_they_were(awake: bool) -> None:
    before = os.sched_getaffinity(0)
    times, share = latencies(awake=awake, pause=0.0, count=20)
    assert times.shape == (20,)
    assert (times > 0.0).all()
    assert 0.0 < share < 1.5
    assert os.sched_getaffinity(0) == before
