"""A minute of the soak: `make chaos-long` and `python -m tests.chaos.soak` have more."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from tests.chaos.soak import AGENTS, soak, summary


@pytest.mark.slow
def test_agents_come_and_go_and_nothing_grows(tmp_path: Path) -> None:
    seen = asyncio.run(soak(60.0, 20.0, tmp_path))
    assert min(seen.registered) == AGENTS
    assert any(seen.left)
    assert seen.frames > 0
    assert "every file right" in summary(seen)
