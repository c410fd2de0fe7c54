"""Learning to drive round a circuit, in short."""

import numpy as np
import pytest

pytest.importorskip("gymnasium")

from examples import learn


@pytest.mark.slow
def test_rewards_rise_and_come_out_the_same(tmp_path):
    learning = learn.learn(generations=8, policies=48, episodes=1, steps=150)
    means = learning.rewards.mean(axis=1)
    assert means[-2:].mean() > means[:2].mean() + 1.0
    assert np.array_equal(
        learn.learn(generations=2, policies=48, episodes=1, steps=150).rewards, learning.rewards[:2]
    )
    rewards, poses = learn.judge(learning.mean, episodes=2, steps=20)
    assert rewards.shape == (2,)
    assert poses.shape == (20, 3)
    assert learn.draw(learning, poses, tmp_path / "learn.png").stat().st_size > 10_000


def test_policies_act_within_the_greatest_power_and_each_by_its_own_weights():
    generator = np.random.default_rng(1)
    weights = generator.normal(size=(5, learn.WEIGHTS))
    observations = generator.normal(1.0, 1.0, (5, 7)).astype(np.float32)
    last = generator.uniform(-1.0, 1.0, (5, 2))
    together = learn.act(weights, observations, last)
    assert np.abs(together).max() <= 1.0
    for one in range(5):
        alone = learn.act(weights[one : one + 1], observations[one : one + 1], last[one : one + 1])
        np.testing.assert_allclose(alone[0], together[one], rtol=1e-12)
