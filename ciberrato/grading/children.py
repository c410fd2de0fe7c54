"""All that an agent has started: counted, measured, and ended, however deep it hides (Linux's /proc)."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

_SET_DEATH_SIGNAL, _SET_SUBREAPER = 1, 36
_PAGE = os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 4096


class Usage(NamedTuple):
    """What processes use: how many threads they are, and their memory in bytes."""

    threads: int
    memory: int


def adopt_orphans() -> None:
    """Let processes whose parents have ended become children of this one, not of the system's first."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_SET_SUBREAPER, 1, 0, 0, 0)


def descendants(root: int) -> list[int]:
    """Find the processes below one.

    Parameters
    ----------
    root : int
        Process id.

    Returns
    -------
    list of int
        Parents before their children; those that have ended are left out.
    """
    found: list[int] = []
    front = [root]
    while front:
        front = [child for parent in front for child in _children(parent)]
        found += front
    return [process for process in found if _is_alive(process)]


def _children(process: int) -> list[int]:
    found: list[int] = []
    with contextlib.suppress(OSError):
        for thread in os.listdir(f"/proc/{process}/task"):
            with contextlib.suppress(OSError), open(f"/proc/{process}/task/{thread}/children") as file:
                found += map(int, file.read().split())
    return found


def _is_alive(process: int) -> bool:
    with contextlib.suppress(OSError), open(f"/proc/{process}/stat", "rb") as file:
        return file.read().rpartition(b") ")[2][:1] not in (b"Z", b"X", b"")
    return False


def usage(processes: Sequence[int]) -> Usage:
    """Measure processes.

    Memory is resident pages but those of files, shared memory included; pages that forks still share are
    counted for each of them, so it is an upper bound (`exact_memory`).
    """
    threads = memory = 0
    for process in processes:
        with contextlib.suppress(OSError, ValueError, IndexError):
            with open(f"/proc/{process}/statm", "rb") as file:
                _, resident, shared, *_ = file.read().split()
            memory += (int(resident) - int(shared)) * _PAGE
            with open(f"/proc/{process}/status", "rb") as file:
                status = file.read()
            threads += int(status.split(b"Threads:")[1].split(None, 1)[0])
            if b"RssShmem:" in status:
                memory += int(status.split(b"RssShmem:")[1].split(None, 1)[0]) << 10
    return Usage(threads, memory)


def exact_memory(processes: Sequence[int]) -> int | None:
    """Measure memory, sharing out pages that several processes have; takes longer than `usage`.

    Returns
    -------
    int or None
        Bytes; None where the system does not tell.
    """
    total = 0
    for process in processes:
        try:
            with open(f"/proc/{process}/smaps_rollup", "rb") as file:
                rows = dict(line.split(b":", 1) for line in file if b":" in line[:20])
            total += sum(int(rows[name].split()[0]) << 10 for name in (b"Pss_Anon", b"Pss_Shmem"))
        except ProcessLookupError:
            continue
        except (OSError, KeyError, ValueError):
            return None
    return total


def socket_of(port: int) -> str | None:
    """Find the socket that has a port, UDP's or TCP's, of this network.

    Returns
    -------
    str or None
        Its inode; None where the system does not tell.
    """
    wanted = f"{port:04X}"
    for table in ("udp", "udp6", "tcp", "tcp6"):
        with contextlib.suppress(OSError), open(f"/proc/net/{table}", encoding="ascii") as file:
            for fields in map(str.split, file):
                if fields[1].rpartition(":")[2] == wanted and fields[9] != "0":
                    return fields[9]
    return None


def holds_socket(processes: Sequence[int], inode: str) -> bool:
    """Return whether one of the processes has a socket open."""
    for process in processes:
        with contextlib.suppress(OSError):
            for name in os.listdir(f"/proc/{process}/fd"):
                with contextlib.suppress(OSError):
                    if os.readlink(f"/proc/{process}/fd/{name}") == f"socket:[{inode}]":
                        return True
    return False


def end_all(find: Callable[[], list[int]], seconds: float = 10.0) -> bool:
    """Kill processes until there are none left.

    All are stopped first: so those that start others faster than they are found come to rest.

    Parameters
    ----------
    find : callable
        Returns those that are there.
    seconds : float
        How long to try.

    Returns
    -------
    bool
        Whether none is left.
    """
    until = time.monotonic() + seconds
    while left := find():
        for number in (signal.SIGSTOP, signal.SIGKILL):
            for process in left:
                with contextlib.suppress(OSError):
                    os.kill(process, number)
        if time.monotonic() > until:
            return False
        time.sleep(0.002)
    return True


def limiter(*, seconds: float, memory: int, files: int, file_size: int) -> Callable[[], None]:
    """Return what a child calls before it becomes the agent.

    Parameters
    ----------
    seconds : float
        Processor time.
    memory : int
        Bytes of data; half as much again and more than what `usage` is held against, as a stop for what
        grows faster than it is looked at.
    files : int
        Open files.
    file_size : int
        Bytes.
    """
    import resource

    libc = ctypes.CDLL(None) if sys.platform == "linux" else None
    limits = [
        (resource.RLIMIT_CPU, int(seconds) + 1),
        (resource.RLIMIT_DATA, memory),
        (resource.RLIMIT_NOFILE, files),
        (resource.RLIMIT_FSIZE, file_size),
        (resource.RLIMIT_CORE, 0),
    ]

    def apply() -> None:
        os.setsid()
        if libc is not None:
            libc.prctl(_SET_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0)
        for kind, value in limits:
            _, hard = resource.getrlimit(kind)
            value = value if hard == resource.RLIM_INFINITY else min(value, hard)
            resource.setrlimit(kind, (value, value))

    return apply
