"""The walls around agents made by containers, of Docker or of Podman.

A run is two containers of one image: the simulator's, whose network is a loopback alone, and the agent's,
which joins that network and sees nothing else of the computer than a copy of its folder. Everything else is
the image's, read-only.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ciberrato.errors import UsageError
from ciberrato.grading import supervisor
from ciberrato.system.locks import user_and_group
from ciberrato.version import __version__

SUPERVISOR = "ciberrato.grading.containers"
PATIENCE = 60.0
"""Seconds for a command of the engine's."""

_WORK = "/agent"
_SIMULATOR = "simulator_stub"
_VERSION = "import ciberrato.version as v; print(v.__version__)"


def find_engine(image: str | None) -> str:
    """Find the program that runs containers, and try it with the image.

    Parameters
    ----------
    image : str or None
        That the course names.

    Returns
    -------
    str
        ``docker``, or ``podman`` where there is no docker.

    Raises
    ------
    UsageError
        If there is none, it does not work, or the image does not have this version of ciberrato.
    """
    engine = next((name for name in ("docker", "podman") if shutil.which(name)), None)
    if engine is None:
        raise UsageError("--sandbox docker: there is neither docker nor podman here")
    if image is None:
        raise UsageError("--sandbox docker: the course names no image; write image = ... into it")
    if image.startswith("-"):
        raise UsageError(f"--sandbox docker: {image!r} is no image")
    words = ["run", "--rm", "--pull", "never", "--network", "none"]
    done = _engine(engine, *words, *_started(image, ["python", "-c", _VERSION]))
    if done.returncode:
        raise UsageError(f"--sandbox docker: {engine} with {image}: {_last(done.stderr)}")
    if done.stdout.strip() != __version__:
        raise UsageError(
            f"--sandbox docker: {image} has ciberrato {done.stdout.strip()}, and here is {__version__}"
        )
    return engine


def contain(wanted: Mapping[str, Any], engine: str, image: str) -> dict[str, Any]:
    """Put what a supervisor is asked for into containers.

    Parameters
    ----------
    wanted : mapping
        As `ciberrato.grading.supervisor.Run` takes it, with commands as they are without walls.
    engine, image : str

    Returns
    -------
    dict
        For `ContainedRun`.
    """
    name = f"ciberrato-grade-{os.getpid()}-{secrets.token_hex(6)}"
    work, limits = Path(wanted["work"]), wanted["limits"]
    simulator, network = None, "none"
    if wanted["simulator"] is not None:
        options = list(wanted["simulator"][wanted["simulator"].index(_SIMULATOR) + 1 :])
        read = [options[options.index(key) + 1] for key in ("--lab", "--grid") if key in options]
        folder = str(work.parent)
        simulator = [
            *_walls(engine, f"{name}-simulator", "none"),
            *("--volume", f"{folder}:{folder}", "--workdir", folder),
            *(word for path in read for word in ("--volume", f"{path}:{path}:ro")),
            *_started(image, ["python", "-P", "-m", _SIMULATOR, *options]),
        ]
        network = f"container:{name}-simulator"
    environment = {key: value for key, value in wanted["environment"].items() if key != "PATH"}
    memory = f"{limits['memory']}m"
    size = int(limits["disk"]) << 20
    agent = [
        *_walls(engine, f"{name}-agent", network, tmp=f":size={size}"),
        *("--memory", memory, "--memory-swap", memory, "--pids-limit", str(limits["processes"])),
        *("--ulimit", f"nofile={limits['files']}:{limits['files']}", "--ulimit", f"fsize={size}:{size}"),
        *("--ulimit", "core=0:0", "--shm-size", f"{limits['disk']}m"),
        *("--volume", f"{work}:{_WORK}", "--workdir", _WORK),
        *(word for key, value in environment.items() for word in ("--env", f"{key}={value}")),
        *_started(image, wanted["agent"]),
    ]
    return {
        **wanted,
        "simulator": simulator,
        "agent": agent,
        "environment": dict(os.environ),
        "work": None,
        "overhead": 1,  # its exit status is that of the engine: 128 and more are signals
        "engine": engine,
        "containers": [f"{name}-agent", *([f"{name}-simulator"] if simulator else [])],
    }


def _walls(engine: str, name: str, network: str, tmp: str = "") -> list[str]:
    user = user_and_group() or "65534:65534"
    return [
        *(engine, "run", "--name", name, "--pull", "never", "--network", network, "--user", user),
        *(("--userns", "keep-id") if engine == "podman" else ()),
        *("--read-only", "--tmpfs", f"/tmp{tmp}", "--cap-drop", "ALL"),
        *("--security-opt", "no-new-privileges", "--log-driver", "none"),
    ]


def _started(image: str, command: Sequence[str]) -> list[str]:
    """Return the image and what is started in it, whatever it starts by itself."""
    return ["--entrypoint", command[0], image, *command[1:]]


def _engine(engine: str, *words: str) -> subprocess.CompletedProcess[str]:
    try:
        return subprocess.run(
            [engine, *words],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
            stdin=subprocess.DEVNULL,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return subprocess.CompletedProcess([], 1, "", str(error))


def _last(text: str) -> str:
    return ([line for line in text.splitlines() if line.strip()] or ["it says nothing"])[-1]


class ContainedRun(supervisor.Run):
    """A run in containers: their processes are the engine's children, which it ends, counts and limits."""

    def __init__(self, wanted: Mapping[str, Any]) -> None:
        super().__init__(wanted)
        self._names: Sequence[str] = wanted["containers"]
        self._out_of_memory = False
        self._removed = False

    def _agents_processes(self) -> list[int]:
        return []

    def _stop(self, why: str) -> None:
        if not self._agent_ended():
            self._stopped = why
            _engine(self._wanted["engine"], "kill", self._names[0])

    def _end_everything(self) -> None:
        engine = self._wanted["engine"]
        if not self._removed:
            self._removed = True
            state = _engine(engine, "inspect", "--format", "{{.State.OOMKilled}}", self._names[0])
            self._out_of_memory = state.stdout.strip() == "true"
            _engine(engine, "rm", "--force", *self._names)
        if self._agent is not None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._agent.wait(10.0)
            self._agent.kill()
            self._agent.wait()
        super()._end_everything()

    def _document(self, began: float, note: str | None = None) -> dict[str, Any]:
        document = super()._document(began, note)
        if document["exit"] == 125:  # the engine's own: no container came of it
            return document | {"error": _last(document["tail"]), "busy": False}
        if self._out_of_memory and not document["stopped"]:
            document |= {"stopped": "memory limit", "exit": None, "signal": None}
        return document | {"memory": None, "threads": None}


if __name__ == "__main__":
    sys.exit(supervisor.look_after(lambda wanted: ContainedRun(wanted).run()))
