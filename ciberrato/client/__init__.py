"""Clients for programs: `Robot`, and the same with ``async for``.

`Robot` and `AsyncRobot` share one core without input and output (`ciberrato.client.core`); they differ in
what carries the messages: a link, an asyncio loop, or a simulation in the same process.
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from ciberrato.client.async_robot import AsyncRobot
    from ciberrato.client.core import RunEnd
    from ciberrato.client.robot import Robot

_HOMES = {
    "AsyncRobot": "ciberrato.client.async_robot",
    "Robot": "ciberrato.client.robot",
    "RunEnd": "ciberrato.client.core",
}

__all__ = ["AsyncRobot", "Robot", "RunEnd"]


def __getattr__(name: str) -> object:
    """Load a name at its first use (PEP 562): who needs the pace alone has no use for asyncio."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import importlib

    value: object = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
