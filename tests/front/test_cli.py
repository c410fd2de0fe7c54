"""One name for all programs."""

import argparse
import importlib
import subprocess
import sys

import pytest

import ciberrato
from ciberrato.command_line import ProgramParser
from ciberrato.front import cli


@pytest.mark.parametrize("name", cli.PROGRAMS)
def test_each_command_is_a_program_with_a_version(name, capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main([name, "--version"])
    assert (ended.value.code, capsys.readouterr().out) == (0, f"ciberrato {ciberrato.__version__}\n")
    assert callable(importlib.import_module(cli.PROGRAMS[name][0]).main)


@pytest.mark.parametrize("words", [[], ["--help"], ["-h"]], ids=["nothing", "help", "h"])
def test_help_lists_them(words, capsys):
    assert cli.main(words) == 0
    out = capsys.readouterr().out
    assert all(f"  {name} " in out for name in cli.PROGRAMS)


@pytest.mark.parametrize("columns", ["50", "132", "none", "0"])
def test_help_is_as_wide_as_argparse_makes_it(columns, monkeypatch):
    monkeypatch.setenv("COLUMNS", columns)

    def filled(parser):
        parser.add_argument("--one", help="word " * 100, metavar="THIS")
        return parser.format_help()

    ours = ProgramParser("program", "words " * 100, add_help=False)
    plain = argparse.ArgumentParser(prog="program", description="words " * 100, add_help=False)
    version = f"ciberrato {ciberrato.__version__}"
    plain.add_argument("--version", action="version", version=version, help="show the version and end")
    assert filled(ours) == filled(plain)


def test_a_command_that_is_none_is_one_line(capsys):
    assert cli.main(["labyrinth"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("ciberrato: unknown command 'labyrinth'; choose one of demo, simulator")
    assert said.count("\n") == 1


def test_the_users_files_do_not_come_in_between(tmp_path):
    for name in ("agent", "simulator_stub", "demo"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('not this one')")
    words = [sys.executable, "-m", "ciberrato", "lab", "--version"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, f"ciberrato {ciberrato.__version__}\n"), done.stderr


@pytest.mark.slow
def test_the_demonstration_runs_in_a_folder_of_the_users_files(tmp_path):
    for name in ("agent", "simulator_stub"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('not this one')")
    words = [sys.executable, "-m", "ciberrato", "demo", "--folder", "out"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "27, 7)    right" in done.stdout
