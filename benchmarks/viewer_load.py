"""The viewer under load: twenty robots, many browsers, some of which never read.

    python -m benchmarks.viewer_load [--seconds 120] [--browsers 50] [--stuck 5]

Prints a row a phase: pace of the simulator, CPU of simulator and viewer in percent of a core, memory of the
viewer, and what browsers get. One browser is a real one, where Chromium and playwright are present.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import re
import selectors
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Origin

from ciberrato.net import UdpLink
from ciberrato.protocol import Actions, Measures, RobotRegistration, decode_simulator_message, encode

ROBOTS = 20
TICKS = os.sysconf("SC_CLK_TCK")
CHROMIUM = shutil.which("chromium")
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]


def drive(port: int) -> None:
    """Drive twenty robots about until the simulator falls silent."""
    links: dict[UdpLink, int] = {}
    selector = selectors.DefaultSelector()
    for number in range(1, ROBOTS + 1):
        link = UdpLink("127.0.0.1", port)
        link.register(encode(RobotRegistration(name=f"mouse{number}", robot_id=number)))
        reply = link.receive(10.0)
        assert reply is not None
        assert b"Ok" in reply
        links[link] = 0
        selector.register(link, selectors.EVENT_READ, link)
    while ready := selector.select(5.0):
        for key, _ in ready:
            link = key.data
            for data in link.receive_waiting()[-1:]:
                message = decode_simulator_message(data)
                if isinstance(message, Measures):
                    left, right = steer(links, link, [reading or 0.0 for reading in message.infrared])
                    link.send(encode(Actions(left_motor=left, right_motor=right)))


def steer(turning: dict[UdpLink, int], link: UdpLink, infrared: list[float]) -> tuple[float, float]:
    front, left, right, _ = infrared
    if front > 1.2 or left > 2.5 or right > 2.5:
        turning[link] = turning[link] or (1 if right >= left else -1)
        return -0.06 * turning[link], 0.06 * turning[link]
    turning[link] = 0
    return 0.1, 0.1


@dataclass
class Process:
    """A process and what it costs."""

    popen: subprocess.Popen[str]

    def expect(self, pattern: str) -> str:
        assert self.popen.stdout is not None
        for line in self.popen.stdout:
            if found := re.match(pattern, line):
                return found.group(1)
        raise SystemExit(f"{self.popen.args!r} ended early")

    @property
    def cpu_seconds(self) -> float:
        fields = Path(f"/proc/{self.popen.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / TICKS

    @property
    def megabytes(self) -> float:
        text = Path(f"/proc/{self.popen.pid}/status").read_text()
        return int(re.search(r"VmRSS:\s+(\d+)", text).group(1)) / 1024  # type: ignore[union-attr]


@contextlib.contextmanager
def started(*arguments: str) -> Iterator[Process]:
    command = [sys.executable, "-m", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as popen:
        try:
            yield Process(popen)
        finally:
            popen.terminate()


class Client:
    """A browser without a screen."""

    def __init__(self, url: str) -> None:
        self.url = url.replace("http", "ws") + "socket"
        self.origin = Origin(url.rstrip("/"))
        self.bytes = self.frames = self.latest = 0
        self.task: asyncio.Task[None] | None = None
        self.connection: ClientConnection | None = None

    async def open(self, *, read: bool) -> None:
        self.connection = await connect(
            self.url, origin=self.origin, max_size=None, ping_interval=None, compression=None
        )
        if read:
            self.task = asyncio.create_task(self._read(self.connection))
        else:
            self.connection.transport.pause_reading()

    async def _read(self, connection: ClientConnection) -> None:
        async for text in connection:
            self.bytes += len(text)
            if text.startswith('{"type":"frame"'):  # type: ignore[arg-type]
                self.frames += 1
                self.latest = json.loads(text)["frame"][0]

    async def close(self) -> None:
        if self.task is not None:
            self.task.cancel()
        assert self.connection is not None
        self.connection.transport.abort()


@contextlib.asynccontextmanager
async def real_page(url: str) -> AsyncIterator[Any]:
    try:
        from playwright.async_api import async_playwright
    except ImportError:
        yield None
        return
    if CHROMIUM is None:
        yield None
        return
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        page = await browser.new_page(viewport={"width": 1280, "height": 800})
        await page.goto(url)
        await page.wait_for_selector(".robot-g")
        yield page
        await browser.close()


COUNTERS = (
    "[ciberrato.counters.painted, ciberrato.counters.frames, ciberrato.socket.bytes, performance.now()]"
)


async def measure(
    name: str, seconds: float, simulator: Process, viewer: Process | None, probe: Client | None, page: Any
) -> None:
    async def sample() -> list[float]:
        return [
            time.monotonic(),
            simulator.cpu_seconds,
            viewer.cpu_seconds if viewer else 0.0,
            probe.latest if probe else 0,
            probe.bytes if probe else 0,
            probe.frames if probe else 0,
            *(await page.evaluate(COUNTERS) if page else (0, 0, 0, 0)),
        ]

    before = await sample()
    await asyncio.sleep(seconds)
    after = await sample()
    took, sim, view, cycles, sent, frames, painted, shown, _, own = (
        b - a for a, b in zip(before, after, strict=True)
    )
    print(
        f"{name:34} {cycles / took:8.2f} {100 * sim / took:8.1f} {100 * view / took:8.1f} "
        f"{viewer.megabytes if viewer else 0:8.1f} {sent / took / 1000:8.1f} {frames / took:8.1f} "
        f"{(1000 * painted / own if own else 0):8.1f} {(1000 * shown / own if own else 0):8.1f}",
        flush=True,
    )


async def run(seconds: float, browsers: int, stuck: int) -> None:
    print(
        f"{'':34} {'cycles/s':>8} {'sim %':>8} {'viewer %':>8} {'viewer MB':>8} {'kB/s':>8} {'frames/s':>8} "
        f"{'page fps':>8} {'page fr/s':>8}"
    )
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        parameters = Path(folder) / "params.xml"
        parameters.write_text('<Parameters SimTime="100000" CycleTime="50"/>')
        simulator = stack.enter_context(
            started(
                *("simulator_stub", "--lab", "open", "--grid", "open", "--port", "0", "--seed", "1"),
                *("--param", str(parameters), "--autostart", str(ROBOTS)),
            )
        )
        port = simulator.expect(r"listening on udp .*:(\d+)")
        stack.enter_context(started("benchmarks.viewer_load", "--drive", port))
        await asyncio.sleep(3.0)
        await measure("no viewer", seconds / 4, simulator, None, None, None)
        viewer = stack.enter_context(
            started("ciberrato.viewer", "--simulator", f"127.0.0.1:{port}", "--http", "0", "--no-overlay")
        )
        url = viewer.expect(r"page: (\S+)")
        probe = Client(url)
        await probe.open(read=True)
        await asyncio.sleep(2.0)
        await measure("viewer, 1 client", seconds / 4, simulator, viewer, probe, None)
        async with real_page(url) as page:
            await measure("1 client, 1 page in Chromium", seconds, simulator, viewer, probe, page)
            stuck_clients = [Client(url) for _ in range(stuck)]
            for client in stuck_clients:
                await client.open(read=False)
            await measure(f"and {stuck} that never read", seconds, simulator, viewer, probe, page)
            clients = [Client(url) for _ in range(browsers)]
            for client in clients:
                await client.open(read=True)
            await measure(f"and {browsers} more clients", seconds, simulator, viewer, probe, page)
            for client in [*clients, *stuck_clients]:
                await client.close()
            await asyncio.sleep(2.0)
            await measure("after they left", seconds / 4, simulator, viewer, probe, page)
        await probe.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--browsers", type=int, default=50)
    parser.add_argument("--stuck", type=int, default=5)
    parser.add_argument("--drive", type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.drive is not None:
        drive(options.drive)
    else:
        asyncio.run(run(options.seconds, options.browsers, options.stuck))


if __name__ == "__main__":
    main()
