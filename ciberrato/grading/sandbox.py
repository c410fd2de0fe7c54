"""The walls around agents, whose programs are not trusted.

With bubblewrap a run has a network of its own with nothing but a loopback, in which the simulator runs, too:
so every simulator has port 6000 of 127.0.0.1. The agent is in a second sandbox within: it sees the system's
programs and Python, read-only, its own working folder and an empty /tmp; neither other processes nor other
agents' files, the course, or the home folder.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from ciberrato.errors import UsageError
from ciberrato.grading.containers import find_engine
from ciberrato.processes import ROOT
from ciberrato.system import descendants
from ciberrato.system.process import system_variables

KINDS = ("auto", "bwrap", "docker", "none")

_LIMITED = {
    "all": "processes, memory and time are limited all the same",
    "memory": "memory and time are limited all the same, processes are not here",
    "nothing": "time is limited all the same, processes and memory are not here",
}
WITHOUT = (
    "no sandbox: agents can read and change whatever you can, and use the network; "
    f"{_LIMITED[descendants.MEASURES]}"
)
"""Meaning of `none`, in a line."""

_SYSTEM = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/libx32", "/opt", "/nix/store")
_SETTINGS = (
    *("alternatives", "ld.so.cache", "ld.so.conf", "ld.so.conf.d", "localtime", "passwd", "group"),
    *("nsswitch.conf", "ssl/certs", "ssl/openssl.cnf", "java", "perl", "python3", "fonts", "profile"),
)
"""Files of /etc that programs need; no passwords, no keys."""

_TOOLS = "/usr/bin:/bin"

_INNER = (
    *("--unshare-user", "--unshare-pid", "--unshare-ipc", "--unshare-uts", "--unshare-cgroup-try"),
    *("--uid", "1000", "--gid", "1000", "--hostname", "agent", "--cap-drop", "ALL"),
    *("--die-with-parent", "--new-session", "--proc", "/proc", "--dev", "/dev"),
)


def choose(kind: str, image: str | None = None) -> str:
    """Find out which sandbox there is to be.

    Parameters
    ----------
    kind : {"auto", "bwrap", "docker", "none"}
        ``auto``: bwrap if it works here, or none.
    image : str or None
        Image of containers.

    Returns
    -------
    str
        ``bwrap``, ``docker``, ``podman`` (where there is no docker) or ``none``.

    Raises
    ------
    UsageError
        If bwrap or containers are asked for and do not work.
    """
    if kind == "none":
        return kind
    if kind == "docker":
        return find_engine(image)
    reason = _why_not()
    if reason is None:
        return "bwrap"
    if kind == "bwrap":
        raise UsageError(f"--sandbox bwrap: {reason}; install bubblewrap, or choose --sandbox none")
    return "none"


def _why_not() -> str | None:
    """Return why bubblewrap cannot be used, by using it exactly as a run does."""
    if descendants.MEASURES != "all" or shutil.which("bwrap") is None:
        return "there is no bwrap here"
    command = around_run(around_agent(["true"], Path("/tmp"), "/tmp", megabytes=1, processes=8, readable=()))
    try:
        done = subprocess.run(command, capture_output=True, timeout=30, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"bwrap does not work here: {error}"
    if done.returncode:
        lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
        return f"bwrap does not work here: {lines[-1] if lines else f'exit status {done.returncode}'}"
    return None


def around_run(command: Sequence[str]) -> list[str]:
    """Wrap a run, including its simulator, in a network of its own."""
    return ["bwrap", "--dev-bind", "/", "/", "--unshare-net", "--die-with-parent", "--", *command]


def around_agent(
    command: Sequence[str],
    work: Path,
    shown_as: str,
    *,
    megabytes: int,
    processes: int,
    readable: Sequence[Path],
) -> list[str]:
    """Wrap an agent in its sandbox.

    Parameters
    ----------
    command : sequence of str
    work : Path
        Its working folder, which it may write in.
    shown_as : str
        The path that it sees it at.
    megabytes : int
        Size of its /tmp.
    processes : int
        Greatest number at a time; the system does not limit those of root, so they are also counted.
    readable : sequence of Path
        Further files and folders that it may see.

    Returns
    -------
    list of str
    """
    words = ["bwrap", *_INNER]
    for name in _SYSTEM:
        if os.path.islink(name):
            words += ["--symlink", os.readlink(name), name]
        elif os.path.isdir(name):
            words += ["--ro-bind", name, name]
    for name in _SETTINGS:
        words += ["--ro-bind-try", f"/etc/{name}", f"/etc/{name}"]
    words += ["--size", str(megabytes << 20), "--tmpfs", "/tmp"]
    for path in _outermost([*_python(), *readable]):
        words += ["--ro-bind", str(path), str(path)]
    words += ["--bind", str(work), shown_as, "--chdir", shown_as]
    # Within, as only there it counts the sandbox's processes and not all of the user's.
    prlimit = [f"{tool}", f"--nproc={processes}"] if (tool := shutil.which("prlimit", path=_TOOLS)) else []
    return [*words, "--", *prlimit, *command]


def _python() -> list[Path]:
    """Return where this Python, its packages and ours are; agents do not see the rest of a checkout."""
    places = [Path(sys.prefix), Path(sys.base_prefix), Path(sys.executable).resolve().parents[1]]
    places += [ROOT / name for name in ("ciberrato", "agent", "simulator_stub", "maps")]
    return [place for place in places if os.path.exists(place)]  # not one whose folder may not be read


def _outermost(places: Sequence[Path]) -> list[Path]:
    """Remove folders that lie inside the system's folders or inside others of the list."""
    system = tuple(Path(name) for name in _SYSTEM)
    kept: list[Path] = []
    for place in sorted(set(places)):
        if not any(place.is_relative_to(other) for other in (*system, *kept)):
            kept.append(place)
    return kept


def environment_of_agent(extra: Mapping[str, str]) -> dict[str, str]:
    """Return an agent's environment: nothing of the teacher's but the search path.

    Parameters
    ----------
    extra : mapping of str to str

    Returns
    -------
    dict of str to str
        ``python`` and ``python3`` are the Python that runs the grading.
    """
    here = str(Path(sys.executable).parent)
    path = os.environ.get("PATH", os.defpath)
    return {
        **system_variables(),
        "PATH": os.pathsep.join([here, *(part for part in path.split(os.pathsep) if part and part != here)]),
        "HOME": "/tmp" if os.path.isdir("/tmp") else tempfile.gettempdir(),
        "LANG": "C.UTF-8",
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTHONHASHSEED": "0",
        "PYTHONUNBUFFERED": "1",
        # One thread for small products: more would take the other runs' processors.
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
        **extra,
    }
