"""Differences between Linux, macOS and Windows, and the substitutes where something is missing.

The programs ask here; no other room names a system, or a function that some system does not have. Each module
finds out what there is by looking for it, so that a system none of us has seen gets the plainest variant.
"""

from __future__ import annotations

__all__ = ["descendants", "limits", "locks", "loops", "memory", "process", "signals", "sockets", "streams"]
