"""The plugin in projects of its users: made in a folder, run by a pytest of its own."""

import json
import os
import re
import shutil
import subprocess
import sys
import textwrap
import xml.etree.ElementTree as ElementTree

import pytest

from tests.conformance.agents import PERL
from tests.conformance.faulty import write

pytest_plugins = ["pytester"]

# By its module, so that it is this checkout's, whatever the environment's packages say.
PLUGIN = ("-p", "no:ciberrato", "-p", "ciberrato.testing.plugin", "-p", "no:cacheprovider", "-W", "error")
CRASH = "if now == 30: raise ValueError('a mistake')"


@pytest.fixture
def project(pytester, monkeypatch):
    """A folder with an agent, in which files are called as ours are."""
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)
    write(pytester.path)
    text = (pytester.path / "agent.py").read_text()
    (pytester.path / "crash.py").write_text(text.replace("# before sending", CRASH))
    (pytester.path / "conftest.py").write_text("COLOUR = 'red'\n")
    (pytester.path / "maps").mkdir()
    (pytester.path / "maps" / "maze_lab.xml").write_text("not a lab")
    (pytester.path / "viewer.py").write_text("raise SystemExit(77)\n")
    (pytester.path / "simulator_stub.txt").write_text("")

    def test(program, *words, **outcomes):
        pytester.makepyfile(test_agent=textwrap.dedent(program))
        done = pytester.runpytest_subprocess(*PLUGIN, *words)
        if outcomes:
            done.assert_outcomes(**outcomes)
        return done

    return test


@pytest.mark.slow
def test_a_run_is_told_in_numbers_and_arrays(project):
    project(
        """
        import numpy as np
        import pytest

        @pytest.mark.ciberrato(lab="maze", seeds=[1, 7], settings={"SimTime": 60})
        def test_agent(ciberrato_run, ciberrato_seed):
            import agent  # the user's own
            assert agent.GOOD_NAME == "mine"
            run = ciberrato_run("python agent.py {host} {port}")
            assert (run.status, run.exit_status, run.signal, run.output) == ("time over", 0, None, "")
            assert (run.lab, run.seed, run.time) == ("maze", ciberrato_seed, 60)
            assert run.answered + run.unanswered == 60 and run.answered > 58 and run.late == 0
            assert run.truth.time.tolist() == list(range(61))
            assert run.truth.x.dtype == np.float64 and run.truth.x.shape == (61,)
            assert run.truth.x[20] > run.truth.x[0]
            assert run.files == {}
            again = ciberrato_run("python agent.py {host} {port}")
            assert np.array_equal(run.truth.x, again.truth.x)
            for name in ("log.xml", "result.json", "truth.csv"):
                assert (run.folder / name).read_bytes() == (again.folder / name).read_bytes()
            other = ciberrato_run("python agent.py {host} {port}", seed=99)
            assert not np.array_equal(run.truth.x, other.truth.x)
        """,
        passed=2,
    )


@pytest.fixture(autouse=True)
def _named(request):
    if "project" in request.fixturenames:
        request.getfixturevalue("project")
        path = request.getfixturevalue("pytester").path / "agent.py"
        path.write_text(path.read_text() + "\nGOOD_NAME = 'mine'\n")


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("perl"), reason="there is no perl here")
def test_other_languages_builds_files_and_environment(project, pytester):
    (pytester.path / "agent.pl.in").write_text(textwrap.dedent(PERL))
    project(
        """
        def test_perl(ciberrato_run):
            run = ciberrato_run(
                ["sh", "-c", "echo $WORD > mapping.out; perl agent.pl {host}:{port}"],
                build="cp agent.pl.in agent.pl", environment={"WORD": "hello"},
                lab="corridors", settings={"SimTime": 40}, scoring="mapping",
            )
            assert run.status == "time over"
            assert set(run.files) == {"mapping.out", "agent.pl"}
            assert run.files["mapping.out"].read_text() == "hello\\n"
            assert run.mapping == -25.0  # five signs that are not in the simulator's map
            assert run.truth.x[0] == 1.0
        """,
        passed=1,
    )
    assert not (pytester.path / "agent.pl").exists()


@pytest.mark.slow
def test_a_failure_says_what_happened_and_keeps_it(project, pytester):
    program = """
        import pytest

        @pytest.mark.ciberrato(lab="maze", seeds=[3])
        def test_agent(ciberrato_run):
            run = ciberrato_run("python crash.py {host} {port}")
            assert run.finished
    """
    done = project(program, failed=1)
    text = done.stdout.str()
    assert "where False = <run in maze, seed 3: crashed at 30 (exit status 1), score" in text
    assert "run 1: python crash.py '{host}' '{port}' in maze, seed 3\n" in text
    assert "ValueError: a mistake\n" in text
    assert "the test again: python -m pytest 'test_agent.py::test_agent[seed3]'" in text
    (place,) = (pytester.path / "ciberrato-failures").glob("*/run-1")
    assert {path.name for path in place.iterdir()} >= {"track.png", "log.xml", "truth.csv", "result.json"}
    assert (place / "track.png").read_bytes().startswith(b"\x89PNG")
    assert f"{place.relative_to(pytester.path)}{os.sep}\n" in text
    # The commands that are named work.
    (viewer,) = re.findall(r"watch it +ciberrato-viewer --open --run (\S+)", text)
    assert (pytester.path / viewer).is_file()
    (simulator,) = re.findall(r"by hand +ciberrato-simulator (.+)", text)
    from simulator_stub.assembly import read_world
    from simulator_stub.options import parse_arguments

    options = parse_arguments(simulator.split())
    assert (options.lab, options.grid, options.seed, options.lockstep) == ("maze", "maze", 3, True)
    read_world(options, pytest.fail)
    # A test in what was kept is not found, and what was kept goes when the test passes.
    (place / "test_trap.py").write_text("def test_trap(): assert False\n")
    project(program.replace("crash.py", "agent.py").replace("run.finished", "run.time > 30"), passed=1)
    assert not place.exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "options", "words"),
    [
        ("sh -c 'yes x'", "output=8", "never registered (output limit)"),
        ("sleep 100", "registration=0.3", "never registered (not registered after 0.3 s)"),
        ("no-such-program", "", "never registered (cannot be started: No such file or directory)"),
        ("true", "build='false'", "not built (see its output)"),
    ],
    ids=["output", "registration", "missing", "build"],
)
def test_limits(project, command, options, words):
    done = project(
        f"""
        def test_agent(ciberrato_run):
            run = ciberrato_run({command!r}, {options})
            assert run.finished
        """,
        failed=1,
    )
    assert words in done.stdout.str()


@pytest.mark.slow
def test_simulators_have_ports_of_their_own_and_are_stopped(project, pytester):
    project(
        """
        import json
        from pathlib import Path
        from ciberrato import Robot

        def test_two(ciberrato_simulator):
            one = ciberrato_simulator(lab="maze", settings={"SimTime": 30}, seed=5)
            two = ciberrato_simulator(lab="corridors", autostart=0, lockstep=False, speed=10)
            assert one.port != two.port and (one.seed, two.seed) == (5, 1)
            with Robot("here", host=one.address) as robot:
                for measures in robot:
                    robot.drive(0.1, 0.1)
            assert one.result()["robots"][0]["name"] == "here"
            assert len(one.truth) == 31 and one.truth_of(2).time.shape == (0,)
            assert "robot 1, 'here', registered" in one.messages
            Path("pids").write_text(json.dumps([one._process.pid, two._process.pid]))

        def test_fails(ciberrato_simulator):
            simulator = ciberrato_simulator()
            assert simulator.result(0.01)
        """,
        passed=1,
        failed=1,
    )
    for pid in json.loads((pytester.path / "pids").read_text()):
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


@pytest.mark.slow
def test_a_simulator_does_not_outlive_tests_that_were_killed(project, pytester):
    program = """
        import os, signal
        def test_agent(ciberrato_simulator):
            simulator = ciberrato_simulator()
            print(simulator._process.pid, flush=True)
            os.kill(os.getpid(), signal.SIGKILL)
    """
    pytester.makepyfile(test_agent=textwrap.dedent(program))
    words = [sys.executable, "-m", "pytest", "-s", "-q", *PLUGIN]
    done = subprocess.run(
        words, cwd=pytester.path, stdout=subprocess.PIPE, text=True, timeout=300, check=False
    )
    assert done.returncode == -9
    # The pipe has ended, so all that had it have; the simulator has its own, but was told at once.
    (pid,) = re.findall(r"^\d+$", done.stdout, re.MULTILINE)
    deadline = subprocess.run(["timeout", "300", "tail", f"--pid={pid}", "-f", "/dev/null"], check=False)
    assert deadline.returncode == 0


@pytest.mark.slow
def test_the_check_fails_a_test_with_its_row(project):
    done = project(
        """
        import pytest
        from ciberrato.grading.conformance.rows import NAMES

        @pytest.mark.parametrize("row", ["refused", "answers"])
        def test_rows(ciberrato_check, row):
            (judged,) = ciberrato_check("python crash.py {host} {port}", row)
            assert judged.passed and len(NAMES) == 11

        def test_misspelt(ciberrato_check):
            ciberrato_check("python crash.py {host} {port}", "anwsers")
        """,
        passed=1,
        failed=2,
    )
    text = done.stdout.str()
    assert "FAILED  answers\n    done      100 cycles are run" in text
    assert "    output  | ValueError: a mistake\n" in text
    assert "did you mean 'answers'?" in text


@pytest.mark.slow
def test_side_by_side_on_several_processes(project, pytester):
    pytest.importorskip("xdist")
    junit = pytester.path / "junit.xml"
    project(
        """
        import pytest

        @pytest.mark.ciberrato(seeds=4, settings={"SimTime": 60})
        def test_agent(ciberrato_run, ciberrato_seed):
            run = ciberrato_run("python agent.py {host} {port}")
            assert run.answered > 50 and ciberrato_seed != 3
        """,
        *("-n", "2", f"--junitxml={junit}"),
        passed=3,
        failed=1,
    )
    assert len(list((pytester.path / "ciberrato-failures").glob("*/run-1/track.png"))) == 1
    assert ElementTree.parse(junit).getroot()[0].get("failures") == "1"


@pytest.mark.parametrize(
    ("marker", "words"),
    [
        ("seeds=[]", "seeds=[]: different whole numbers from 0 were expected"),
        ("seeds=[1, 1]", "seeds=[1, 1]: different whole numbers"),
        ("seeds='12'", "seeds='12': different whole numbers"),
        ("seeds=0", "seeds=0: different whole numbers"),
        ("labb='maze'", "unknown option 'labb'; did you mean 'lab'?"),
        ("'maze'", "options have names, as in lab='maze'"),
    ],
)
def test_a_marker_that_is_wrong_is_told_when_tests_are_collected(project, marker, words):
    done = project(
        f"""
        import pytest
        @pytest.mark.ciberrato({marker})
        def test_agent(ciberrato_run):
            pass
        """
    )
    assert done.ret == 2
    assert words in done.stdout.str()
    assert "Traceback" not in done.stdout.str()


def test_seeds_of_a_test_without_runs_are_a_mistake(project):
    done = project("import pytest\n@pytest.mark.ciberrato(seeds=2)\ndef test_agent(): pass")
    assert "the test takes none of the fixtures ciberrato_run," in done.stdout.str()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        ("'x', lab='mazze'", "'mazze' is neither a file nor a lab that ships"),
        ("'x', labs=3", "ciberrato_run: unknown option 'labs'; did you mean 'lab'?"),
        ("'x', scoring=9", "scoring=9: no such mode"),
        ("'x', settings={'SimTimes': 3}", "SimTimes"),
        ("'x', folder='nowhere'", "folder='nowhere': no such folder"),
        ("'x {hots}'", "'{hots}': these can be filled in: {host}"),
        ("''", "the command line is empty"),
        ("'x', memory=0", "memory=0: a number greater than 0 was expected"),
        ("'x', sandbox='walls'", "sandbox='walls': no such sandbox"),
        ("'x', lab='maps/maze_lab.xml'", "maze_lab.xml"),
    ],
)
def test_a_call_that_is_wrong_shows_the_tests_line_only(project, call, words):
    done = project(f"def test_agent(ciberrato_run):\n    ciberrato_run({call})\n", "--tb=short", failed=1)
    text = done.stdout.str()
    assert words in text
    assert re.findall(r"^(\S+\.py):\d+: in", text, re.MULTILINE) == ["test_agent.py"]


def test_projects_that_do_not_use_it_are_left_alone(project):
    done = project(
        """
        import sys

        def test_nothing_is_loaded():
            rooms = ("ciberrato", "numpy", "lxml", "scipy", "matplotlib", "simulator_stub")
            ours = {name for name in sys.modules if name.split(".")[0] in rooms}
            assert ours <= {"ciberrato", "ciberrato.version", "ciberrato.testing", "ciberrato.testing.plugin"}
        """,
        "--strict-markers",
        "--strict-config",
        passed=1,
    )
    assert done.stderr.str() == ""
