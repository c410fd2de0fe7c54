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
    from ciberrato.lazy_names import load

    return load(globals(), _HOMES, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
