"""Starts the programs as they are installed, here or on a system that is pretended."""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path

BIN = Path(sys.executable).parent
EMULATED = Path(__file__).parent / "emulated"
SECONDS = 300.0
"""After which a program is killed that hangs; machines may be busy."""


def program(name):
    path = shutil.which(f"ciberrato-{name}", path=str(BIN))
    assert path is not None, f"ciberrato-{name} is not installed beside {sys.executable}"
    return path


class System:
    """A system to run programs on.

    Parameters
    ----------
    name : str
        ``here``, ``windows`` or ``macos``.
    folder : Path
        For what is left of them.
    """

    def __init__(self, name, folder):
        self.name = name
        self.traces = folder / "traces"
        self.traces.mkdir(exist_ok=True)
        self.environment = {**os.environ, "PYTHONWARNINGS": "error", "CIBERRATO_COMPILED": "off"}
        if name != "here":
            self.environment |= {
                "PYTHONPATH": str(EMULATED),
                "PATH": f"{EMULATED / 'bin'}{os.pathsep}{os.environ['PATH']}",
                "EMULATED_SYSTEM": name,
                "EMULATED_TRACES": str(self.traces),
            }
        # On Windows a program in a group of its own gets Ctrl-Break, elsewhere SIGINT as by Ctrl-C.
        self.own_group = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)

    def saw(self, what):
        """Whether the pretended system was asked for something, or refused it."""
        return (self.traces / what).exists()

    @contextlib.contextmanager
    def running(self, folder, *words):
        with subprocess.Popen(
            words,
            cwd=folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="cp1252",
            creationflags=self.own_group,
        ) as started:
            timer = threading.Timer(SECONDS, started.kill)
            timer.start()
            try:
                yield started
            finally:
                timer.cancel()
                started.kill()

    def run(self, folder, *words, status=0):
        with self.running(folder, *words) as started:
            said = started.stdout.read()
            assert started.wait() == status, said
            assert "Traceback" not in said, said
            return said

    def interrupt(self, started):
        """Press Ctrl-C; Ctrl-Break on Windows, and where that is pretended, the signal that stands for it."""
        number = getattr(signal, "CTRL_BREAK_EVENT", signal.SIGINT)
        started.send_signal(signal.SIGQUIT if self.name == "windows" else number)
        said = started.stdout.read()
        assert "Traceback" not in said, said
        return started.wait(), said


def until(started, pattern):
    """Read up to a line that matches."""
    lines = []
    for line in started.stdout:
        lines.append(line)
        if found := re.search(pattern, line):
            return found
    raise AssertionError(f"no {pattern} in: {''.join(lines)}")
