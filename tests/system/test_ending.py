"""Signals that end a program: by an exception that is never lost, whatever the program is at."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

LOST = """
import ctypes, gc, os, signal, sys, time, weakref
from ciberrato.command_line import run_program

number = getattr(signal, sys.argv[1])

def strike(*_):
    os.kill(os.getpid(), number)
    sum(range(1000))  # the handler runs here

class Destroyed:
    def __del__(self):
        strike()

def in_a_destructor():
    Destroyed()

def in_the_callback_of_a_weak_reference():
    reference = weakref.ref(Struck(), strike)

class Struck:
    pass

def in_a_function_that_c_calls():
    ctypes.CFUNCTYPE(None)(strike)()

def body():
    globals()[sys.argv[2]]()
    until = time.monotonic() + 120.0
    while time.monotonic() < until:
        pass
    return 0

sys.exit(run_program("tried", body))
"""
PLACES = ("in_a_destructor", "in_the_callback_of_a_weak_reference", "in_a_function_that_c_calls")


BOTH = pytest.mark.parametrize(
    ("number", "word"), [(signal.SIGINT, "interrupted"), (signal.SIGTERM, "terminated")]
)
POSIX = pytest.mark.skipif(os.name == "nt", reason="there one process cannot send these to another")


@POSIX
@BOTH
@pytest.mark.parametrize("place", PLACES)
def test_an_exception_that_is_lost_is_raised_anew(number, word, place):
    command = [sys.executable, "-c", LOST, signal.Signals(number).name, place]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240)
    assert (done.stdout, done.stderr, done.returncode) == ("", f"tried: {word}\n", 128 + number)


AT_IMPORT = """
import os, signal, sys

module, name = sys.argv[1:3]
del sys.argv[1:3]

class Struck:
    def find_spec(self, name, path=None, target=None):
        if name == module:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Struck())
from ciberrato.front import programs
sys.exit(getattr(programs, name)())
"""
WORDS = {
    "lab": ("check", "maze"),
    "viewer": ("--replay", "nothing.xml"),
    "grade": ("course.toml",),
    "evaluate": ("--lab", "maze", "--quiet", "--jobs", "1"),
    "ciberrato": ("lab", "check", "maze"),
}


@POSIX
@pytest.mark.parametrize("program", WORDS)
def test_a_signal_that_comes_while_it_imports_ends_it_without_a_traceback(program, tmp_path):
    command = [sys.executable, "-c", AT_IMPORT, "argparse", program, *WORDS[program]]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=240)
    assert (done.stdout, done.stderr, done.returncode) == ("", "", 130)


@POSIX
def test_what_c_makes_of_an_interrupt_is_an_interrupt():
    """Numpy, which imports datetime from C, says that it is broken."""
    command = [sys.executable, "-c", AT_IMPORT, "datetime", "lab", "check", "maze"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240)
    assert (done.stdout, done.stderr, done.returncode) == ("", "ciberrato-lab: interrupted\n", 130)


WAITING = """
import sys, time
from ciberrato.command_line import run_program

def body():
    print("ready", flush=True)
    time.sleep(600.0)
    return 0

sys.exit(run_program("tried", body))
"""


@POSIX
@BOTH
def test_what_has_no_handler_of_its_own_ends_in_one_line(number, word):
    process = subprocess.Popen(
        [sys.executable, "-c", WAITING], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    process.send_signal(number)
    assert process.communicate(timeout=240) == ("", f"tried: {word}\n")
    assert process.returncode == 128 + number


@POSIX
def test_a_signal_that_is_ignored_stays_ignored():
    """As in the background of a shell, and by nohup."""
    program = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n" + WAITING
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    process.send_signal(signal.SIGINT)
    process.send_signal(signal.SIGTERM)
    assert process.communicate(timeout=240) == ("", "tried: terminated\n")
