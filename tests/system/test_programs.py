"""The programs on this system, and on Windows and macOS as far as Linux can pretend to be them.

What comes out elsewhere is compared with what comes out here, less dates, measured times, and what happens
once the agent has ended: how many cycles the simulator goes on for then is a matter of time.
"""

import json
import re
import sys
import urllib.request

import pytest

from tests.system.programs import SECONDS, System, program, until

TRANSPORTS = ("udp", "tcp")
COURSE = """
seeds = [1]
[[lab]]
name = "open"
set = { SimTime = 100 }
[[agent]]
name = "follower"
command = "python agent.py {host}:{port} {pos} {name}"
folder = "course/agents/follower"
"""
CLOCK = re.compile(rb'"\w*(wall|seconds|_ms)": ?[^,}\]]+[^,}]*|Date="[^"]*"')


def drive(system, folder, transport):
    """Let the agent drive in lockstep to the wall; return what it left, by name of the file."""
    folder.mkdir()
    simulator = (
        *(program("simulator"), "--lab", "standard", "--grid", "standard", "--seed", "1", "--port", "0"),
        *("--bind", "127.0.0.1", "--tcp", "--autostart", "1", "--lockstep", "--answer-limit", "300"),
        *("--log", "log.xml", "--result", "result.json"),
    )
    with system.running(folder, *simulator) as simulation:
        port = until(simulation, rf"{transport} \S+:(\d+)")[1]
        system.run(
            folder,
            *(program("agent"), "-h", f"127.0.0.1:{port}", "-m", "standard", "--transport", transport),
            *("--exit-at-wall", "--lockstep", "--log", "run.jsonl"),
        )
        status, said = system.interrupt(simulation)
        assert status == 0, said
    result = json.loads((folder / "result.json").read_bytes())["runs"][0]["robots"][0]
    last = json.loads((folder / "run.jsonl").read_bytes().splitlines()[-1])["time"]
    # The simulator may be interrupted before it takes in the last answer: it waits for a client at work.
    log = (
        (folder / "log.xml")
        .read_bytes()
        .removesuffix(b"</Log>\n")
        .partition(b'<LogInfo Time="%d">' % last)[0]
    )
    assert b'<LogInfo Time="%d">' % (last - 1) in log
    return {
        "localization.out": (folder / "localization.out").read_bytes(),
        "run.jsonl": CLOCK.sub(b"", (folder / "run.jsonl").read_bytes()),
        "log.xml": CLOCK.sub(b"", log),
        "result.json": {name: result[name] for name in ("id", "name", "score", "collisions", "visited")},
    }


@pytest.fixture(scope="module")
def driven_here(tmp_path_factory):
    folder = tmp_path_factory.mktemp("here")
    system = System("here", folder)
    return {transport: drive(system, folder / transport, transport) for transport in TRANSPORTS}


@pytest.mark.slow
@pytest.mark.parametrize("transport", TRANSPORTS)
def test_a_run_in_lockstep_here(driven_here, transport):
    assert b"<" in driven_here[transport]["log.xml"]
    assert driven_here[transport]["localization.out"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("elsewhere", "transport"),
    [("windows", "udp"), ("windows", "tcp"), ("macos", "udp")],
    indirect=["elsewhere"],
)
def test_a_run_in_lockstep_elsewhere_is_the_same(elsewhere, driven_here, transport, tmp_path):
    driven = drive(elsewhere, tmp_path / "run", transport)
    assert elsewhere.saw(elsewhere.name)
    assert [name for name in driven if driven[name] != driven_here[transport][name]] == []
    if elsewhere.name == "windows":
        assert elsewhere.saw("exclusive")


def test_ctrl_c_ends_a_run_that_has_begun(elsewhere, tmp_path):
    with elsewhere.running(
        tmp_path, program("simulator"), "--port", "0", "--bind", "127.0.0.1", "--speed", "20"
    ) as simulation:
        port = until(simulation, r"udp \S+:(\d+)")[1]
        words = (program("agent"), "-h", f"127.0.0.1:{port}", "-m", "corridors", "--online")
        with elsewhere.running(tmp_path, *words) as agent:
            until(agent, "registered")
            status, said = elsewhere.interrupt(agent)
        assert status in (0, 128 + 2, 128 + 3), said
        assert elsewhere.interrupt(simulation)[0] == 0


def test_the_viewers_page(elsewhere, tmp_path):
    viewer = (program("viewer"), "--simulator", "127.0.0.1:9", "--http", "0", "--overlay", "0")
    with elsewhere.running(tmp_path, *viewer) as running:
        address = until(running, r"page: (\S+)")[1]
        with urllib.request.urlopen(address, timeout=SECONDS) as page:
            assert b"<html" in page.read()
        assert elsewhere.interrupt(running)[0] == 0


def test_a_viewer_ends_with_the_simulator_that_started_it(elsewhere, tmp_path):
    simulator = (program("simulator"), "--port", "0", "--bind", "127.0.0.1", "--view", "0")
    with elsewhere.running(tmp_path, *simulator) as running:
        address = until(running, r"page: (\S+)")[1]
        with urllib.request.urlopen(address, timeout=SECONDS) as page:
            assert b"<html" in page.read()
        assert elsewhere.interrupt(running)[0] == 0
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(address, timeout=SECONDS)


@pytest.mark.slow
def test_an_evaluation_with_two_workers(elsewhere, here, tmp_path):
    words = (program("evaluate"), "--lab", "corridors", "--seeds", "2", "--cycles", "20", "--jobs", "2")
    outcomes = []
    for system in (here, elsewhere):
        system.run(tmp_path, *words, "--output", f"{system.name}.jsonl")
        lines = (tmp_path / f"{system.name}.jsonl").read_bytes().splitlines()
        done = [json.loads(line) for line in lines]
        outcomes.append(
            {one["task"]["seed"]: {k: v for k, v in one["outcome"].items() if "ms" not in k} for one in done}
        )
    assert len(outcomes[0]) == 2
    assert outcomes[1] == outcomes[0]


def test_labs(elsewhere, here, tmp_path):
    lab = tmp_path / "lab.xml"
    lab.write_text('<Lab Name="Ångström → 迷路" Width="28" Height="14"></Lab>', encoding="utf-8")
    said = [system.run(tmp_path, program("lab"), "check", "lab.xml") for system in (here, elsewhere)]
    assert said[1] == said[0].encode("utf-8").decode("utf-8") or elsewhere.name == "windows"
    for system in (here, elsewhere):
        system.run(tmp_path, program("lab"), "new", "--random", "--seed", "3", "-o", system.name)
    assert without_name(tmp_path / "here_lab.xml") == without_name(tmp_path / f"{elsewhere.name}_lab.xml")


def without_name(path):
    return re.sub(rb'Name="[^"]*"', b"", path.read_bytes())


def test_the_demonstration(elsewhere, tmp_path):
    said = elsewhere.run(tmp_path, sys.executable, "-m", "ciberrato", "demo")
    assert (tmp_path / "demo" / "localization.out").exists(), said


@pytest.mark.slow
def test_a_grading_without_a_sandbox(elsewhere, here, tmp_path):
    here.run(tmp_path, program("grade"), "init", "course")
    (tmp_path / "course.toml").write_text(COURSE, encoding="utf-8")
    lines = {}
    for system in (here, elsewhere):
        words = ("course.toml", "--sandbox", "none", "--output", system.name)
        said = system.run(tmp_path, program("grade"), *words)
        assert "no sandbox" in said
        graded = json.loads((tmp_path / system.name / "runs.jsonl").read_bytes())
        lines[system.name] = graded["outcome"]
    assert lines[elsewhere.name] == lines["here"]
    assert lines["here"]["status"] == "time over"


def test_a_tournament_says_that_it_needs_linux(elsewhere, tmp_path):
    (tmp_path / "course.toml").write_text(COURSE.replace("course/agents", "agents"), encoding="utf-8")
    (tmp_path / "agents" / "follower").mkdir(parents=True)
    words = (program("grade"), "course.toml", "--tournament", "--output", "out")
    said = elsewhere.run(tmp_path, *words, status=2)
    assert said.splitlines() == [
        "ciberrato-grade: --tournament: needs Linux, whose /proc tells which agent has registered a robot"
    ]
    assert not (tmp_path / "out").exists()
