"""`AsyncRobot`: `ciberrato.client.Robot` for programs that run in an asyncio loop."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ciberrato.client.channel import Attempts, LinkChannel, check_seconds
from ciberrato.client.controls import Controls
from ciberrato.client.core import RobotCore
from ciberrato.client.run_recorder import RunRecorder
from ciberrato.net.link import LinkError
from ciberrato.protocol import Acceptance, encode
from ciberrato.system.loops import readable

if TYPE_CHECKING:
    from ciberrato.protocol.messages import Measures
    from ciberrato.world.lab import Lab


class AsyncRobot(Controls):
    """A robot whose loop is ``async for``; it registers in ``async with``.

    Parameters
    ----------
    name, host, position, angles, transport, log, localize, every_cycle, timeout, give_up_after
        As for `ciberrato.client.Robot`.

    Examples
    --------
    ::

        async with AsyncRobot("r2", host="localhost:6000") as robot:
            async for measures in robot:
                robot.drive(0.1, 0.1)
    """

    def __init__(
        self,
        name: str = "robot",
        host: str = "localhost:6000",
        *,
        position: int = 0,
        angles: Iterable[float] | None = None,
        transport: Literal["udp", "tcp"] = "udp",
        log: str | Path | None = None,
        localize: Lab | str | Path | None = None,
        every_cycle: bool = False,
        timeout: float = 2.0,
        give_up_after: float = 10.0,
    ) -> None:
        check_seconds("timeout", timeout)
        check_seconds("give_up_after", give_up_after)
        core = RobotCore(name, position=position, angles=angles, every_cycle=every_cycle)
        recorder = RunRecorder(log, localize)
        self._link_channel = LinkChannel(host, transport)
        super().__init__(core, self._link_channel, recorder, timeout)
        self._give_up_after = give_up_after

    async def __aenter__(self) -> AsyncRobot:
        try:
            self._begin(await self._register())
        except BaseException:
            self._abandon()
            raise
        return self

    async def __aexit__(self, *_: object) -> None:
        self.close()

    def __aiter__(self) -> AsyncIterator[Measures]:
        return self

    async def __anext__(self) -> Measures:
        """Answer the last Measures and wait for the next ones; see `ciberrato.client.Robot`."""
        self._answer()
        while self._goes_on:
            shown = self._take(await self._receive())
            if shown is not None:
                return shown
        raise StopAsyncIteration

    async def _register(self) -> Acceptance:
        channel, registration = self._link_channel, self._core.registration
        attempts = Attempts(self._give_up_after)
        channel.refused = False
        while not attempts.over(now := time.monotonic()):
            if attempts.due(now) and not channel.refused:
                channel.link.register(encode(registration))
            try:
                for data in channel.link.receive_waiting():
                    answer = channel.read_answer(data, attempts)
                    if answer is not None:
                        return answer
            except LinkError:  # no simulator is there yet
                await asyncio.sleep(attempts.patience(time.monotonic()))
                continue
            await self._readable(attempts.patience(time.monotonic()))
        raise channel.no_answer(registration, self._give_up_after)

    async def _receive(self) -> list[Measures]:
        """Wait for Measures; return all that are there, oldest first, or none if none came in time."""
        deadline = time.monotonic() + self._patience
        while True:
            found = self._link_channel.measures_in(self._link_channel.link.receive_waiting())
            remaining = deadline - time.monotonic()
            if found or remaining <= 0:
                return found
            await self._readable(remaining)

    async def _readable(self, seconds: float) -> None:
        """Wait until something has arrived, or for some seconds."""
        await readable(self._link_channel.link.fileno(), max(0.0, seconds))
