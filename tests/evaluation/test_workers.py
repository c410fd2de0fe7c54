"""Worker processes of an evaluation end with it, in silence."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import pytest

PROGRAM = """
import sys, time
from ciberrato.command_line import run_program
from ciberrato.evaluation.workers import worker_processes

def main():
    with worker_processes(2) as executor:
        first = [executor.submit(sum, [[], [1]], []) for _ in range(2)]
        print("ready", flush=True)
        for one in first:
            one.result()
        executor.submit(time.sleep, 600.0).result()
    return 0

if __name__ == "__main__":
    sys.exit(run_program("tried", main))
"""


@pytest.mark.skipif(os.name == "nt", reason="no process groups like these")
@pytest.mark.parametrize(("number", "word"), [(signal.SIGINT, "interrupted"), (signal.SIGTERM, "terminated")])
def test_a_signal_while_they_start_ends_all_without_a_traceback(number, word, tmp_path):
    """A Ctrl-C goes to all processes of a terminal; here the workers are still loading when it comes."""
    (tmp_path / "program.py").write_text(PROGRAM)
    process = subprocess.Popen(
        [sys.executable, str(tmp_path / "program.py")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    if number == signal.SIGINT:
        os.killpg(process.pid, number)
    else:
        process.send_signal(number)
    # The streams end when all processes have ended: they are the workers', too.
    assert process.communicate(timeout=240) == ("", f"tried: {word}\n")
    assert process.returncode == 128 + number
