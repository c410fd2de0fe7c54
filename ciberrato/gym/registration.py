"""The names of the environments in Gymnasium's registry."""

from __future__ import annotations

import gymnasium

NAMES = {"Navigate": "navigate", "Localize": "localize", "Circuit": "circuit"}
"""Environments, and the tasks that they are."""


def register_environments() -> None:
    """Register the environments with Gymnasium, unless they are registered."""
    for name, task in NAMES.items():
        identity = f"ciberrato/{name}-v0"
        if identity not in gymnasium.registry:
            gymnasium.register(
                identity,
                entry_point="ciberrato.gym.single:CiberRatoEnv",
                vector_entry_point="ciberrato.gym.vector:CiberRatoVectorEnv",
                kwargs={"task": task},
            )
