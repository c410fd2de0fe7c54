"""Corners that leave the cone of one sensor and are in none: what the bumper remembers of them."""

from __future__ import annotations

import math

import pytest

from agent.drives.safety import Bumper

ANGLES = (0.0, 60.0, -60.0, 180.0)
HALT = 2.2
"""Reading ahead at which a robot stops."""
FREE = 0.5


def bumper(noise: float = 0.1) -> Bumper:
    return Bumper(ANGLES, noise, remembers=True)


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_wall_along_the_edge_of_the_cone_does_not_stay_as_far_as_it_was(noise: float) -> None:
    """A wall beside the path at less than half a robot's width reads the same while its end comes nearer."""
    ahead = bumper(noise)
    ahead.observe((1.5, FREE, FREE, FREE))
    driven = 0.0
    while ahead.ahead < HALT:
        ahead.move(0.06, 0.0)
        driven += 0.06
        ahead.observe((1.5, FREE, FREE, FREE))
        # Of 0.67 units none may be driven that would not stop the robot before the last tenth of a unit.
        assert driven < 0.57
    assert driven > 0.05


@pytest.mark.parametrize("error", [-0.1, 0.1])
def test_noise_alone_brings_no_wall_nearer(error: float) -> None:
    """What stands still before a robot that stands still is remembered at its distance, noise apart."""
    still = bumper()
    for number in range(200):
        still.observe((1.5 + error * (-1) ** number, FREE, FREE, FREE))
    assert 1.35 < still.ahead < 1.75


@pytest.mark.parametrize("side", [1, -1])
def test_what_leaves_a_side_cone_towards_the_front_and_is_not_seen_there_is_ahead(side: int) -> None:
    def turn_towards_it(to_it: int, front: float) -> float:
        turning = bumper()
        for reading in (1.7, 1.4, 0.5):
            beside = (reading, FREE) if side > 0 else (FREE, reading)
            turning.observe((front if reading < 1.0 else FREE, *beside, FREE))
            turning.move(0.0, to_it * side * math.radians(12.0))
        return turning.ahead

    assert turn_towards_it(1, FREE) == pytest.approx(1.5, abs=0.3)
    assert turn_towards_it(-1, FREE) == FREE  # it has left to the rear
    assert turn_towards_it(1, 1.6) == pytest.approx(1.6)  # seen ahead


def test_a_hidden_corner_is_forgotten_when_the_robot_has_turned_on() -> None:
    turning = bumper()
    for reading in (1.7, 1.4, *(0.5,) * 5):
        turning.observe((FREE, reading, FREE, FREE))
        turning.move(0.0, math.radians(12.0))
    assert turning.ahead == FREE
