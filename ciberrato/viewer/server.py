"""The shell around a session: sockets, clock, signals and browsers, on one asyncio loop."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import socket
from collections.abc import Callable
from dataclasses import dataclass
from http import HTTPStatus
from typing import TYPE_CHECKING

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from ciberrato.errors import UsageError
from ciberrato.net.link import Link, LinkClosedError, LinkError
from ciberrato.reprs import short_repr
from ciberrato.system.loops import call_in, stop_on_signals
from ciberrato.system.process import when_input_ends
from ciberrato.system.sockets import keep_port
from ciberrato.viewer.connection import Outgoing
from ciberrato.viewer.outbox import Outbox
from ciberrato.viewer.page_messages import MOST_COMMAND_BYTES, Control, PageError, read_page_message
from ciberrato.viewer.session import Session
from ciberrato.viewer.site import Answer, Site, is_loopback, read_assets

if TYPE_CHECKING:
    from asyncio import Task

MOST_BROWSERS = 200
FRAMES_PER_SECOND = 30.0
"""Greatest number of frames per second for a browser; one a cycle if cycles are slower."""

_TICK_SECONDS = 0.2
_SEND_BUFFER = 65536
"""Bytes that the kernel holds for a browser: what is in there can no longer be replaced by newer frames."""

_MOST_DATAGRAMS = 200


@dataclass(slots=True, eq=False)
class Browser:
    """One browser's connection.

    Attributes
    ----------
    outbox : Outbox
    news : asyncio.Event
        Set when there is something to send.
    room : asyncio.Event
        Set when an answer was sent.
    """

    __repr__ = short_repr

    outbox: Outbox
    news: asyncio.Event
    room: asyncio.Event


class Server:
    """Serves a session until it is stopped.

    Parameters
    ----------
    session : Session
    link : Link or None
        To the simulator; None for a recording.
    host : str
        Address to bind for browsers.
    port : int
        0 takes a free one.
    token : str or None
        Token required of browsers; None: a random one is generated where it is needed.
    blocking_registration : bool
        Whether `Link.register` may block, as over TCP.

    Attributes
    ----------
    url : str
        Address of the page.

    Raises
    ------
    UsageError
        If a port cannot be opened.
    """

    def __init__(
        self,
        session: Session,
        link: Link | None,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        token: str | None = None,
        blocking_registration: bool = False,
    ) -> None:
        self.session = session
        self._link = link
        self._blocking_registration = blocking_registration
        self._socket = _open(socket.SOCK_STREAM, host, port, "page")
        self.port: int = self._socket.getsockname()[1]
        self._overlay_socket: socket.socket | None = None
        if token is None and not is_loopback(host):
            token = secrets.token_urlsafe(16)
        self._site = Site(port=self.port, token=token, assets=read_assets())
        shown = socket.gethostname() if host in ("0.0.0.0", "") else host
        self.url = f"http://{shown}:{self.port}/" + (f"?token={token}" if token is not None else "")
        self._browsers: set[Browser] = set()
        self._dirty = asyncio.Event()
        self._stop = asyncio.Event()
        self._registering: Task[None] | None = None
        self.sent_bytes = 0

    def open_overlay(self, port: int) -> None:
        """Open a UDP port of 127.0.0.1 for overlays.

        Parameters
        ----------
        port : int
            0 takes a free one.

        Raises
        ------
        UsageError
            If it cannot be opened.
        """
        self._overlay_socket = _open(socket.SOCK_DGRAM, "127.0.0.1", port, "overlay")

    @property
    def overlay_port(self) -> int | None:
        """The port on which overlays are taken."""
        return None if self._overlay_socket is None else int(self._overlay_socket.getsockname()[1])

    @property
    def browsers(self) -> int:
        """Number of connected browsers."""
        return len(self._browsers)

    def close(self) -> None:
        """Close the ports of a server that is not going to run; `run` closes them itself."""
        self._socket.close()
        if self._overlay_socket is not None:
            self._overlay_socket.close()

    def stop(self) -> None:
        """Stop `run`; only from the loop's thread."""
        self._stop.set()

    async def run(self, *, until_eof: bool = False, started: Callable[[], None] = lambda: None) -> None:
        """Serve until a signal, or `stop`.

        Parameters
        ----------
        until_eof : bool
            Stop when standard input ends, too: so a viewer ends with the program that started it, however
            that one ends.
        started : callable
            Called when the page can be opened.
        """
        loop = asyncio.get_running_loop()
        stop_on_signals(loop, self.stop)
        if until_eof:
            when_input_ends(lambda: call_in(loop, self.stop))
        async with serve(
            self._attend,
            sock=self._socket,
            process_request=self._process_request,
            compression=None,
            max_size=MOST_COMMAND_BYTES,
            max_queue=4,
            write_limit=32768,
            ping_interval=20,
            ping_timeout=20,
            open_timeout=10,
            close_timeout=2,
            server_header=None,
            logger=_silent_logger(),
        ):
            started()
            self._start_link(loop)
            if self._overlay_socket is not None:
                loop.add_reader(self._overlay_socket.fileno(), self._read_overlays)
            tasks = [loop.create_task(self._publish()), loop.create_task(self._tick())]
            # The first look at a belief imports scipy, which takes a while.
            warm_up = loop.run_in_executor(None, _import_scipy)
            stopped = loop.create_task(self._stop.wait())
            try:
                done, _ = await asyncio.wait([*tasks, stopped], return_when=asyncio.FIRST_COMPLETED)
                for task in done:
                    task.result()
            finally:
                for task in (*tasks, stopped):
                    task.cancel()
                await warm_up
                await self._close(loop)

    # --- the simulator --------------------------------------------------------------------------

    def _start_link(self, loop: asyncio.AbstractEventLoop) -> None:
        self._send(self.session.start(loop.time()))
        if self._link is not None and self._registering is None:
            loop.add_reader(self._link.fileno(), self._read_link)

    def _read_link(self) -> None:
        assert self._link is not None
        now = asyncio.get_running_loop().time()
        revision = self.session.revision
        try:
            for data in self._link.receive_waiting():
                self._send(self.session.receive(data, now))
        except LinkClosedError as error:
            asyncio.get_running_loop().remove_reader(self._link.fileno())
            self.session.lost(str(error), now)
        # Half a cycle is no news: browsers would get the frame one interval late.
        if self.session.revision != revision:
            self._dirty.set()

    def _send(self, outgoing: list[Outgoing]) -> None:
        if self._link is None:
            return
        for message in outgoing:
            # What cannot be sent is as lost on the way: the session asks again.
            with contextlib.suppress(LinkError):
                if not message.registration:
                    self._link.send(message.data)
                elif not self._blocking_registration:
                    self._link.register(message.data)
                elif self._registering is None:
                    self._registering = asyncio.get_running_loop().create_task(self._register(message.data))

    async def _register(self, data: bytes) -> None:
        """Register where that may block: the link is left to a thread meanwhile."""
        assert self._link is not None
        loop = asyncio.get_running_loop()
        loop.remove_reader(self._link.fileno())
        try:
            with contextlib.suppress(LinkError):
                await asyncio.to_thread(self._link.register, data)
        finally:
            self._registering = None
        loop.add_reader(self._link.fileno(), self._read_link)

    # --- agents ---------------------------------------------------------------------------------

    def _read_overlays(self) -> None:
        assert self._overlay_socket is not None
        now = asyncio.get_running_loop().time()
        for _ in range(_MOST_DATAGRAMS):
            try:
                data = self._overlay_socket.recv(65536)
            except (BlockingIOError, ConnectionError):
                break
            self.session.receive_overlay(data, now)
        self._dirty.set()

    # --- browsers -------------------------------------------------------------------------------

    async def _tick(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            if self._registering is None:
                self._send(self.session.tick(loop.time()))
            self._dirty.set()
            await asyncio.sleep(_TICK_SECONDS)

    async def _publish(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            await self._dirty.wait()
            self._dirty.clear()
            self._hand_out(loop.time())
            await asyncio.sleep(1.0 / FRAMES_PER_SECOND)

    def _hand_out(self, now: float) -> None:
        """Queue the news in every browser's outbox."""
        for topic, text in self.session.news(now):
            for browser in self._browsers:
                browser.outbox.put(topic, text)
        for browser in self._browsers:
            browser.news.set()

    def _process_request(self, connection: ServerConnection, request: Request) -> Response | None:
        if (
            getattr(request, "method", "GET") != "GET"
        ):  # older releases of websockets refuse others themselves
            answer: Answer | None = Answer(HTTPStatus.METHOD_NOT_ALLOWED, (("Allow", "GET"),), b"")
        else:
            answer = self._site.respond(request.path, request.headers)
        if answer is None and len(self._browsers) >= MOST_BROWSERS:
            answer = Answer(
                HTTPStatus.SERVICE_UNAVAILABLE, (("Content-Type", "text/plain"),), b"too many browsers\n"
            )
        if answer is None:
            return None
        length = ("Content-Length", str(len(answer.body)))
        headers = Headers([*answer.headers, length, ("Connection", "close")])
        return Response(answer.status.value, answer.status.phrase, headers, answer.body)

    async def _attend(self, connection: ServerConnection) -> None:
        """Serve one browser until it leaves."""
        sock = connection.transport.get_extra_info("socket")
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        browser = Browser(Outbox(), asyncio.Event(), asyncio.Event())
        # News are what differs from the news before: no page may be ahead of them.
        self._hand_out(asyncio.get_running_loop().time())
        for topic, text in self.session.snapshot():
            browser.outbox.put(topic, text)
        browser.news.set()
        self._browsers.add(browser)
        sender = asyncio.get_running_loop().create_task(self._send_to(browser, connection))
        try:
            async for sent in connection:
                message = read_page_message(sent)
                if isinstance(message, Control):
                    self._send(self.session.command(message))
                    continue
                while browser.outbox.full:
                    browser.room.clear()
                    await browser.room.wait()
                browser.outbox.reply(self.session.answer(message))
                browser.news.set()
        except ConnectionClosed:
            pass
        except PageError as error:
            await connection.close(1008, str(error))
        finally:
            self._browsers.discard(browser)
            sender.cancel()

    async def _send_to(self, browser: Browser, connection: ServerConnection) -> None:
        with contextlib.suppress(ConnectionClosed):
            while True:
                await browser.news.wait()
                browser.news.clear()
                while (news := browser.outbox.take()) is not None:
                    await connection.send(news)  # waits while the browser does not read
                    self.sent_bytes += len(news)
                    browser.room.set()
        browser.room.set()

    async def _close(self, loop: asyncio.AbstractEventLoop) -> None:
        if self._registering is not None:
            await self._registering
        if self._link is not None:
            loop.remove_reader(self._link.fileno())
            self._link.close()
        if self._overlay_socket is not None:
            loop.remove_reader(self._overlay_socket.fileno())
            self._overlay_socket.close()


def _open(kind: socket.SocketKind, host: str, port: int, what: str) -> socket.socket:
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=kind, flags=socket.AI_PASSIVE)[0]
        opened = socket.socket(family, kind)
    except OSError as error:
        raise UsageError(f"cannot open the {what}'s port on {host}: {error.strerror}") from None
    try:
        keep_port(opened)
        opened.bind(address)
        if kind == socket.SOCK_DGRAM:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    except OSError as error:
        opened.close()
        raise UsageError(
            f"cannot open the {what}'s port {host}:{port}: {error.strerror}; 0 takes any free one"
        ) from None
    opened.setblocking(False)
    return opened


def _import_scipy() -> None:
    import scipy.sparse.csgraph  # noqa: F401


def _silent_logger() -> logging.Logger:
    # Handshakes that fail are the other side's doing; a traceback for each is of no use.
    logger = logging.getLogger("ciberrato.viewer.websockets")
    logger.addHandler(logging.NullHandler())
    logger.propagate = False
    return logger
