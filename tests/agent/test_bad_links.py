"""The live agent on bad networks and busy machines, in virtual time: the same on every machine."""

from __future__ import annotations

import pytest

from benchmarks.bad_links import CONDITIONS, Outcome, run, summary

NAMED = {condition.name: condition for condition in CONDITIONS}


def drive(name: str, seed: int = 1) -> Outcome:
    return run(NAMED[name], "maze", "explore", seed, 240)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["loss 20%", "delay 150 ms", "cuts down 1.5 s", "stalls 200 ms"])
def test_no_collision_no_spinning_and_no_certain_wrong_pose(name: str) -> None:
    outcome = drive(name)
    found = summary([outcome])
    assert outcome.collisions <= 1
    assert outcome.turned < 1.5
    assert outcome.blind < 1.0
    assert found["poses wrong"] == 0.0
    assert found["right"] > 0.9


@pytest.mark.slow
def test_after_cuts_in_both_directions_what_is_said_with_certainty_is_right() -> None:
    outcome = drive("cuts 1.5 s")
    assert summary([outcome])["poses wrong"] == 0.0
    assert "30 of them in a row" in outcome.said or "31 of them in a row" in outcome.said
    assert "while nothing was heard" in outcome.said


def test_a_seed_is_one_run() -> None:
    first, second = (run(NAMED["jitter 100 ms"], "maze", "right", 3, 60) for _ in range(2))
    assert first == second
