"""All that a process has started: counted, measured, and ended, however deep it hides.

Linux reports by /proc. Other POSIX systems report by ``ps`` who is whose child and how much memory it has;
threads are not counted there, and orphans, which Linux lets us adopt, are found no more. Windows ends a
process with its children by ``taskkill``, and neither counts nor measures: `MEASURES` says so.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from ciberrato.reprs import short_repr

_SET_DEATH_SIGNAL, _SET_SUBREAPER = 1, 36
_PAGE = os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 4096
_PROC = Path("/proc/self/task").is_dir()
_PS = None if _PROC or os.name != "posix" else shutil.which("ps", path="/bin:/usr/bin")

MEASURES = "all" if _PROC else "memory" if _PS else "nothing"
"""Measurements of descendants that are possible here: ``all``, their ``memory``, or ``nothing``."""

SECONDS_A_LOOK = 0.05 if _PROC else 0.5
"""Least time between two measurements, in seconds."""


class Usage(NamedTuple):
    """Resources that processes use: the number of their threads, and their memory in bytes."""

    threads: int
    memory: int

    def __repr__(self) -> str:
        return short_repr(self)


def adopt_orphans() -> None:
    """Adopt processes whose parents have ended, instead of the system's first process."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_SET_SUBREAPER, 1, 0, 0, 0)


def die_with_parent() -> None:
    """Request that the system ends this process when its parent ends, for whatever reason."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_SET_DEATH_SIGNAL, signal.SIGTERM, 0, 0, 0)


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
    if not _PROC:
        return _below(root)
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
            with contextlib.suppress(OSError), open(f"/proc/{process}/task/{thread}/children", "rb") as file:
                found += map(int, file.read().split())
    return found


def _below(root: int) -> list[int]:
    """Find them by what ``ps`` says; no more than none where there is no ``ps``."""
    found = [root]
    table = _table()
    for process in found:
        found += [child for child, (parent, _) in table.items() if parent == process]
    return found[1:]


def _table() -> dict[int, tuple[int, int]]:
    """Return parent and memory in bytes of all processes that run."""
    if _PS is None:
        return {}
    command = [_PS, "-A", "-o", "pid=,ppid=,rss=,stat="]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as asked:
        said, _ = asked.communicate()
    rows = (line.split(None, 3) for line in said.splitlines())
    return {
        int(process): (int(parent), int(kilobytes) << 10)
        for process, parent, kilobytes, state in (row for row in rows if len(row) == 4)
        if not state.startswith(b"Z") and int(process) != asked.pid
    }


def _is_alive(process: int) -> bool:
    with contextlib.suppress(OSError), open(f"/proc/{process}/stat", "rb") as file:
        return file.read().rpartition(b") ")[2][:1] not in (b"Z", b"X", b"")
    return False


def at_work(processes: Sequence[int]) -> bool:
    """Return whether one of the processes computes, or would if it had a processor; False if not told."""
    for process in processes:
        with contextlib.suppress(OSError), open(f"/proc/{process}/stat", "rb") as file:
            if file.read().rpartition(b") ")[2][:1] in (b"R", b"D"):
                return True
    return False


def usage(processes: Sequence[int]) -> Usage:
    """Measure processes.

    Memory is resident pages but those of files, shared memory included; pages that forks still share are
    counted for each of them, so it is an upper bound (`exact_memory`).
    """
    if not _PROC:
        table = _table()
        return Usage(0, sum(table.get(process, (0, 0))[1] for process in processes))
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
        Bytes; None where the system does not report it.
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
        Its inode; None where the system does not report it.
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


def end_all(
    find: Callable[[], list[int]],
    seconds: float = 10.0,
    *,
    child: subprocess.Popen[bytes] | None = None,
) -> bool:
    """Kill processes until there are none left.

    All are stopped first: so those that start others faster than they are found come to rest.

    Parameters
    ----------
    find : callable
        Returns those that are there.
    child : Popen, optional
        The one that started them, for where they cannot be found.
    seconds : float
        Time to try.

    Returns
    -------
    bool
        Whether none is left.
    """
    if MEASURES == "nothing":
        return child is None or _end_tree(child, seconds)
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


def end_session(child: subprocess.Popen[bytes]) -> None:
    """Kill a child that was started `ciberrato.system.process.apart`, and what it has started."""
    if hasattr(os, "killpg"):
        with contextlib.suppress(OSError):
            os.killpg(child.pid, signal.SIGKILL)
    else:
        _end_tree(child, 10.0)


def _end_tree(child: subprocess.Popen[bytes], seconds: float) -> bool:
    """Stop a child with all processes below it whose parents still run."""
    if child.poll() is None and (tool := shutil.which("taskkill")) is not None:
        nothing = subprocess.DEVNULL
        command = [tool, "/F", "/T", "/PID", str(child.pid)]
        subprocess.run(command, stdin=nothing, stdout=nothing, stderr=nothing, check=False)
    child.kill()
    with contextlib.suppress(subprocess.TimeoutExpired):
        child.wait(seconds)
    return child.poll() is not None


def limiter(*, seconds: float, memory: int, files: int, file_size: int) -> Callable[[], None] | None:
    """Return what a child calls before it becomes the agent; None where there are no such limits (Windows).

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
    try:
        import resource
    except ImportError:
        return None

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
            with contextlib.suppress(ValueError, OSError):  # systems refuse what they do not hold anybody to
                resource.setrlimit(kind, (value, value))

    return apply
