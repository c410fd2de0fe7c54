"""Outputs that are closed, full or a pipe that ends; too little memory and too few descriptors."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ciberrato.command_line import LEAST_DESCRIPTORS, Output, run_program, used_up
from ciberrato.errors import UsageError

MODULES = {
    "agent": "agent",
    "simulator": "simulator_stub",
    "viewer": "ciberrato.viewer",
    "evaluate": "ciberrato.evaluation",
    "lab": "ciberrato.labtool",
    "grade": "ciberrato.grading",
}
SHELL = shutil.which("sh")


def shell(command, folder):
    return subprocess.run([SHELL, "-c", command], cwd=folder, capture_output=True, text=True, timeout=300)


def program(name, words):
    return f"{sys.executable} -m {MODULES[name]} {words}"


@pytest.mark.parametrize("name", MODULES)
def test_too_few_descriptors_are_one_line(name, tmp_path):
    done = shell(f"ulimit -n 8; exec {program(name, '')}", tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert "only 8 file descriptors are allowed" in done.stderr


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("agent", "localize none.jsonl -m corridors"),
        ("lab", "new --random -o random"),
        ("simulator", "--port 0 --bind 127.0.0.1 --exit-at-end"),
        ("viewer", "--simulator 127.0.0.1:9 --http 0 --no-overlay"),
    ],
)
# With each of these BLAS behaved differently: an error of ours, its own end, an endless loop.
@pytest.mark.parametrize("kilobytes", [60_000, 90_000, 180_000])
def test_too_little_memory_is_one_line(name, words, kilobytes, tmp_path):
    done = shell(f"ulimit -v {kilobytes}; exec {program(name, words)}", tmp_path)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert f"only {kilobytes / 1024:.0f} MB of memory are allowed" in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["agent", "lab"])
@pytest.mark.parametrize("redirection", [">&-", "| true"])
def test_an_output_that_is_gone_is_no_fault(name, redirection, tmp_path):
    words = {"agent": "--help", "lab": "check corridors"}[name]
    done = shell(f"{program(name, words)} {redirection}", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_file_is_not_opened_in_the_place_of_a_closed_stream(tmp_path):
    done = shell(f"{program('lab', 'new -o made')} >&- 2>&- <&-", tmp_path)
    assert done.returncode == 0
    assert (tmp_path / "made_lab.xml").read_text().startswith("<")


class Full:
    encoding = "utf-8"

    def __init__(self, error):
        self.error = error

    def write(self, text):
        raise self.error

    def flush(self):
        raise self.error

    def isatty(self):
        return False


@pytest.mark.parametrize("shows", [False, True])
def test_a_full_disk_under_the_output(monkeypatch, capsys, shows):
    done = []

    def body():
        print("told")
        done.append(True)
        return 0

    monkeypatch.setattr(sys, "stdout", Full(OSError(28, "No space left on device")))
    assert run_program("this", body, shows=lambda: shows) == (2 if shows else 0)
    monkeypatch.undo()
    assert done == [True], "the work goes on"
    assert capsys.readouterr().err == "this: the output is cut short: No space left on device\n"


def test_a_reader_that_has_seen_enough(monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdout", Full(BrokenPipeError(32, "Broken pipe")))
    assert run_program("this", lambda: print("told") or 0, shows=lambda: True) == 0
    monkeypatch.undo()
    assert capsys.readouterr().err == ""


def test_no_stream_at_all():
    nothing = Output(None)
    assert nothing.write("x") == 1
    assert not nothing.isatty()
    assert nothing.encoding.lower() == "utf-8"
    nothing.close()


def raising(error):
    def body():
        raise error

    return body


@pytest.mark.parametrize(
    ("error", "what"),
    [
        (MemoryError(), "memory"),
        (OSError(24, "Too many open files"), "file descriptors"),
        (OSError(12, "Cannot allocate memory"), "memory"),
        (RuntimeError("can't start new thread"), "threads"),
        (ImportError("libscipy_openblas.so: failed to map segment from shared object"), "memory"),
        (OSError(2, "No such file"), None),
        (ValueError("x"), None),
    ],
)
def test_what_is_used_up_is_named(error, what, capsys):
    assert used_up(error) == what
    if what is None:
        with pytest.raises(type(error)):
            run_program("this", raising(error))
    else:
        assert run_program("this", raising(error)) == 2
        assert capsys.readouterr().err.startswith(f"this: there is not enough of {what} for this: allow it")


def test_what_caused_it_counts():
    error = ImportError("numpy could not be loaded")
    error.__cause__ = MemoryError()
    assert used_up(error) == "memory"


def test_an_error_of_many_lines_names_the_program_on_each(capsys):
    assert run_program("this", raising(UsageError("one\ntwo"))) == 2
    assert capsys.readouterr().err == "this: one\nthis: two\n"


def test_the_limit_is_what_a_run_needs():
    """Streams, wake-up pair, socket, log, an import's file, pipes to the process that computes tables."""
    assert LEAST_DESCRIPTORS >= 3 + 2 + 1 + 1 + 1 + 4
    assert len(os.listdir("/proc/self/fd")) > 0 or not Path("/proc").exists()
