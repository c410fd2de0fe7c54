"""Learn to drive round a circuit: the cross-entropy method on ``ciberrato/Circuit-v0``, with numpy alone.

Every generation draws policies around a mean, lets each drive in some worlds, all at once, and moves the mean
to the best ones (Rubinstein & Kroese, *The Cross-Entropy Method*, chapter 4; a floor under the deviation
keeps it from settling too soon). ``python -m examples.learn FOLDER`` writes ``learn-circuit.png``.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ciberrato.arrays import Floats
from examples.figures import panels, save

HIDDEN = 6
SEES = 8
"""Numbers that a policy sees: four IR readings, the collision, its own last action, and a one."""
WEIGHTS = HIDDEN * SEES + 2 * (HIDDEN + 1)
NEAR = 3.0
"""IR reading in 1/units from which on a wall is as near as can be."""


class Learning(NamedTuple):
    """Outcome of learning.

    Attributes
    ----------
    mean : array, shape (WEIGHTS,)
        Weights of the last mean policy.
    rewards : array, shape (generations, policies)
        Mean return of an episode, of each policy of each generation.
    """

    mean: Floats
    rewards: Floats


def act(weights: Floats, observations: NDArray[np.float32], last: Floats) -> Floats:
    """Compute the policies' actions: one hidden layer of tanh.

    Parameters
    ----------
    weights : array, shape (n, WEIGHTS)
    observations : array of float32, shape (n, 7)
        As the environment gives them; the compass is not looked at.
    last : array, shape (n, 2)
        Their last actions.

    Returns
    -------
    array, shape (n, 2)
        Shares of the greatest power of the left and right motors.
    """
    walls = np.clip(observations[:, :4], 0.0, NEAR) / NEAR
    seen = np.concatenate((walls, observations[:, 6:7], last, np.ones((len(last), 1))), axis=1)
    first = weights[:, : HIDDEN * SEES].reshape(-1, HIDDEN, SEES)
    second = weights[:, HIDDEN * SEES :].reshape(-1, 2, HIDDEN + 1)
    hidden = np.tanh(np.einsum("nhs,ns->nh", first, seen))
    return np.asarray(np.tanh(np.einsum("nah,nh->na", second[:, :, :HIDDEN], hidden) + second[:, :, HIDDEN]))


def episode(envs: Any, weights: Floats, seed: int, track: list[Floats] | None = None) -> Floats:
    """Run an episode with each policy; return the rewards, shape (n,)."""
    observations, _ = envs.reset(seed=seed)
    total, last = np.zeros(len(weights)), np.zeros((len(weights), 2))
    over = False
    while not over:
        last = act(weights, observations, last)
        observations, rewards, _, truncations, _ = envs.step(last.astype(np.float32))
        total += rewards
        over = bool(truncations.all())
        if track is not None:
            track.append(envs.unwrapped.poses())
    return total


def learn(
    *,
    generations: int = 50,
    policies: int = 96,
    episodes: int = 4,
    steps: int = 500,
    seed: int = 1,
    floor: float = 0.1,
) -> Learning:
    """Learn a policy, in the lab `corridors`, from all cells that a circuit begins in.

    Parameters
    ----------
    generations, policies, episodes, steps : int
        Numbers of generations, of policies, of worlds for each policy, and of cycles of an episode.
    seed : int
    floor : float
        Least standard deviation of a weight.

    Returns
    -------
    Learning
        The same for the same arguments.
    """
    from ciberrato.gym import CiberRatoVectorEnv

    envs = CiberRatoVectorEnv("circuit", policies * episodes, time_limit=steps, autoreset_mode="Disabled")
    generator = np.random.default_rng(seed)
    mean, deviation = np.zeros(WEIGHTS), np.ones(WEIGHTS)
    history = []
    for generation in range(generations):
        drawn = mean + deviation * generator.standard_normal((policies, WEIGHTS))
        tried = episode(envs, np.repeat(drawn, episodes, axis=0), seed=10**4 * seed + 1000 * generation)
        rewards = tried.reshape(policies, episodes).mean(axis=1)
        best = drawn[np.argsort(rewards)[-policies // 8 :]]
        mean, deviation = best.mean(axis=0), np.maximum(best.std(axis=0), floor)
        history.append(rewards)
    envs.close()
    return Learning(mean, np.array(history))


def judge(mean: Floats, *, episodes: int = 64, steps: int = 500) -> tuple[Floats, Floats]:
    """Evaluate the mean policy on other seeds.

    Returns
    -------
    rewards : array, shape (episodes,)
    poses : array, shape (steps, 3)
        Of the first episode: x, y in units and heading in radians.
    """
    from ciberrato.gym import CiberRatoVectorEnv

    envs = CiberRatoVectorEnv("circuit", episodes, time_limit=steps, autoreset_mode="Disabled")
    track: list[Floats] = []
    rewards = episode(envs, np.tile(mean, (episodes, 1)), seed=10**6, track=track)
    return rewards, np.array(track)[:, 0]


def draw(learning: Learning, poses: Floats, path: Path) -> Path:
    """Draw how the rewards rose, and where the last policy drove."""
    from ciberrato.files.lab import read_lab
    from ciberrato.gym.picture import Picture
    from ciberrato.labs import find_lab

    figure, axes = panels(1, 2, (12.0, 3.6))
    curve, lab = axes[0]
    generations = np.arange(1, len(learning.rewards) + 1)
    low, middle, high = np.percentile(learning.rewards, (10, 50, 90), axis=1)
    curve.fill_between(generations, low, high, color="#56B4E9", alpha=0.4, label="10 to 90 % of the policies")
    curve.plot(generations, middle, color="#0072B2", label="median")
    curve.plot(generations, learning.rewards.max(axis=1), color="#D55E00", label="best")
    curve.set(xlabel="generation", ylabel="reward of an episode\n(cells of the circuit)")
    curve.legend(loc="lower right", frameon=False)
    corridors = read_lab(find_lab("corridors"))
    lab.imshow(Picture(corridors).draw(poses[-1]), extent=(-0.25, 28.25, -0.25, 14.25))
    lab.plot(poses[:, 0], poses[:, 1], color="#D55E00", linewidth=1.2)
    lab.plot(*poses[0, :2], "o", color="#D55E00")
    lab.set(xlabel="x in units", ylabel="y in units", title="an episode of the mean policy after that")
    return save(figure, path)


def main(arguments: Sequence[str] | None = None) -> int:
    """Learn, print the results, and draw the figure."""
    folder = Path((sys.argv[1:] if arguments is None else list(arguments) or ["build/figures"])[0])
    folder.mkdir(parents=True, exist_ok=True)
    learning = learn()
    for generation in (0, 4, 9, 19, len(learning.rewards) - 1):
        rewards = learning.rewards[generation]
        print(f"generation {generation + 1:2}: mean {rewards.mean():5.1f}, best {rewards.max():5.1f}")
    rewards, poses = judge(learning.mean)
    print(f"mean policy, other seeds: {rewards.mean():.1f} cells in an episode of {len(poses)} cycles")
    print(f"wrote {draw(learning, poses, folder / 'learn-circuit.png')}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
