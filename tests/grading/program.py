"""The program, and what it left."""

import csv
import subprocess
import sys


def command(*words):
    return [sys.executable, "-m", "ciberrato.grading", *map(str, words)]


def run(*words, expect=0):
    """Run the program to its end; returns what it printed."""
    done = subprocess.run(command(*words), capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == expect, done.stdout + done.stderr
    return done


def rows(folder):
    """Rows of the results, without what numbers them."""
    with (folder / "results.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def wait_for_a_run(process):
    """Wait until a program that shows its progress on a pipe has done a run."""
    said = b""
    while b"runs," not in said:
        more = process.stderr.read1()
        assert more, f"it has ended: {said.decode()}"
        said += more
