"""The Kalman filter: exact without noise, the textbook's covariance with it, mixtures by quadrature."""

import math

import numpy as np
import pytest

from agent.drives.right.row_ekf import Explanation, Pose, RowKalmanFilter
from ciberrato.physics.kinematics import advance, clamp_power, filter_power

COMMANDS = [(0.1, 0.1)] * 5 + [(0.05, 0.2), (-0.1, 0.1), (0.0, 0.0), (0.15, 0.13)] * 4


def test_without_noise_it_is_dead_reckoning_to_the_last_bit() -> None:
    pose_filter = RowKalmanFilter(0.0)
    x = y = heading = left = right = 0.0
    for command in COMMANDS:
        left, right = (filter_power(clamp_power(c), p) for c, p in zip(command, (left, right), strict=True))
        x, y, heading = advance(x, y, heading, left, right)
        pose_filter.move(command)
        assert pose_filter.pose() == Pose(x, y, heading)
        assert (pose_filter.left, pose_filter.right) == (left, right)
    assert pose_filter.deviations() == (0.0, 0.0, 0.0)
    pose_filter.correct([Explanation(1.0, 0.3, (0.0, 1.0, 1.0), 0.01)])
    assert pose_filter.pose() == Pose(x, y, heading)


def test_a_blocked_robot_turns_but_stays() -> None:
    pose_filter = RowKalmanFilter(1.5)
    pose_filter.move((0.0, 0.1), blocked=True)
    assert pose_filter.pose() == Pose(0.0, 0.0, 0.05)
    along, lateral, heading = pose_filter.deviations()
    assert along == 0.0
    assert lateral > 0.0
    assert heading == pytest.approx(0.03 * 0.05)


def test_the_predicted_spread_is_that_of_many_noisy_robots() -> None:
    generator = np.random.default_rng(1)
    count, noise = 4000, 1.5
    x, y, heading, left, right = np.zeros((5, count))
    pose_filter = RowKalmanFilter(noise)
    for _ in range(60):
        command = (0.1, 0.1)
        factors = 1.0 + noise / 100.0 * generator.standard_normal((2, count))
        left = filter_power(np.full(count, command[0]), left, factors[0])
        right = filter_power(np.full(count, command[1]), right, factors[1])
        x, y, heading = advance(x, y, heading, left, right)
        pose_filter.move(command)
    # The filter takes the noise of a cycle as twice itself at once: a little more than the truth, never less.
    for estimated, true in zip(pose_filter.deviations(), (x.std(), y.std(), heading.std()), strict=True):
        assert true < 1.05 * estimated
        assert estimated < 1.15 * true


def test_covariance_is_the_textbooks() -> None:
    pose_filter = RowKalmanFilter(5.0)
    pose_filter.place(Pose(0.0, 0.0, 0.4), (0.1, 0.2, 0.3))
    covariance = np.diag([0.1, 0.2, 0.3]) ** 2
    heading = 0.4
    for command in COMMANDS:
        pose_filter.move(command)
        left, right = pose_filter.left, pose_filter.right
        speed = (left + right) / 2.0
        transition = np.array(
            [[1, 0, -speed * math.sin(heading)], [0, 1, speed * math.cos(heading)], [0, 0, 1]]
        )
        # Columns: derivative of the pose by the power of either wheel.
        wheels = np.array([[math.cos(heading) / 2] * 2, [math.sin(heading) / 2] * 2, [-1.0, 1.0]])
        powers = np.diag([left**2, right**2]) * 0.1**2
        covariance = transition @ covariance @ transition.T + wheels @ powers @ wheels.T
        heading = pose_filter.pose().heading
        np.testing.assert_allclose(pose_filter.covariance, covariance, atol=1e-15)


def test_one_explanation_is_a_kalman_update() -> None:
    pose_filter = RowKalmanFilter(1.5)
    pose_filter.place(Pose(1.0, 0.1, 0.05), (0.1, 0.05, 0.02))
    for _ in range(5):
        pose_filter.move((0.1, 0.09))
    before, mean = np.array(pose_filter.covariance), pose_filter.pose()
    slope, variance, innovation = np.array([0.3, -1.0, 0.2]), 0.01, 0.07
    pose_filter.correct([Explanation(1.0, innovation, (0.3, -1.0, 0.2), variance)])
    gain = before @ slope / (slope @ before @ slope + variance)
    after = (np.eye(3) - np.outer(gain, slope)) @ before
    np.testing.assert_allclose(pose_filter.covariance, after, atol=1e-15)
    pose = pose_filter.pose()
    expected = np.array([mean.along, mean.lateral, mean.heading]) + gain * innovation
    np.testing.assert_allclose([pose.along, pose.lateral, pose.heading], expected, atol=1e-15)


@pytest.mark.parametrize("reading", [0.38, 0.44, 0.52, 0.9])
def test_several_explanations_give_the_moments_of_the_posterior(reading: float) -> None:
    # A wall at 0.9 or at 1.0 to the left, or neither: the posterior, by summing over a grid.
    priors, offsets, variance, clutter = (0.6, 0.2), (0.9, 1.0), 0.02**2, 0.3
    pose_filter = RowKalmanFilter(1.5)
    pose_filter.place(Pose(0.0, 0.02, 0.0), (0.0, 0.04, 0.0))
    pose_filter.correct(
        [
            Explanation(prior, reading - (offset - 0.02 - 0.5), (0.0, -1.0, 0.0), variance)
            for prior, offset in zip(priors, offsets, strict=True)
        ],
        clutter,
    )
    lateral = np.linspace(-0.4, 0.4, 80_001)
    density = np.exp(-0.5 * ((lateral - 0.02) / 0.04) ** 2)
    likelihood = np.full_like(lateral, clutter)
    for prior, offset in zip(priors, offsets, strict=True):
        miss = reading - (offset - lateral - 0.5)
        likelihood += prior * np.exp(-0.5 * miss**2 / variance) / math.sqrt(2 * math.pi * variance)
    density *= likelihood
    density /= density.sum()
    mean = (density * lateral).sum()
    assert pose_filter.pose().lateral == pytest.approx(mean, abs=1e-9)
    deviation = math.sqrt((density * (lateral - mean) ** 2).sum())
    assert pose_filter.deviations()[1] == pytest.approx(deviation, rel=1e-6)


def test_an_impossible_reading_changes_nothing() -> None:
    pose_filter = RowKalmanFilter(1.5)
    pose_filter.place(Pose(), (0.0, 0.01, 0.0))
    pose_filter.correct([Explanation(1.0, 1e6, (0.0, 1.0, 0.0), 1e-6)])
    pose_filter.correct([])
    assert pose_filter.pose() == Pose()
    assert pose_filter.deviations() == (0.0, 0.01, 0.0)


def test_old_poses_are_kept_and_corrected() -> None:
    pose_filter = RowKalmanFilter(1.5, memory=2)
    pose_filter.place(Pose(), (0.0, 0.1, 0.0))
    for _ in range(3):
        pose_filter.move((0.1, 0.1))
    assert [round(pose_filter.pose(age).along, 4) for age in (0, 1, 2, 3)] == [0.2125, 0.125, 0.05, 0.05]
    pose_filter.correct([Explanation(1.0, 0.1, (0.0, 1.0, 0.0), 0.01)])
    assert [round(pose_filter.pose(age).lateral, 3) for age in (0, 1, 2)] == [0.05, 0.05, 0.05]
    pose_filter.stand()
    assert pose_filter.pose(1) == pose_filter.pose(0)
