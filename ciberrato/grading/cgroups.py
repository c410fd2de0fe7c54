"""Control groups, where the user may make them: the kernel's own limits of memory and processes for an agent.

They supplement measurements and resource limits. The kernel's limit of memory is a little above the course's,
so that a limit is reported as usual, and memory that grows faster than it is measured is stopped, too.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

ABOVE = 1.25
"""The kernel's limit of memory, as a multiple of the course's."""

WITHOUT = "limits: no control group can be made here; memory and processes are looked at 20 times a second"

_SPARE = 4
"""Processes of the sandbox's own."""
_SESSION = ("XDG_RUNTIME_DIR", "DBUS_SESSION_BUS_ADDRESS")
_ROOT = Path("/sys/fs/cgroup")


class Groups:
    """No control groups: commands stay as they are.

    Attributes
    ----------
    told : str
        Description of what is used, in a line.
    """

    told = WITHOUT

    def around(self, command: Sequence[str], *, megabytes: int, processes: int) -> list[str]:
        """Return the command that runs a command in a group of its own."""
        return list(command)

    def environment(self) -> dict[str, str]:
        """Return what that command needs of the environment; it does not pass it on."""
        return {}

    def close(self) -> None:
        """Remove what is left."""


class Scopes(Groups):
    """Groups that systemd makes, a scope for each command; of the user's own, for users other than root."""

    told = "limits: memory and processes by control groups (systemd-run)"

    def __init__(self) -> None:
        user = () if os.getuid() == 0 else ("--user",)
        self._words = ["systemd-run", *user, "--scope", "--quiet", "--collect"]

    def works(self) -> bool:
        """Return whether the limits work, by a trial."""
        words = self.around(["true"], megabytes=64, processes=8)
        with contextlib.suppress(OSError, subprocess.TimeoutExpired):
            nothing = subprocess.DEVNULL
            done = subprocess.run(words, capture_output=True, timeout=10, check=False, stdin=nothing)
            return done.returncode == 0
        return False

    def around(self, command: Sequence[str], *, megabytes: int, processes: int) -> list[str]:
        """Return the command that runs a command in a scope; it becomes that command, as a process."""
        memory = f"MemoryMax={int(ABOVE * megabytes)}M"
        limits = [word for text in (memory, "MemorySwapMax=0") for word in ("-p", text)]
        hide = [word for name in _SESSION for word in ("-u", name)]
        return [*self._words, *limits, "-p", f"TasksMax={processes + _SPARE}", "--", "env", *hide, *command]

    def environment(self) -> dict[str, str]:
        """Return how the user's systemd is found."""
        return {name: os.environ[name] for name in _SESSION if name in os.environ}


class Folder(Groups):
    """Groups below our own, in a hierarchy of version 2 that we may write to.

    Parameters
    ----------
    base : Path
        Folder of our own group.
    """

    told = "limits: memory and processes by control groups (below our own)"

    def __init__(self, base: Path) -> None:
        self._base = base
        self._numbers = itertools.count(1)
        self._made: list[Path] = []
        self._ours: Path | None = None

    def works(self) -> bool:
        """Return whether the limits work, by a trial; processes in the group are moved below it if needed."""
        try:
            if not {"memory", "pids"} <= set(
                (self._base / "cgroup.controllers").read_text(encoding="ascii").split()
            ):
                return False
            if not os.access(self._base, os.W_OK):
                return False
            try:
                self._hand_out()
            except OSError:
                self._ours = self._base / f"ciberrato-grade-{os.getpid()}"
                self._ours.mkdir()
                (self._ours / "cgroup.procs").write_text(str(os.getpid()), encoding="ascii", newline="\n")
                self._hand_out()
            self.around(["true"], megabytes=64, processes=8)
        except OSError:
            self.close()
            return False
        return True

    def _hand_out(self) -> None:
        (self._base / "cgroup.subtree_control").write_text("+memory +pids", encoding="ascii", newline="\n")

    def around(self, command: Sequence[str], *, megabytes: int, processes: int) -> list[str]:
        """Return the command that goes into a new group and becomes that command."""
        group = self._base / f"ciberrato-grade-{os.getpid()}-{next(self._numbers)}"
        group.mkdir()
        self._made.append(group)
        (group / "memory.max").write_text(str(int(ABOVE * megabytes) << 20), encoding="ascii", newline="\n")
        (group / "pids.max").write_text(str(processes + _SPARE), encoding="ascii", newline="\n")
        with contextlib.suppress(OSError):  # where there is no swap
            (group / "memory.swap.max").write_text("0", encoding="ascii", newline="\n")
        enter = 'echo $$ > "$1" && shift && exec "$@"'
        return ["sh", "-c", enter, "sh", str(group / "cgroup.procs"), *command]

    def close(self) -> None:
        """Remove the groups, and go back into our own.

        Not before: one whose command is not yet in it is as empty as one whose command has ended.
        """
        for group in self._made:
            with contextlib.suppress(OSError):
                group.rmdir()
        if self._ours is not None:
            with contextlib.suppress(OSError):
                (self._base / "cgroup.procs").write_text(str(os.getpid()), encoding="ascii", newline="\n")
                self._ours.rmdir()


def find_groups(root: Path = _ROOT, own: Path = Path("/proc/self/cgroup")) -> Groups:
    """Find out which control groups can be made.

    Parameters
    ----------
    root : Path
        Root of the hierarchy.
    own : Path
        File that says which group we are in.

    Returns
    -------
    Groups
        Of systemd, below our own group, or none at all.
    """
    if hasattr(os, "getuid") and shutil.which("systemd-run") is not None:
        scopes = Scopes()
        if scopes.works():
            return scopes
    with contextlib.suppress(OSError, IndexError):
        line = next(
            (line for line in own.read_text(encoding="ascii").splitlines() if line.startswith("0::/")), None
        )
        if line is not None and (root / "cgroup.controllers").is_file():
            folder = Folder(root / line[4:])
            if folder.works():
                return folder
    return Groups()
