"""Whether a client on this machine is at work: what Linux reports of the process that holds its socket.

The protocol does not say which Measures an answer belongs to, nor that it is complete. But a client that
has nothing more to say waits for the next message, and Linux shows that: its thread sleeps, and nothing lies
unread in its socket. The state of a thread is in ``/proc/PID/task/TID/stat`` (third field), where it waits in
``wchan`` beside it, what lies unread in ``/proc/net/udp`` and ``/proc/net/tcp`` (`proc(5)`). On loopback a
message is delivered, and its reader woken, before `send` returns; so a thread that is seen asleep after its
Measures went out, with nothing unread, has read them.

None of this can be known of clients on other machines, of those of other users, of threads of this process
(which may sleep for Python's interpreter lock), and on other systems: `watch_client` then returns None.
"""

from __future__ import annotations

import contextlib
import os
import socket
import struct
from collections import Counter
from enum import Enum
from pathlib import Path

Address = tuple[str, int]

_PROC = Path("/proc")

LESSONS = 3
"""Number of times that a thread is woken by a message before it is taken for the one that reads."""

LOOKS_A_COUNT = 64
"""Number of looks at a process before its threads are counted again."""

FAMILIAR = 20
"""Number of times that a thread is seen to wait before it is believed to, if the system does not say."""

UNTOLD = 200
"""Looks without a word of where a thread waits after which the system counts as one that never tells."""

_UNMAPPED = {"00000000", "0" * 32}


def watch_client(kind: str, client: Address, own: Address) -> ClientProcess | None:
    """Find the process that holds a client's socket.

    Parameters
    ----------
    kind : str
        ``"udp"`` or ``"tcp"``.
    client, own : (str, int)
        IPv4 addresses and ports of both ends.

    Returns
    -------
    ClientProcess or None
        None if it cannot be found, or is this process.
    """
    found = _find_socket(kind, client, own)
    if found is None:
        return None
    inode, _ = found
    holders = _holders(inode)
    if not holders or os.getpid() in holders:
        return None
    process = ClientProcess(kind, client, own, inode, holders)
    return None if process.gone else process


class Activity(Enum):
    """Activities of a client.

    `RESTS`: it waits for a message, or for something else that may not come. `DOZES`: it lets time pass, and
    will go on by itself. `WORKS`: it computes, or waits for a processor.
    """

    RESTS = 0
    DOZES = 1
    WORKS = 2


class ClientProcess:
    """The process, or processes, that hold a client's socket.

    Of several threads the one that messages wake is watched, once that is known; until then, all.

    Attributes
    ----------
    gone : bool
        Whether all of them have ended.
    truthful : bool
        Whether it is known which thread answers.
    reader : (int, int) or None
        Process and thread number of that thread.
    """

    def __init__(self, kind: str, client: Address, own: Address, inode: str, holders: list[int]) -> None:
        self.gone = False
        self.truthful = False
        self._where = (kind, client, own)
        self._inode = inode
        self._threads: dict[tuple[int, int], _Thread] = {}
        self.reader: tuple[int, int] | None = None
        self._watched: list[_Thread] = []
        self._resting_before: set[tuple[int, int]] = set()
        self._woken: Counter[tuple[int, int]] = Counter()
        self._looks = 0
        self._open(holders)

    def _open(self, holders: list[int]) -> None:
        self._threads = {}
        for pid in holders:
            with contextlib.suppress(OSError):
                for name in os.listdir(f"/proc/{pid}/task"):
                    with contextlib.suppress(OSError):
                        self._threads[pid, int(name)] = _Thread(f"/proc/{pid}/task/{name}")
        self.gone = not self._threads
        if len(self._threads) == 1:
            self.reader = next(iter(self._threads))
        elif self._woken[self.reader or (0, 0)] < LESSONS or self.reader not in self._threads:
            self.reader = None
        self._choose()

    def _choose(self) -> None:
        self.truthful = self.reader is not None
        self._watched = list(self._threads.values())
        if self.reader is not None:
            self._watched = [self._threads[self.reader]]

    def rests(self) -> bool:
        """Return whether the client is seen at once to wait where it has waited before."""
        self._looks += 1
        if self._looks % LOOKS_A_COUNT and self.reader is not None:
            reader = self._watched[0]
            try:
                return os.pread(reader.wait, 64, 0) == reader.place
            except OSError:  # it has ended
                return False
        return False

    def activity(self, *, all_threads: bool = False) -> Activity:
        """Return what the client does.

        Parameters
        ----------
        all_threads : bool
            Whether to look at those, too, that do not read messages.

        Returns
        -------
        Activity
            Activity of the most active thread; `Activity.WORKS` also when it has just ended (then `gone`).
        """
        self._looks += 1
        if not self._looks % LOOKS_A_COUNT:
            self._count_threads()
        most = 0
        try:
            # Plain loops: this is asked in every cycle.
            for thread in self._threads.values() if all_threads else self._watched:
                most = max(most, thread.activity())
        except (OSError, ValueError):  # it has ended
            self._look_again()
            return Activity.WORKS
        return _ACTIVITIES[most]

    def has_read_all(self) -> bool:
        """Return whether nothing that was sent to it lies unread."""
        found = _find_socket(*self._where)
        return found is not None and found[1] == 0

    def before_message(self) -> None:
        """Record which processes are at rest before a message is sent, if the reader is not known yet."""
        if not self.truthful:
            with contextlib.suppress(OSError):
                self._resting_before = {key for key, thread in self._threads.items() if not thread.activity()}

    def after_message(self) -> None:
        """Record which processes the message has woken."""
        resting, self._resting_before = self._resting_before, set()
        if not resting:
            return
        with contextlib.suppress(OSError, KeyError):
            woken = [key for key in resting if self._threads[key].activity() == _WORKS]
            if len(woken) == 1:
                self._woken.update(woken)
                if self._woken[woken[0]] >= LESSONS:
                    self.reader = woken[0]
                    self._choose()

    def _count_threads(self) -> None:
        pids = {pid for pid, _ in self._threads}
        with contextlib.suppress(OSError):
            if sum(len(os.listdir(f"/proc/{pid}/task")) for pid in pids) != len(self._threads):
                self._open(sorted(pids))

    def _look_again(self) -> None:
        pids = sorted({pid for pid, _ in self._threads})
        self._open([pid for pid in pids if _holds(pid, self._inode)] or _holders(self._inode))


class _Thread:
    """A thread: the files that tell of it, and where it was last seen to wait for something."""

    __slots__ = ("_dozes", "_rests", "_stat", "_untold", "place", "wait")

    def __init__(self, folder: str) -> None:
        self.wait = os.open(f"{folder}/wchan", os.O_RDONLY | os.O_CLOEXEC)
        self._stat = os.open(f"{folder}/stat", os.O_RDONLY | os.O_CLOEXEC)
        self._dozes = False
        self.place = b""
        self._rests = 0
        self._untold = 0

    def activity(self) -> int:
        """Return the value of an `Activity`.

        Raises
        ------
        OSError
            If the thread has ended.
        """
        where = os.pread(self.wait, 64, 0)
        if b"nanosleep" in where:
            self._dozes = True
            return _DOZES
        if where != b"0":
            self._rests += 1
            self.place = where
            return _RESTS
        # It runs, or the system does not say where it waits.
        stat = os.pread(self._stat, 512, 0)
        # PID (NAME) STATE ...; the name may hold anything, the numbers after it no bracket.
        state = stat[stat.rindex(b")") + 2 :][:1]
        if state in b"ZX":
            raise ProcessLookupError
        if state not in b"SI":
            return _WORKS
        # Asleep, but the system does not tell where: so until it has taken the thread off its queue (Linux
        # 6.12). Threads that are known to let time pass, or not known well, are not believed to rest.
        self._untold += 1
        known = self._rests >= FAMILIAR or (not self._rests and self._untold > UNTOLD)
        return _RESTS if known and not self._dozes else _WORKS

    def __del__(self) -> None:
        for name in ("_stat", "wait"):
            with contextlib.suppress(AttributeError):
                os.close(getattr(self, name))


_ACTIVITIES = tuple(Activity)
_RESTS, _DOZES, _WORKS = (activity.value for activity in Activity)


def _find_socket(kind: str, client: Address, own: Address) -> tuple[str, int] | None:
    """Find a client's socket in the system's tables: its inode, and how many bytes lie unread in it."""
    port = f"{client[1]:04X}"
    ours = f"{own[1]:04X}"
    number = _hexadecimal(client[0])
    for family in ("", "6"):
        try:
            table = (_PROC / "net" / (kind + family)).read_text(encoding="ascii").splitlines()
        except OSError:
            continue
        for line in table[1:]:
            fields = line.split()
            address, _, its_port = fields[1].partition(":")
            if its_port != port:
                continue
            its_peer = fields[2].partition(":")[2]
            if its_peer != ours and (kind == "tcp" or its_peer != "0000"):
                continue
            # An IPv6 socket has an IPv4 address in its last word.
            if address in _UNMAPPED or address[-8:] == number:
                return fields[9], int(fields[4].partition(":")[2], 16)
    return None


def _hexadecimal(address: str) -> str:
    """Write an IPv4 address as the system's tables do: as a number in the order of this machine's bytes."""
    [number] = struct.unpack("=I", socket.inet_aton(address))
    return f"{number:08X}"


_known: set[int] = set()
"""Processes that held a client's socket before: looked at first, as agents register again and again."""


def _holders(inode: str) -> list[int]:
    """Find the processes that hold a socket."""
    before = [pid for pid in sorted(_known) if _holds(pid, inode)]
    if before:
        return before
    try:
        pids = [int(name) for name in os.listdir(_PROC) if name.isdecimal()]
    except OSError:
        return []
    holders = [pid for pid in pids if _holds(pid, inode)]
    _known.clear()
    _known.update(holders)
    return holders


def _holds(pid: int, inode: str) -> bool:
    target = f"socket:[{inode}]"
    folder = f"/proc/{pid}/fd"
    try:
        names = os.listdir(folder)
    except OSError:  # another user's, or just ended
        return False
    for name in names:
        with contextlib.suppress(OSError):
            if os.readlink(f"{folder}/{name}") == target:
                return True
    return False
