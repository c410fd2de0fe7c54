"""Environments of Gymnasium: ``ciberrato/Navigate-v0``, ``ciberrato/Localize-v0``, ``ciberrato/Circuit-v0``.

Importing this package registers them. Gymnasium (from 1.0 on) looks for no entry points, so either import it,
or let `gymnasium.make` do so: ``gymnasium.make("ciberrato.gym:ciberrato/Navigate-v0")``. Needs the extra
``gym``.
"""

from __future__ import annotations

from ciberrato.gym.registration import register_environments
from ciberrato.gym.single import CiberRatoEnv
from ciberrato.gym.vector import CiberRatoVectorEnv

__all__ = ["CiberRatoEnv", "CiberRatoVectorEnv", "register_environments"]

register_environments()
