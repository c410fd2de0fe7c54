"""The shell around a session: sockets, clock and signals."""

from __future__ import annotations

import contextlib
import signal
import socket
from collections.abc import Callable, Iterator, Sequence

from ciberrato.errors import UsageError
from ciberrato.system.signals import ENDING
from simulator_stub.service.allowance import Meter
from simulator_stub.service.pace import Pace
from simulator_stub.service.readiness import Readiness
from simulator_stub.service.session import Session
from simulator_stub.service.transports import TRANSPORTS, Transport

ANY_PORT_ATTEMPTS = 20

LOOKS = 100
"""Greatest number of messages of one client that are read before a cycle."""


def open_transports(names: Sequence[str], host: str, port: int) -> list[Transport]:
    """Open all transports, with one port number.

    Parameters
    ----------
    names : sequence of str
        Keys of `TRANSPORTS`.
    host : str
        Address to bind.
    port : int
        0 takes one that is free on all of them.

    Returns
    -------
    list of Transport

    Raises
    ------
    UsageError
        If the port is in use or the address is not ours.
    """
    for attempt in range(ANY_PORT_ATTEMPTS):
        opened: list[Transport] = []
        number = port
        try:
            for name in names:
                transport = TRANSPORTS[name]()
                opened.append(transport)
                transport.open(host, number)
                number = transport.port
        except OSError as error:
            for transport in opened:
                transport.close()
            if port == 0 and len(opened) > 1 and attempt < ANY_PORT_ATTEMPTS - 1:
                continue  # the number was free on the first transport only
            reason = error.strerror or str(error)
            raise UsageError(f"cannot listen on {opened[-1].name} {host}:{number}: {reason}") from None
        return opened
    raise AssertionError("the last attempt returns or raises")


class Server:
    """Runs cycles until it is told to stop.

    Parameters
    ----------
    session : Session
    transports : sequence of Transport
        Open ones; closed at the end.
    pace : Pace
    go_on : callable
        Asked after each cycle; False ends `run`.

    Attributes
    ----------
    records_are_whole : callable
        Whether all that was to be recorded so far could be.
    """

    def __init__(
        self,
        session: Session,
        transports: Sequence[Transport],
        pace: Pace,
        go_on: Callable[[], bool] = lambda: True,
    ) -> None:
        self.session = session
        self.pace = pace
        self.simulation = session.simulation
        self._transports = transports
        self._go_on = go_on
        self._readiness = Readiness()
        self._meter = Meter(pace.period, session.dropped)
        self._stopping = False
        self.records_are_whole: Callable[[], bool] = lambda: True
        # Waiting ends when something is written here: by `stop`, and by Python when a signal arrives.
        self._wake_up, self._alarm = socket.socketpair()
        for end in (self._wake_up, self._alarm):
            end.setblocking(False)
        self._readiness.watch(self._wake_up, self._drain)
        session.make_room = self._make_room
        for transport in transports:
            transport.serve(self._readiness, session.welcome, self._meter)

    @property
    def port(self) -> int:
        """The port number, the same on all transports."""
        return self._transports[0].port

    def run(self) -> None:
        """Serve until `stop` is called, or there is nothing more to do."""
        while self.pace.wait(self._poll):
            self.session.cycle()
            if self._meter.advance():
                for transport in self._transports:
                    transport.tick(self._meter.now)
                self.session.tick(self._meter.now)
            if not self._go_on():
                break

    def stop(self) -> None:
        """Stop `run` without another cycle; may be called from anywhere."""
        self._stopping = True
        with contextlib.suppress(OSError):  # full: then it is going to wake up anyway
            self._alarm.send(b"\0")

    def _make_room(self) -> None:
        for transport in self._transports:
            transport.make_room()

    def _drain(self) -> None:
        with contextlib.suppress(BlockingIOError):
            self._wake_up.recv(4096)

    def _poll(self, timeout: float) -> bool:
        if not self._stopping:
            ready = self._readiness.wait(timeout)
            if timeout == 0.0:  # take all that is there
                for _ in range(LOOKS):
                    if not ready or self._stopping:
                        break
                    ready = self._readiness.wait(0.0)
        return not self._stopping

    @contextlib.contextmanager
    def stopping_on_signals(self) -> Iterator[None]:
        """Stop the server on SIGINT and SIGTERM while the block runs; only in the main thread."""
        before_alarm = signal.set_wakeup_fd(self._alarm.fileno(), warn_on_full_buffer=False)
        before = {number: signal.getsignal(number) for number in ENDING}
        for number in before:
            signal.signal(number, lambda *_: self.stop())
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
            signal.set_wakeup_fd(before_alarm)

    def close(self) -> None:
        """Finish the records and close all sockets."""
        self.session.close()
        for transport in self._transports:
            transport.close()
        self._readiness.close()
        self._wake_up.close()
        self._alarm.close()
