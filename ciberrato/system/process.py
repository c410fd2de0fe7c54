"""Processes: their terminal, processors, priority, programs, standard input and output."""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import subprocess

_OWN_GROUP: int | None = 0x200 if sys.platform == "win32" else None
"""``CREATE_NEW_PROCESS_GROUP``, Windows' flag for a child that the terminal's Ctrl-C is not meant for; None
elsewhere. Written out, as loading `subprocess` takes longer than all else of this module."""


def apart() -> dict[str, Any]:
    """Return the options of `subprocess.Popen` that keep the terminal's Ctrl-C from a child."""
    return {"start_new_session": True} if _OWN_GROUP is None else {"creationflags": _OWN_GROUP}


def interruptible() -> dict[str, Any]:
    """Return the options of `subprocess.Popen` for a child that `interrupt` is going to be called for."""
    return {} if _OWN_GROUP is None else {"creationflags": _OWN_GROUP}


def interrupt(child: subprocess.Popen[Any]) -> None:
    """Interrupt a child as Ctrl-C does: SIGINT, or on Windows Ctrl-Break, which can go to one process."""
    child.send_signal(getattr(signal, "CTRL_BREAK_EVENT", signal.SIGINT))


def ask_to_end(child: subprocess.Popen[Any]) -> None:
    """Ask a child to end and write what it has: SIGTERM; on Windows, where that kills, `interrupt`.

    There it has to be a child that is `interruptible` or `apart`, and is killed if there is no console.
    """
    if _OWN_GROUP is None:
        child.terminate()
        return
    try:
        interrupt(child)
    except OSError:
        child.kill()


def processors() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def idle_seconds() -> float | None:
    """Return for how long the processors that this process may use were idle since the system began.

    Returns
    -------
    float or None
        Seconds, added up, to a hundredth; None on systems that do not tell (all but Linux).
    """
    if not hasattr(os, "sched_getaffinity"):
        return None
    try:
        allowed = {f"cpu{number}" for number in os.sched_getaffinity(0)}
        with open("/proc/stat", encoding="ascii") as file:
            lines = [line.split() for line in file if line.startswith("cpu")]
        return sum(int(line[4]) for line in lines if line[0] in allowed) / float(os.sysconf("SC_CLK_TCK"))
    except (OSError, ValueError, IndexError):
        return None


def give_way() -> None:
    """Yield the processor to a process that waits for it."""
    if hasattr(os, "sched_yield"):
        os.sched_yield()
    else:
        time.sleep(0.0)


def lower_priority() -> None:
    """Lower the priority of this process, where a process can do so itself."""
    if hasattr(os, "nice"):
        with contextlib.suppress(OSError):
            os.nice(5)


_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274}
"""Numbers of Linux's system call by machine; no library has a function for it."""
_SHORTEST_SLICE = 100_000  # nanoseconds, the least that Linux grants


def ask_for_short_slices() -> bool:
    """Request short turns on the processor, and for that early ones, at the same priority and share.

    Linux (6.12 and later) serves first whose turn would end first: a process that needs a fraction of a
    millisecond need not wait for the turns of processes that compute. It takes no privilege. Elsewhere
    nothing changes.

    Returns
    -------
    bool
        Whether the system has granted it.
    """
    if sys.platform != "linux":
        return False
    number = _SCHED_SETATTR.get(os.uname().machine)
    if number is None or sys.maxsize < 2**32:
        return False
    import ctypes
    import struct

    # size, policy (normal), flags, nice, priority, slice, deadline, period
    asked = struct.pack("=IIQiIQQQ", 48, 0, 0, os.nice(0), 0, _SHORTEST_SLICE, 0, 0)
    try:
        return int(ctypes.CDLL(None).syscall(number, 0, asked, 0)) == 0
    except (AttributeError, OSError):
        return False


def runnable(command: Sequence[str], environment: Mapping[str, str]) -> list[str]:
    """Return a command line that is looked for where its own environment says.

    Windows looks for programs along the search path of the process that starts them, and has no ``python3``.

    Parameters
    ----------
    command : sequence of str
    environment : mapping of str to str
        Environment with which it is going to be run.
    """
    program, *rest = command
    if _OWN_GROUP is None:
        return [program, *rest]
    if program in ("python", "python3"):
        return [sys.executable, *rest]
    import shutil

    return [shutil.which(program, path=environment.get("PATH")) or program, *rest]


def system_variables() -> dict[str, str]:
    """Return those environment variables without which no program starts: Windows has some."""
    if _OWN_GROUP is None:
        return {}
    names = ("SYSTEMROOT", "SYSTEMDRIVE", "COMSPEC", "PATHEXT", "TEMP", "TMP")
    return {name: os.environ[name] for name in names if name in os.environ}


def when_input_ends(call: Callable[[], object]) -> None:
    """Call a function, in a thread, when standard input ends; at once if it is closed.

    It is how a child learns that its parent is no more. A thread, as Windows cannot wait for pipes.
    """

    def read() -> None:
        with contextlib.suppress(OSError):
            while os.read(0, 4096):
                pass
        call()

    import threading

    threading.Thread(target=read, name="standard input", daemon=True).start()


def take_any_character(stream: object) -> None:
    """Escape characters that a text stream's encoding lacks: a name in a lab is no reason to fail.

    Standard output that is not a terminal has an encoding of 256 characters on Windows, and in a POSIX
    locale.
    """
    if getattr(stream, "errors", None) == "strict" and hasattr(stream, "reconfigure"):
        stream.reconfigure(errors="backslashreplace")


def reader_has_gone(error: OSError) -> bool:
    """Return whether writing failed as the reader of a pipe has ended: "invalid argument" on Windows."""
    return isinstance(error, BrokenPipeError) or (
        _OWN_GROUP is not None and error.errno == errno.EINVAL and error.filename is None
    )
