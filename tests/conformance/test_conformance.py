"""Good agents pass every row; every fault is found by the row that is meant for it."""

import json
import os
import shutil
import subprocess
import sys
import textwrap
import xml.etree.ElementTree as ElementTree

import pytest

from ciberrato.errors import UsageError
from ciberrato.grading import sandbox
from ciberrato.grading.conformance.check import Judged, check_agent, judge_row, rows_named
from ciberrato.grading.conformance.cli import main
from ciberrato.grading.conformance.report import json_report, junit_report, text_report
from ciberrato.grading.conformance.rows import NAMES, ROWS
from ciberrato.grading.course import Agent, GradedLab, Limits, grid_of
from ciberrato.labs import find_lab
from tests.conformance.agents import LINK, PERL, SIX_LINES, C
from tests.conformance.faulty import FAULTS, write

LAB = GradedLab("maze", find_lab("maze"), grid_of("maze", None))


def check(folder, *command, rows=(), **options):
    agent = Agent("agent", command, folder, build=options.pop("build", None))
    return check_agent(agent, LAB, rows=rows_named(rows), jobs=2, **options)


PATIENT = {"patience": 60.0, "limits": Limits(time=600.0, registration=60.0)}
"""Of a good agent nothing is waited for in vain, however busy this machine is."""


def failed(judged):
    return {one.row.name: (one.happened, one.output) for one in judged if not one.passed}


@pytest.mark.slow
def test_a_good_agent_passes_and_the_check_says_the_same_again(tmp_path):
    write(tmp_path)
    once = check(tmp_path, "python", "agent.py", "{host}", "{port}", **PATIENT)
    assert not failed(once)
    assert [one.row for one in once] == list(ROWS)
    assert check(tmp_path, "python", "agent.py", "{host}", "{port}", **PATIENT) == once


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_found_by_its_row(tmp_path, fault):
    row, words, *_ = FAULTS[fault]
    write(tmp_path, fault)
    (one,) = check(tmp_path, "python", "agent.py", "{host}", "{port}", rows=[row])
    assert not one.passed
    assert words in one.happened


@pytest.mark.parametrize("row", NAMES)
def test_every_row_finds_something(row):
    assert any(fault[0] == row for fault in FAULTS.values())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("program", "file", "command", "build"),
    [
        (SIX_LINES, "agent.py", ["python", "agent.py", "{host}:{port}"], None),
        (LINK, "agent.py", ["python", "agent.py", "{host}:{port}"], None),
        (PERL, "agent.pl", ["perl", "agent.pl", "{host}:{port}"], None),
        (C, "agent.c", ["./agent", "{host}", "{port}"], ("gcc", "-o", "agent", "agent.c")),
    ],
    ids=["client", "croblink", "perl", "c"],
)
def test_agents_in_any_language_pass(tmp_path, program, file, command, build):
    needed = (build or command)[0]
    if not shutil.which(needed):
        pytest.skip(f"there is no {needed} here")
    (tmp_path / file).write_text(textwrap.dedent(program))
    assert not failed(check(tmp_path, *command, build=build, **PATIENT))


@pytest.mark.slow
def test_the_agent_that_ships_passes(tmp_path):
    words = ["ciberrato-agent", "-h", "{host}:{port}", "-p", "{pos}", "-r", "{name}", "-m", "corridors"]
    agent = Agent("agent", tuple(words), tmp_path)
    assert not failed(
        check_agent(agent, GradedLab("corridors", find_lab("corridors"), None), jobs=2, **PATIENT)
    )


@pytest.mark.slow
def test_in_a_sandbox_it_is_the_same(tmp_path):
    if sandbox.choose("auto") != "bwrap":
        pytest.skip("bubblewrap does not work here")
    write(tmp_path, "leaves at Stop")
    rows = ["stop-start", "silence", "doubled"]
    command = ("python", "agent.py", "{host}", "{port}")
    with_walls = check(tmp_path, *command, rows=rows, sandbox="bwrap")
    assert with_walls == check(tmp_path, *command, rows=rows)
    assert set(failed(with_walls)) == {"stop-start"}


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (["no-such-program"], "cannot be started: No such file or directory"),
        (["true"], "it ended before it had registered: exit status 0"),
        (["sh", "-c", "kill -9 $$"], "it ended before it had registered: signal SIGKILL"),
        (["sleep", "100"], "no registration came within 0.5 s"),
        (["sh", "-c", "yes x"], "output limit"),
    ],
    ids=lambda value: value if isinstance(value, str) else value[0] + str(len(value)),
)
def test_what_never_registers(tmp_path, command, words):
    limits = Limits(registration=0.5 if command[0] == "sleep" else 60.0)
    (one,) = check(tmp_path, *command, rows=["register"], limits=limits)
    assert (one.passed, one.happened) == (False, words)


def document(**more):
    run = {"fault": None, "seen": "seen", "ending": "any", "grace": 0}
    base = {"registered": True, "note": None, "stopped": None, "exit": None, "signal": None, "tail": ""}
    wanted = more.pop("run", {})
    return base | {"run": None if wanted is None else run | wanted} | more


@pytest.mark.parametrize(
    ("more", "passed"),
    [
        ({}, True),
        ({"signal": 11}, True),  # it was not asked to go on
        ({"run": {"ending": "itself"}}, False),
        ({"run": {"ending": "itself"}, "exit": 3}, True),
        ({"run": {"ending": "itself"}, "signal": 11}, False),
        ({"run": {"ending": "clean"}, "exit": 0}, True),
        ({"run": {"ending": "clean"}, "exit": 1}, True),  # as the courses' clients do
        ({"run": {"ending": "clean"}, "exit": 1, "tail": "Traceback (most recent call last):\n"}, False),
        ({"run": {"ending": "clean"}, "exit": 2}, False),
        ({"run": None, "stopped": "memory limit"}, False),
        ({"run": {"fault": "a fault"}}, False),
    ],
)
def test_what_passes(more, passed):
    assert judge_row(ROWS[0], document(**more), 1.0)[0] == passed


@pytest.fixture
def judged(tmp_path):
    write(tmp_path, "crashes")
    return check(tmp_path, "python", "agent.py", "{host}", "{port}", rows=["refused", "answers"])


@pytest.mark.slow
def test_the_reports(judged):
    text = text_report(judged)
    assert text.startswith("passed  refused\n    done      the simulator answers the registration with")
    assert "FAILED  answers\n" in text
    assert "    output  | ValueError: a mistake\n" in text
    assert text.endswith("1 of 2 rows passed")
    assert text_report(judged, failed_only=True).startswith("FAILED  answers")
    command = ["python", "agent.py", "<&\x1b\x00\ufffe"]
    rows = json.loads(json_report(judged, command))
    assert (rows["passed"], [row["passed"] for row in rows["rows"]]) == (False, [True, False])
    (suite,) = ElementTree.fromstring(junit_report(judged, command))
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("2", "1", "0")
    good, bad = suite
    assert (good.get("name"), good.find("failure")) == ("refused", None)
    assert bad.find("failure").get("message").startswith("no answer to the Measures of time 60")
    assert "look at" in bad.find("failure").text


def test_control_characters_of_an_agent_are_in_no_report():
    hostile = "\x1b]0;mine\x07\x9b31m\x00\u202ex"
    judged = [Judged(ROWS[0], False, f"{hostile}: {hostile}", f"{hostile}\r\nlast\n")]
    row = json.loads(json_report(judged, ["agent"]))["rows"][0]
    assert row["output"] == "\ufffd]0;mine\ufffd\ufffd31m\ufffd\ufffdx\nlast\n"
    texts = [row["happened"], text_report(judged), junit_report(judged, ["agent", hostile])]
    for text in texts:
        assert not set("\x1b\x07\x9b\x00\u202e\r") & set(text)
        assert "mine" in text


def program(*words, folder):
    words = [sys.executable, "-m", "ciberrato.grading", "check", *words]
    return subprocess.run(
        words, cwd=folder, env=os.environ, capture_output=True, text=True, timeout=300, check=False
    )


@pytest.mark.slow
def test_the_program(tmp_path, monkeypatch):
    write(tmp_path)
    monkeypatch.setenv("PYTHONPATH", os.getcwd())
    words = ["--json", "out.json", "--junit", "out.xml", "--row", "register,late"]
    done = program(*words, "--", "python", "agent.py", "{host}", "{port}", folder=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "registered as 'plain' at position 1, and drove 30 cycles" in done.stdout
    assert json.loads((tmp_path / "out.json").read_text())["passed"]
    assert ElementTree.parse(tmp_path / "out.xml").getroot().get("failures") == "0"
    write(tmp_path, "leaves at Stop")
    done = program("--row", "stop-start", "--", "python", "agent.py", "{host}", "{port}", folder=tmp_path)
    assert done.returncode == 1
    assert {path.name for path in tmp_path.iterdir()} == {"agent.py", "out.json", "out.xml"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "there is no command line; write it after --"),
        (["--"], "there is no command line; write it after --"),
        (["--row", "lots", "--", "true"], "no such row; .*did you mean 'lost'"),
        (["--", "true", "{hots}"], "these can be filled in: {host}"),
        (["--folder", "nowhere", "--", "true"], "--folder nowhere: no such folder; check the path"),
        (["--json", "nowhere/x.json", "--", "true"], "cannot be written: no such folder"),
        (["--lab", "mazze", "--", "true"], "did you mean 'maze'"),
        (["--patience", "nan", "--", "true"], "'nan' is not a number of seconds"),
        (["--seed", "x", "--", "true"], "'x' is not a whole number"),
        (["--jobs", "0", "--", "true"], "'0' is not a whole number, 1 or more"),
    ],
)
def test_what_cannot_be_checked(words, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match=message):
        main(words)


def test_rows_are_listed(capsys):
    assert main(["--list"]) == 0
    assert [line for line in capsys.readouterr().out.splitlines() if line[0] != " "] == list(NAMES)
