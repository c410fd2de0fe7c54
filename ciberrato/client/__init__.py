"""Clients for programs: `Robot`, and the same with ``async for``.

`Robot` and `AsyncRobot` share one core without input and output (`ciberrato.client.core`); they differ in
what carries the messages: a link, an asyncio loop, or a simulation in the same process.
"""

from ciberrato.client.async_robot import AsyncRobot
from ciberrato.client.core import RunEnd
from ciberrato.client.robot import Robot

__all__ = ["AsyncRobot", "Robot", "RunEnd"]
