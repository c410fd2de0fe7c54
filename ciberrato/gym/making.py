"""Parts of single and vector environments alike: task, scenario, spaces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypedDict, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ciberrato.errors import UsageError, did_you_mean
from ciberrato.gym.localize import Localize
from ciberrato.gym.scenario import Scenario, Start
from ciberrato.gym.tasks import Circuit, Navigate, Task
from ciberrato.physics.kinematics import MAX_POWER
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters

TASKS: dict[str, type[Task]] = {"navigate": Navigate, "localize": Localize, "circuit": Circuit}
TIME_LIMIT = 1800
FRAMES_PER_SECOND = 20
"""A cycle lasts 50 ms in the real simulator."""


class Choices(TypedDict, total=False):
    """Choices from which episodes are drawn; see `ciberrato.gym.scenario.Scenario`."""

    labs: str | Lab | Sequence[str | Lab]
    starts: str | Sequence[Start]
    noise: float | tuple[float, float]
    parameters: Parameters
    time_limit: int


def make_task(name: str, worlds: int, choices: Choices) -> tuple[Scenario, Task]:
    """Create the scenario and the task of an environment.

    Raises
    ------
    UsageError
        There is no such task, or an option cannot be used.
    """
    if isinstance(worlds, bool) or not isinstance(worlds, int | np.integer) or worlds < 1:
        raise UsageError(f"num_envs: {worlds!r:.60} is no positive number of environments")
    if name not in TASKS:
        meant = did_you_mean(name, list(TASKS))
        raise UsageError(f"unknown task {name!r}; choose one of {', '.join(TASKS)}{meant}")
    unknown = set(choices) - set(Choices.__annotations__)
    if unknown:
        known = ", ".join(Choices.__annotations__)
        meant = did_you_mean(min(unknown), list(Choices.__annotations__))
        raise UsageError(f"no option {', '.join(sorted(unknown))}: there are {known}{meant}")
    kind = TASKS[name]
    scenario = Scenario(
        choices.get("labs", kind.labs),
        choices.get("starts", kind.starts),
        choices.get("noise", 1.0),
        Parameters() if choices.get("parameters") is None else choices["parameters"],
        choices.get("time_limit", TIME_LIMIT),
    )
    return scenario, kind(scenario, worlds)


def observation_space(task: Task) -> spaces.Space[NDArray[np.float32]]:
    """Return the space of one observation."""
    columns = task.columns()
    low = np.array([column.low for column in columns], np.float32)
    high = np.array([column.high for column in columns], np.float32)
    return cast(spaces.Space[NDArray[np.float32]], spaces.Box(low, high, dtype=np.float32))


def action_space() -> spaces.Space[NDArray[np.float32]]:
    """Return the space of one action: powers of the left and right motors, in shares of the greatest."""
    return cast(spaces.Space[NDArray[np.float32]], spaces.Box(-1.0, 1.0, (2,), np.float32))


def powers(actions: object, shape: tuple[int, ...]) -> np.ndarray:
    """Convert actions to motor commands in units per cycle; actions beyond ±1 are clamped.

    Raises
    ------
    ValueError
        The shape is another one, or an action is no number.
    """
    wanted = np.asarray(actions, np.float64)
    if wanted.shape != shape:
        raise ValueError(f"actions must have the shape {shape}: {wanted.shape}")
    if np.isnan(wanted).any():
        raise ValueError("an action must be numbers, not NaN")
    return np.asarray(np.clip(wanted, -1.0, 1.0) * MAX_POWER)
