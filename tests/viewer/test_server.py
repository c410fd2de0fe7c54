"""The viewer process from outside: a replayed simulator, browsers that behave and browsers that do not."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

import numpy as np
import pytest
import websockets
from websockets.asyncio.client import ClientConnection, connect

from ciberrato.net import UdpLink
from ciberrato.net.overlay import OverlayClient
from ciberrato.overlay import Circle, GridBelief, OverlayMessage
from ciberrato.protocol import Acceptance, Restart, RobotStatus, encode
from ciberrato.viewer import connection
from ciberrato.viewer.page_messages import MOST_COMMAND_BYTES
from ciberrato.viewer.server import Server
from ciberrato.viewer.session import Session
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid

from .conftest import SECONDS, ReplayingSimulator, ViewSession, recorded_frames


@pytest.fixture(autouse=True)
def _no_impatience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the viewer ask once: how often it asks a simulator that is slow to answer is test_connection's."""
    for name in ("ANSWER_SECONDS", "SILENCE_SECONDS"):
        monkeypatch.setattr(connection, name, SECONDS)


class LiveSimulator:
    """A simulator's view port that says what a test wants."""

    def __init__(self) -> None:
        self.main = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.talk = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        for one in (self.main, self.talk):
            one.bind(("127.0.0.1", 0))
            one.setblocking(False)
        self.port: int = self.main.getsockname()[1]
        self.view = ("", 0)

    async def accept(self, lab: Lab) -> None:
        loop = asyncio.get_running_loop()
        data, self.view = await asyncio.wait_for(loop.sock_recvfrom(self.main, 1024), SECONDS)
        assert data == b"<View/>\0"
        self.say(Acceptance(parameters=Parameters(sim_time=0), n_beacons=0))
        assert await self.hear() == b"<LabReq/>\0"
        assert await self.hear() == b"<GridReq/>\0"
        self.say(lab)
        self.say(StartGrid())

    async def hear(self) -> bytes:
        loop = asyncio.get_running_loop()
        return await asyncio.wait_for(loop.sock_recv(self.talk, 1024), SECONDS)

    def say(self, message: Any) -> None:
        self.talk.sendto(encode(message), self.view)

    def close(self) -> None:
        self.main.close()
        self.talk.close()


@contextlib.asynccontextmanager
async def serving(port: int, *, overlay: bool = False, **options: Any) -> AsyncIterator[Server]:
    server = Server(Session(f"127.0.0.1:{port}"), UdpLink("127.0.0.1", port), **options)
    if overlay:
        server.open_overlay(0)
    started = asyncio.Event()
    task = asyncio.get_running_loop().create_task(server.run(started=started.set))
    try:
        await asyncio.wait_for(started.wait(), SECONDS)
        yield server
    finally:
        server.stop()
        await asyncio.wait_for(task, SECONDS)


def browser(server: Server, **options: Any) -> connect:
    origin = options.pop("origin", f"http://127.0.0.1:{server.port}")
    patience = {"open_timeout": SECONDS, "ping_interval": None}
    return connect(f"ws://127.0.0.1:{server.port}/socket", origin=origin, **patience | options)


async def until(page: ClientConnection, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Read what the page is sent until something wanted comes."""
    async with asyncio.timeout(SECONDS):
        while True:
            message = json.loads(await page.recv())
            if wanted(message):
                return message


def of_type(kind: str) -> Callable[[dict[str, Any]], bool]:
    return lambda message: message["type"] == kind


def frame_at(time: int) -> Callable[[dict[str, Any]], bool]:
    return lambda message: message["type"] == "frame" and message["frame"][0] == time


def run_live(
    scenario: Callable[[LiveSimulator, Server], Awaitable[None]], lab: Lab | None = None, **options: Any
) -> None:
    """Run a scenario with a simulator that has accepted the viewer."""

    async def play() -> None:
        simulator = LiveSimulator()
        try:
            async with serving(simulator.port, **options) as server:
                await simulator.accept(lab or Lab(name="live", width=8.0, height=4.0))
                await scenario(simulator, server)
        finally:
            simulator.close()

    asyncio.run(play())


def status(time: int, robot: int = 1, **values: Any) -> RobotStatus:
    return RobotStatus(**({"name": "r", "robot_id": robot, "time": time, "state": "Running"} | values))


# --- what is shown ----------------------------------------------------------------------------------


def test_a_replayed_session_of_the_real_simulator_reaches_the_page(full_session: ViewSession) -> None:
    # Up to the Reset: what comes after it is the next test's.
    restart = next(i for i, (_, data) in enumerate(full_session.events) if data.startswith(b"<Restart"))
    events = full_session.events[:restart]
    simulator = ReplayingSimulator(ViewSession(events))
    expected = recorded_frames([data for direction, data in events if direction == "sim"])
    last = max(expected)

    async def play() -> None:
        async with serving(simulator.port) as server, browser(server) as page:
            world = await until(page, lambda m: m["type"] == "world" and m["lab"] is not None and m["grid"])
            assert world["lab"]["name"] == "Open"
            assert world["grid"] == [[3, 3, 0], [3, 5, 90], [3, 7, 180]]
            frame = (await until(page, frame_at(last)))["frame"]
            assert [[*row[:4], row[10]] for row in frame[2]] == [
                [*robot[:4], robot[7]] for robot in expected[last].values()
            ]
            await page.send(json.dumps({"ask": "frames", "from": 0, "to": last, "most": 512}))
            frames = (await until(page, of_type("frames")))["frames"]
            assert [time for time, _, _ in frames] == sorted(expected)
            for time, _, rows in frames:
                assert {row[0]: row[1:4] for row in rows} == {
                    robot: list(row[1:4]) for robot, row in expected[time].items()
                }

    asyncio.run(play())
    simulator.close()
    assert simulator.failure is None
    assert simulator.heard == [b"<LabReq/>", b"<GridReq/>"]


def test_it_registers_again_after_a_recorded_restart(full_session: ViewSession) -> None:
    restart = next(i for i, (_, data) in enumerate(full_session.events) if data.startswith(b"<Restart"))
    # The recorder registered again, but asked for nothing: a second half as the first began.
    beginning = full_session.events[:6]
    assert [data.split(b"/")[0][:5] for _, data in beginning] == [
        b"<View",
        b"<Repl",
        b"<LabR",
        b"<Lab ",
        b"<Grid",
        b"<Grid",
    ]
    simulator = ReplayingSimulator(ViewSession(full_session.events[: restart + 1] + beginning))

    async def play() -> None:
        async with serving(simulator.port) as server, browser(server) as page:
            # Counted at the Reply, at the Restart, and at the second Reply.
            await until(page, lambda m: m["type"] == "world" and m["epoch"] == 3 and m["grid"])
            empty = await until(page, lambda m: m["type"] == "frame" and not m["frame"][2])
            assert empty["frame"][1] == "empty"

    asyncio.run(play())
    simulator.close()
    assert simulator.failure is None
    assert simulator.registrations == 2
    assert simulator.heard == [b"<LabReq/>", b"<GridReq/>"] * 2


def test_commands_of_the_page_reach_the_simulator() -> None:
    async def scenario(simulator: LiveSimulator, server: Server) -> None:
        async with browser(server) as page:
            await until(page, lambda m: m["type"] == "status" and m["connection"] == "watching")
            for command, data in (
                ({"do": "start"}, b"<Start/>\0"),
                ({"do": "stop"}, b"<Stop/>\0"),
                ({"do": "remove", "robot": 3}, b'<Robot Id="3" Removed="Yes"/>\0'),
                ({"do": "reset"}, b"<Reset/>\0"),
            ):
                await page.send(json.dumps(command))
                assert await simulator.hear() == data
            simulator.say(Restart())
            await until(page, lambda m: m["type"] == "status" and m["connection"] == "searching")

    run_live(scenario)


def test_without_control_a_page_can_only_look() -> None:
    async def scenario(simulator: LiveSimulator, server: Server) -> None:
        server.session._control = False
        async with browser(server) as page:
            await until(page, lambda m: m["type"] == "status" and m["connection"] == "watching")
            await page.send('{"do":"reset"}')
            await page.send('{"ask":"marks","skip":0}')
            await until(page, of_type("marks"))
        simulator.talk.setblocking(False)
        with pytest.raises(BlockingIOError):
            simulator.talk.recv(100)

    run_live(scenario)


def test_an_agents_belief_and_shapes_reach_the_page_and_can_be_asked_for() -> None:
    async def scenario(simulator: LiveSimulator, server: Server) -> None:
        assert server.overlay_port is not None
        with OverlayClient(port=server.overlay_port) as agent:
            async with browser(server) as page:
                for n in (1, 2):
                    simulator.say(status(10 * n, x=3.0, y=1.0))
                    await until(page, frame_at(10 * n))
                    cells = np.array([[1.0, n], [0.0, 0.0]])
                    agent.send(OverlayMessage(source="a", robot=1, belief=GridBelief(cells=cells)))
                    news = await until(page, of_type("belief"))
                    assert news["series"][0] == 10 * n
                assert news["version"] == 2
                assert news["belief"]["peak"] == pytest.approx(2 / 3)
                # The robot is at (3, 1): of 8 x 4 units in 2 x 2 cells, that is the left one below.
                assert news["series"][3] == pytest.approx(1 / 3, abs=1e-4)
                # What it believed at time 20 is compared with where the robot was then.
                simulator.say(status(30, x=7.0, y=3.0))
                await until(page, frame_at(30))
                cells = np.array([[1.0, 0.0], [0.0, 0.0]])
                agent.send(OverlayMessage(source="a", robot=1, time=20, belief=GridBelief(cells=cells)))
                late = await until(page, lambda m: m["type"] == "belief" and m["version"] == 3)
                assert late["series"] == [20, 0.0, 1.0, 1.0]
                await page.send('{"ask":"belief","source":"a","time":15}')
                past = await until(page, of_type("past"))
                assert (past["belief"]["time"], past["belief"]["entropy"]) == (10, 1.0)
                await page.send('{"ask":"series","source":"a"}')
                assert [row[0] for row in (await until(page, of_type("series")))["series"]] == [10, 20]
                shapes = (Circle(id="goal", x=1.0, y=1.0, radius=1.0, ttl=2.0),)
                agent.send(OverlayMessage(source="a", shapes=shapes))
                drawn = await until(page, lambda m: m["type"] == "shapes" and m["shapes"])
                assert (drawn["shapes"][0]["id"], drawn["shapes"][0]["robot"]) == ("goal", 1)
                await until(page, lambda m: m["type"] == "shapes" and not m["shapes"])  # its time is over
                with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
                    for bad in (b"", b"junk", b"[" * 60_000):
                        stranger.sendto(bad, ("127.0.0.1", server.overlay_port))
                simulator.say(status(21, x=3.0, y=1.0))
                await until(page, frame_at(21))
                assert server.session.refused_overlays == 3

    run_live(scenario, overlay=True)


def test_tcp_simulators_and_those_that_go_away() -> None:
    from ciberrato.net import TcpLink

    async def play() -> None:
        accepted: asyncio.Queue[tuple[asyncio.StreamReader, asyncio.StreamWriter]] = asyncio.Queue()
        listener = await asyncio.start_server(lambda r, w: accepted.put((r, w)), "127.0.0.1", 0)
        port = listener.sockets[0].getsockname()[1]
        server = Server(Session("x"), TcpLink("127.0.0.1", port), blocking_registration=True)
        task = asyncio.get_running_loop().create_task(server.run())
        async with asyncio.timeout(SECONDS):
            for _ in range(2):  # the second time after the connection was lost
                reader, writer = await accepted.get()
                assert await reader.readuntil(b"\0") == b"<View/>\0"
                writer.write(encode(Acceptance(parameters=Parameters(), n_beacons=0)))
                assert await reader.readuntil(b"\0") == b"<LabReq/>\0"
                assert await reader.readuntil(b"\0") == b"<GridReq/>\0"
                writer.write(encode(Lab(name="over tcp", width=4.0, height=4.0)) + encode(StartGrid()))
                async with browser(server) as page:
                    await until(page, lambda m: m["type"] == "status" and m["connection"] == "watching")
                writer.close()
                await writer.wait_closed()
            server.stop()
            await task
        listener.close()
        await listener.wait_closed()

    asyncio.run(play())


# --- browsers that do not behave --------------------------------------------------------------------


def test_a_browser_that_does_not_read_costs_nobody_anything() -> None:
    rounds = 60

    async def scenario(simulator: LiveSimulator, server: Server) -> None:
        async with browser(server) as good, browser(server, max_queue=1, ping_interval=None) as slow:
            await until(good, of_type("world"))
            slow.transport.pause_reading()
            for n in range(1, rounds + 1):
                simulator.say(status(n, name=f"{n}" + 20_000 * "x"))  # every name is news, and long
                await until(good, frame_at(n))
            waiting = sorted(len(one.outbox) for one in server._browsers)
            # 1.2 MB were news. The slow one is owed at most one of each: world, status, roster, frame.
            assert 1 <= waiting[-1] <= 4
            held = sum(len(text) for one in server._browsers for text in one.outbox._news.values())
            assert held < 2 * 25_000
            slow.transport.resume_reading()
            seen: list[int] = []

            def last_frame(message: dict[str, Any]) -> bool:
                if message["type"] == "frame":
                    seen.append(message["frame"][0])
                return bool(seen) and seen[-1] == rounds

            await until(slow, last_frame)
            assert len(seen) < rounds / 2

    run_live(scenario)


@pytest.mark.parametrize(
    "sent",
    [
        "",
        "{",
        "[]",
        "null",
        '{"do":"format"}',
        '{"do":"start","ask":"marks"}',
        '{"do":"remove"}',
        '{"do":"remove","robot":"1"}',
        '{"do":"remove","robot":0}',
        '{"ask":"frames","from":0,"to":9}',
        '{"ask":"frames","from":-1,"to":9,"most":9}',
        '{"ask":"frames","from":0,"to":9,"most":1000000}',
        '{"ask":"frames","from":0,"to":1e9,"most":9}',
        '{"ask":"belief","source":7,"time":0}',
        '{"ask":"belief","source":"a"}',
        "[" * 1000,
        b"\x00\x01",
    ],
)
def test_what_no_page_of_ours_sends_ends_the_connection(sent: str | bytes) -> None:
    async def play() -> None:
        async with serving(1) as server:
            async with browser(server) as page:
                await page.send(sent)
                with pytest.raises(websockets.ConnectionClosed) as closed:
                    await until(page, lambda message: False)
                assert closed.value.rcvd is not None
                assert closed.value.rcvd.code == 1008
            async with browser(server) as page:  # the next one is served as before
                await until(page, of_type("world"))

    asyncio.run(play())


def test_messages_that_are_too_long_or_no_text_end_the_connection() -> None:
    async def play() -> None:
        async with serving(1) as server:
            async with browser(server) as page:
                await page.send("x" * (MOST_COMMAND_BYTES + 1))
                with pytest.raises(websockets.ConnectionClosed) as closed:
                    await until(page, lambda message: False)
                assert closed.value.rcvd is not None
                assert closed.value.rcvd.code == 1009
            reader, writer = await raw_socket(server)
            writer.write(
                bytes([0x81, 0xFE, 0xFF, 0xFF]) + bytes(4) + b"\xff" * 64
            )  # a frame said to be 64 kB
            assert await asyncio.wait_for(read_to_end(reader), SECONDS)
            writer.close()
            reader, writer = await raw_socket(server)
            writer.write(b"\xff" * 4096)  # no frame at all
            assert await asyncio.wait_for(read_to_end(reader), SECONDS)
            writer.close()
            async with browser(server) as page:
                await until(page, of_type("world"))

    asyncio.run(play())


async def raw_socket(server: Server) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
    writer.write(
        f"GET /socket HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nOrigin: http://127.0.0.1:{server.port}\r\n"
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n".encode()
    )
    assert b"101" in await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), SECONDS)
    return reader, writer


async def read_to_end(reader: asyncio.StreamReader) -> bool:
    with contextlib.suppress(ConnectionError):
        while await reader.read(65536):
            pass
    return True


async def fetch(port: int, request: bytes) -> bytes:
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(request)
    try:
        return await asyncio.wait_for(reader.read(), SECONDS)
    finally:
        writer.close()


def test_http_answers_files_and_nothing_else() -> None:
    async def play() -> None:
        async with serving(1) as server:
            host = f"Host: 127.0.0.1:{server.port}\r\n\r\n".encode()

            async def status_line(line: bytes, headers: bytes = host) -> bytes:
                return (await fetch(server.port, line + b"\r\n" + headers)).split(b"\r\n")[0]

            assert b"200" in await status_line(b"GET / HTTP/1.1")
            assert b"404" in await status_line(b"GET /../../pyproject.toml HTTP/1.1")
            assert b"404" in await status_line(b"GET /%2e%2e/server.py HTTP/1.1")
            assert b"403" in await status_line(b"GET / HTTP/1.1", b"Host: evil.example\r\n\r\n")
            assert b"200" not in await status_line(b"GET / HTTP/1.1", b"\r\n")
            assert b"200" not in await status_line(b"POST / HTTP/1.1")
            assert b"200" not in await status_line(b"\x16\x03\x01 rubbish")
            body = await fetch(server.port, b"GET /main.js HTTP/1.1\r\n" + host)
            assert b"Content-Type: text/javascript" in body
            with pytest.raises(websockets.InvalidStatus):
                async with browser(server, origin="http://evil.example"):
                    pass
            with pytest.raises(websockets.InvalidStatus):
                async with browser(server, origin=None):
                    pass

    asyncio.run(play())


def test_bound_to_all_addresses_a_token_is_made_up_and_needed() -> None:
    async def play() -> None:
        async with serving(1, host="0.0.0.0") as server:
            token = server.url.partition("?token=")[2]
            assert len(token) >= 16
            with pytest.raises(websockets.InvalidStatus):
                async with browser(server):
                    pass
            address = f"ws://127.0.0.1:{server.port}/socket?token={token}"
            async with connect(address, origin=f"http://127.0.0.1:{server.port}") as page:
                await until(page, of_type("world"))

    asyncio.run(play())


def test_many_browsers_come_and_go() -> None:
    async def scenario(simulator: LiveSimulator, server: Server) -> None:
        async with contextlib.AsyncExitStack() as stack:
            pages = [await stack.enter_async_context(browser(server)) for _ in range(30)]
            simulator.say(status(5))
            await asyncio.gather(*(until(page, frame_at(5)) for page in pages))
            assert server.browsers == 30
        deadline = time.monotonic() + SECONDS
        while server.browsers and time.monotonic() < deadline:
            await asyncio.sleep(0.01)
        assert server.browsers == 0

    run_live(scenario)
