"""Many environments are, step by step, what Gymnasium's loop over single ones is."""

from __future__ import annotations

import importlib.util
from typing import Any

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.vector import AutoresetMode, SyncVectorEnv  # noqa: E402

from ciberrato.gym import CiberRatoEnv, CiberRatoVectorEnv  # noqa: E402
from ciberrato.world.lab import Lab, Target  # noqa: E402
from simulator_stub.batch.simulation import FEW  # noqa: E402

NUMBA = importlib.util.find_spec("numba") is not None
MODES = [
    pytest.param(AutoresetMode.NEXT_STEP, NUMBA, id="next step"),
    pytest.param(AutoresetMode.SAME_STEP, False, id="same step"),
    pytest.param(AutoresetMode.DISABLED, NUMBA, id="disabled"),
]
# Targets all about, so that robots that drive about visit them, signal, and come home.
PARK = Lab(
    name="park",
    width=10.0,
    height=8.0,
    targets=(Target(x=3.0, y=4.0, radius=3.0), Target(x=7.5, y=4.0, radius=2.5)),
)


def equal(one: Any, other: Any) -> bool:
    """Whether nested infos are the same, types included."""
    if isinstance(one, dict):
        return set(one) == set(other) and all(equal(one[key], other[key]) for key in one)
    if isinstance(one, np.ndarray) and one.dtype == object:
        pairs = zip(one, other, strict=True)
        return all((a is None and b is None) or np.array_equal(a, b) for a, b in pairs)
    return one.dtype == other.dtype and np.array_equal(one, other)


def actions_at(generator: np.random.Generator, step: int, worlds: int) -> np.ndarray:
    """Drive to and fro, nearly straight, so that robots come home and bump into walls."""
    ahead = 0.9 if step // 70 % 2 == 0 else -0.9
    speed = ahead + generator.normal(0.0, 0.1, (worlds, 1))
    return np.clip(speed + generator.normal(0.0, 0.01, (worlds, 2)), -1.0, 1.0).astype(np.float32)


def assert_equal_steps(
    task: str, mode: AutoresetMode, steps: int, worlds: int = 3, *, compiled: bool, **options: Any
) -> dict[str, int]:
    """Step both; count what happened."""
    many = CiberRatoVectorEnv(task, worlds, autoreset_mode=mode, compiled=compiled, threads=2, **options)
    loop = SyncVectorEnv([lambda: CiberRatoEnv(task, **options) for _ in range(worlds)], autoreset_mode=mode)
    assert many.metadata["autoreset_mode"] is mode
    for name in ("observation_space", "action_space", "single_observation_space", "single_action_space"):
        assert getattr(many, name) == getattr(loop, name)
    seeds = [11, 5, 7, *range(1, worlds - 2)][:worlds]
    first, second = many.reset(seed=seeds), loop.reset(seed=seeds)
    assert np.array_equal(first[0], second[0])
    assert equal(first[1], second[1])
    assert many.np_random_seed == loop.np_random_seed
    generator = np.random.default_rng(3)
    counts = {"terminated": 0, "truncated": 0, "success": 0}
    actions = actions_at(generator, 0, worlds)
    for step in range(steps):
        if step % 5 == 0:
            actions = actions_at(generator, step, worlds)
        first, second = many.step(actions), loop.step(actions)
        for index in range(4):
            assert np.array_equal(first[index], second[index]), (step, index)
            assert first[index].dtype == second[index].dtype
        assert equal(first[4], second[4]), step
        counts["terminated"] += int(first[2].sum())
        counts["truncated"] += int(first[3].sum())
        counts["success"] += int(first[4].get("final_info", first[4])["success"].sum())
        done = first[2] | first[3]
        by_hand = mode is AutoresetMode.DISABLED and done.any()
        if by_hand or step % 997 == 996:
            mask = done if done.any() else np.arange(worlds) == step % worlds
            given = [step + world if world % 2 else None for world in range(worlds)]
            first = many.reset(seed=given, options={"reset_mask": mask.copy()})
            second = loop.reset(seed=given, options={"reset_mask": mask.copy()})
            assert np.array_equal(first[0], second[0]), step
            assert equal(first[1], second[1]), step
    many.close()
    loop.close()
    return counts


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "compiled"), MODES)
def test_navigate_over_ten_thousand_steps(mode: AutoresetMode, compiled: bool) -> None:
    counts = assert_equal_steps(
        "navigate",
        mode,
        10_000,
        compiled=compiled,
        labs=[PARK, "maze"],
        starts=[(3.0, 3.0, 0.0), (1.0, 1.0, 90.0)],
        noise=(0.0, 2.0),
        time_limit=211,
    )
    assert counts["terminated"] > 10
    assert counts["truncated"] > 10
    assert counts["success"] > 10


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "compiled"), MODES)
def test_circuit_over_ten_thousand_steps(mode: AutoresetMode, compiled: bool) -> None:
    counts = assert_equal_steps(
        "circuit",
        mode,
        10_000,
        compiled=compiled,
        labs=["corridors", "rooms"],
        noise=(0.5, 1.5),
        time_limit=150,
    )
    assert counts["truncated"] > 10


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "compiled"), MODES)
def test_localize(mode: AutoresetMode, compiled: bool) -> None:
    counts = assert_equal_steps(
        "localize", mode, 240, 2, compiled=compiled, labs=["maze", "rooms"], time_limit=60
    )
    assert counts["terminated"] + counts["truncated"] > 3


@pytest.mark.slow
def test_more_worlds_than_are_stepped_one_by_one() -> None:
    counts = assert_equal_steps(
        "navigate",
        AutoresetMode.NEXT_STEP,
        150,
        FEW + 3,
        compiled=False,
        labs=[PARK, "maze"],
        starts=[(3.0, 3.0, 0.0), (1.0, 1.0, 90.0)],
        noise=(0.0, 2.0),
        time_limit=60,
    )
    assert counts["truncated"] > 2 * FEW


def test_many_worlds_in_a_few_steps() -> None:
    assert_equal_steps(
        "navigate", AutoresetMode.NEXT_STEP, 60, 7, compiled=False, time_limit=25, starts="free"
    )


def test_one_seed_counts_on() -> None:
    many = CiberRatoVectorEnv(num_envs=3, compiled=False, starts="free")
    first, _ = many.reset(seed=5)
    second, _ = many.reset(seed=[5, 6, 7])
    assert np.array_equal(first, second)
    assert many.np_random_seed == (5, 6, 7)
    assert not np.array_equal(first, many.reset()[0])


def test_what_cannot_be_done_is_refused() -> None:
    many = CiberRatoVectorEnv(num_envs=2, autoreset_mode="Disabled", compiled=False, time_limit=2)
    none = np.zeros((2, 2), np.float32)
    with pytest.raises(gymnasium.error.ResetNeeded, match="before step"):
        many.step(none)
    with pytest.raises(gymnasium.error.ResetNeeded, match="first reset must be of all"):
        many.reset(options={"reset_mask": np.array([True, False])})
    many.reset(seed=1)
    with pytest.raises(ValueError, match="2 seeds"):
        many.reset(seed=[1])
    for mask, kind in (
        ([True, False], TypeError),
        (np.ones(3, bool), ValueError),
        (np.zeros(2, bool), ValueError),
    ):
        with pytest.raises(kind, match="reset_mask"):
            many.reset(options={"reset_mask": mask})
    many.step(none)
    assert many.step(none)[3].all()
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"environments \[0, 1\] are done"):
        many.step(none)
    with pytest.raises(ValueError, match="render_mode 'human'"):
        CiberRatoVectorEnv(render_mode="human")


def test_make_vec_and_pictures() -> None:
    many = gymnasium.make_vec(
        "ciberrato/Navigate-v0",
        num_envs=2,
        vectorization_mode="vector_entry_point",
        render_mode="rgb_array",
        compiled=False,
    )
    many.reset(seed=1)
    pictures = many.render()
    assert len(pictures) == 2
    assert pictures[0].dtype == np.uint8
    many.close()
