"""Time that a sleeping processor takes to wake for a datagram, against one that a process keeps awake.

Two processes on processors of their own. One sends datagrams, each with the time at which it went out; the
other waits for them asleep (in `recv`), or awake (it looks again and again, and gives way to others in
between), and says how long each was under way. Before each datagram the sender sleeps for a while, so that
both processors come to rest if nothing else runs. ``python -m benchmarks.waking`` prints a table.
"""

from __future__ import annotations

import os
import select
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ciberrato.arrays import Floats

PAUSES = (0.0, 0.0001, 0.001, 0.01)
"""Seconds that the sender sleeps before each datagram; 0: it waits for the answer only."""

DATAGRAMS = {0.0: 4000, 0.0001: 3000, 0.001: 1500, 0.01: 300}

_RECEIVER = """
import os, socket, struct, sys, time
awake, count, processor = sys.argv[1] == "awake", int(sys.argv[2]), int(sys.argv[3])
if processor >= 0:
    os.sched_setaffinity(0, {processor})
own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
own.bind(("127.0.0.1", 0))
print(own.getsockname()[1], flush=True)
_, address = own.recvfrom(64)
own.connect(address)
own.setblocking(not awake)
began, used = time.perf_counter(), time.process_time()
for _ in range(count):
    while True:
        try:
            data = own.recv(64)
            break
        except BlockingIOError:
            os.sched_yield()
    own.send(struct.pack("=q", time.monotonic_ns() - struct.unpack("=q", data)[0]))
print((time.process_time() - used) / (time.perf_counter() - began), flush=True)
"""


def latencies(*, awake: bool, pause: float, count: int) -> tuple[Floats, float]:
    """Measure how long datagrams are under way.

    Parameters
    ----------
    awake : bool
        Whether the receiver waits awake.
    pause : float
        Seconds that the sender sleeps before each.
    count : int

    Returns
    -------
    latencies : array, shape (count,)
        Seconds from before `send` to after `recv`.
    share : float
        Share of a processor that the receiver took meanwhile.
    """
    before = sorted(os.sched_getaffinity(0))
    ours, theirs = (before[0], before[1]) if len(before) > 1 else (before[0], -1)
    command = [sys.executable, "-c", _RECEIVER, "awake" if awake else "asleep", str(count), str(theirs)]
    found = []
    with (
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own,
    ):
        assert process.stdout is not None
        own.connect(("127.0.0.1", int(process.stdout.readline())))
        os.sched_setaffinity(0, {ours})
        try:
            own.send(b"hello")
            time.sleep(0.05)
            for _ in range(count):
                if pause:
                    time.sleep(pause)
                own.send(struct.pack("=q", time.monotonic_ns()))
                select.select((own,), (), ())
                found.append(struct.unpack("=q", own.recv(64))[0])
        finally:
            os.sched_setaffinity(0, before)
        share = float(process.stdout.readline())
    return np.array(found) / 1e9, share


def table(rounds: int = 3) -> Iterator[str]:
    """Yield the lines of a table; both kinds in turns."""
    yield "| pause before a datagram | receiver | least | median | 95 % | processor taken |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for pause in PAUSES:
        found: dict[bool, list[tuple[Floats, float]]] = {False: [], True: []}
        for _ in range(rounds):
            for awake, runs in found.items():
                runs.append(latencies(awake=awake, pause=pause, count=DATAGRAMS[pause] // rounds))
        for awake, runs in found.items():
            times = np.concatenate([times for times, _ in runs]) * 1e6
            least, median, most = times.min(), np.median(times), np.quantile(times, 0.95)
            share = np.mean([share for _, share in runs])
            waits = "awake" if awake else "asleep"
            yield (
                f"| {pause * 1e3:g} ms | {waits} | {least:.0f} us | {median:.0f} us | {most:.0f} us "
                f"| {share:.0%} |"
            )


if __name__ == "__main__":
    if sys.argv[1:]:
        sys.exit(f"usage: python -m benchmarks.{Path(__file__).stem}")
    for line in table():
        print(line, flush=True)
