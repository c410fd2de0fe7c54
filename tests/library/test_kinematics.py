from __future__ import annotations

import math

import numpy as np
import pytest

from ciberrato.physics.kinematics import MAX_POWER, advance, clamp_power, filter_power, wrap_angle


@pytest.mark.parametrize(
    ("command", "power"),
    [(0.1, 0.1), (0.15, 0.15), (0.151, 0.15), (-9.0, -0.15), (math.inf, 0.15), (-math.inf, -0.15)],
)
def test_clamp(command, power):
    assert clamp_power(command) == power
    np.testing.assert_array_equal(clamp_power(np.array([command])), [power])


def test_filter_goes_half_way_each_cycle():
    power, powers = 0.0, []
    for _ in range(3):
        power = filter_power(0.1, power)
        powers.append(power)
    assert powers == pytest.approx([0.05, 0.075, 0.0875], rel=1e-15)


def test_filter_remembers_the_noise():
    first = filter_power(0.1, 0.0, 1.02)
    assert first == pytest.approx(0.051)
    assert filter_power(0.1, first, 0.99) == pytest.approx((0.1 + 0.051) / 2 * 0.99)


def test_published_check_of_the_pose_update():
    """Commands 0.05 and 0.15 from rest at (9, 3): the real simulator showed these three poses."""
    pose, left, right = (9.0, 3.0, 0.0), 0.0, 0.0
    shown = []
    for _ in range(3):
        left, right = filter_power(0.05, left), filter_power(0.15, right)
        pose = advance(*pose, left, right)
        shown.append(tuple(f"{value:g}" for value in (pose[0], pose[1], math.degrees(pose[2]))))
    assert shown == [
        ("9.05", "3", "2.86479"),
        ("9.12491", "3.00375", "7.16197"),
        ("9.21172", "3.01466", "12.1754"),
    ]


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [
        (math.pi, math.pi),
        (-math.pi, -math.pi),
        (math.pi + 0.5, -math.pi + 0.5),
        (-math.pi - 0.5, math.pi - 0.5),
        (5 * math.pi, 3 * math.pi),
        (0.25, 0.25),
    ],
)
def test_wrap_takes_at_most_one_turn_off(angle, wrapped):
    assert wrap_angle(angle) == pytest.approx(wrapped, abs=1e-12)
    np.testing.assert_array_equal(wrap_angle(np.array([angle])), [wrap_angle(angle)])


def test_arrays_and_numbers_agree(rng):
    x, y, heading = rng.uniform(-3, 3, (3, 500))
    left, right = rng.uniform(-MAX_POWER, MAX_POWER, (2, 500))
    together = np.array(advance(x, y, heading, left, right))
    single = np.array(
        [advance(*map(float, robot)) for robot in zip(x, y, heading, left, right, strict=True)]
    ).T
    np.testing.assert_allclose(together, single, rtol=0, atol=1e-15)
