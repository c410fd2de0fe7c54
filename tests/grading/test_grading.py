import html
import json
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from tests.grading.agents import (
    BREEDING,
    CRASHING,
    EATING,
    FIXED_PORT_IN_C,
    FLOODING,
    HANGING,
    LINK,
    ROBOT,
    table,
    write,
)
from tests.grading.program import command, rows, run, wait_for_a_run

HEAD = """
    title = 'Test <i>course</i>'
    seeds = SEEDS
    [limits]
    time = 60
    memory = 150
    processes = 40
    silence = 1
    [points]
    formula = 'max(0, score - 2 * collisions)'
    [[lab]]
    name = 'maze'
    grid = 'maze'
    set = {SimTime = 60}
    [[lab]]
    name = 'open <b>'
    lab = 'open'
    set = {SimTime = 60}
    weight = 2
""".replace("\n    ", "\n")
MEASURED = {"measured.csv", "measured.js", "runs.jsonl"}


def course(folder, agents, seeds="[3]"):
    path = folder / "course.toml"
    path.write_text(HEAD.replace("SEEDS", seeds) + agents)
    return path


def port_is_free():
    """Whether no program of this machine has port 6000 of all addresses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", 6000))
        except OSError:
            return False
    return True


def good_agents(folder, *, fixed_port=False):
    write(folder, "robot", ROBOT)
    write(folder, "link", LINK)
    text = table("robot") + table("link")
    if shutil.which("gcc") and (fixed_port or port_is_free()):
        write(folder, "c", FIXED_PORT_IN_C, "agent.c")
        text += table("c", "./agent {host}", build="gcc -o agent agent.c")
    return text


def files(folder):
    """All files of a report that no clock has a say in."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and path.name not in MEASURED
    }


@pytest.mark.slow
def test_agents_that_do_harm_change_nothing_for_the_others(tmp_path, walls):
    good = good_agents(tmp_path, fixed_port=walls == "bwrap")
    run(course(tmp_path, good), "--sandbox", walls, "--quiet", "--output", tmp_path / "alone")
    alone = rows(tmp_path / "alone")
    assert {row["status"] for row in alone} == {"time over"}
    assert {row["answered"] for row in alone} == {"60"}
    bad = ""
    programs = {
        "crashing": CRASHING, "hanging": HANGING, "flooding": FLOODING, "eating": EATING, "breeding": BREEDING
    }  # fmt: skip
    for name, program in programs.items():
        write(tmp_path, name, program)
        bad += table(name)
    write(tmp_path, "failing", "raise SystemExit(3)")
    bad += table("failing") + table("absent", "nonesuch").replace("agents/absent", "agents/failing")
    run(course(tmp_path, bad + good), "--sandbox", walls, "--quiet", "--output", tmp_path / "mixed")
    mixed = rows(tmp_path / "mixed")
    names = {row["agent"] for row in alone}
    ordered = sorted((row for row in mixed if row["agent"] in names), key=lambda row: str(row))
    assert ordered == sorted(alone, key=lambda row: str(row))
    came = {row["agent"]: (row["status"], row["detail"]) for row in mixed}
    assert came["crashing"] == ("crashed at 21", "exit status 1")
    assert came["hanging"] == ("silent since 20", "")
    assert came["flooding"] == ("stopped at 20", "output limit")
    assert came["eating"] == ("stopped at 20", "memory limit")
    # The system refuses further processes to users other than root, which ends this agent, too.
    assert came["breeding"] in {("stopped at 20", "process limit"), ("crashed at 21", "exit status 1")}
    assert came["failing"] == ("never registered", "exit status 3")
    assert came["absent"][0] == "never registered"
    assert {row["points"] for row in mixed if row["status"] == "never registered"} == {"0.0"}


@pytest.mark.slow
def test_interrupted_and_taken_up_again_it_writes_the_same_files(tmp_path):
    path = course(tmp_path, good_agents(tmp_path), "5")
    whole, halves = tmp_path / "whole", tmp_path / "halves"
    run(path, "--quiet", "--output", whole)
    for number, status in ((signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)):
        words = command(path, "--output", halves, "--jobs", "1")
        process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        wait_for_a_run(process)
        process.send_signal(number)
        process.communicate(timeout=300)
        assert process.returncode == status
    done = (halves / "runs.jsonl").read_text().splitlines()
    count = len((whole / "runs.jsonl").read_text().splitlines())
    assert 2 <= len(done) < count
    with (halves / "runs.jsonl").open("a") as file:
        file.write('{"key": "torn')
    run(path, "--quiet", "--output", halves)
    lines = (halves / "runs.jsonl").read_text().splitlines()
    assert lines[: len(done)] == done
    assert len({json.loads(line)["key"] for line in lines}) == len(lines) == count
    assert files(whole) == files(halves)
    before = (halves / "runs.jsonl").read_bytes()
    run(path, "--quiet", "--output", halves)
    assert (halves / "runs.jsonl").read_bytes() == before


@pytest.mark.slow
def test_the_report_shows_names_and_outputs_as_text(tmp_path):
    name = "<img src=x onerror=alert(1)>"
    write(tmp_path, "crashing", CRASHING)
    path = course(tmp_path, table("crashing").replace("name = 'crashing'", f"name = '{name}'"), "1")
    report = tmp_path / "report"
    run(path, "--quiet", "--output", report)
    page = (report / "index.html").read_text()
    assert "<img" not in page
    assert "<i>" not in page
    assert "<b>" not in page
    assert "a mistake" in page
    document = ElementTree.fromstring((report / "junit.xml").read_text())
    assert (document.get("tests"), document.get("failures"), document.get("errors")) == ("2", "2", "0")
    assert document.find("testsuite").get("name") == name
    assert document.find(".//failure").get("message") == "crashed at 21: exit status 1"
    assert "<b>a mistake</b>" in document.find(".//system-out").text
    (place,) = (report / "gradescope").iterdir()
    results = json.loads((place / "results.json").read_text())
    total = json.loads((report / "results.json").read_text())["ranking"][0]["points"]
    assert results["score"] == pytest.approx(total, abs=1e-6)
    assert {test["status"] for test in results["tests"]} == {"failed"}
    assert len(list((report / "recordings").iterdir())) == 2


@pytest.mark.slow
def test_the_commands_beside_a_run_do_it_again(tmp_path):
    write(tmp_path, "robot", ROBOT)
    path = tmp_path / "course.toml"
    lab = "seeds = [7]\n[[lab]]\nname = 'a lab'\nlab = 'maze'\ngrid = 'maze'\nset = {SimTime = 60}\n"
    path.write_text(lab + table("robot"))
    report = tmp_path / "report"
    run(path, "--quiet", "--output", report)
    page = (report / "index.html").read_text()
    (shown,) = re.findall(r'<pre class="again">(.*?)</pre>', page, re.DOTALL)
    first, second = (shlex.split(html.unescape(line)) for line in shown.splitlines())
    assert first[0] == "ciberrato-simulator"
    assert first[-1] == "--view"
    result = tmp_path / "result.json"
    words = [sys.executable, "-m", "simulator_stub", *first[1:-1], "--port", "0", "--result", str(result)]
    with subprocess.Popen(words, cwd=report, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as simulator:
        port = next(line for line in simulator.stdout if b"listening on udp" in line).split(b":")[-1].strip()
        assert second[:4] == ["python", "agent.py", "127.0.0.1", "6000"]
        agent = [sys.executable, *second[1:3], port.decode(), *second[4:]]
        subprocess.run(agent, cwd=tmp_path / "agents" / "robot", timeout=300, check=True)
        simulator.communicate(timeout=300)
    (again,) = json.loads(result.read_text())["runs"][0]["robots"]
    (row,) = rows(report)
    assert (str(again["score"]), str(again["collisions"])) == (row["score"], row["collisions"])


@pytest.mark.slow
def test_in_a_sandbox_an_agent_sees_neither_the_course_nor_others(tmp_path, walls):
    if walls == "none":
        pytest.skip("there is nothing to be hidden")
    spy = f"""
        import os, socket
        for path in ({str(tmp_path)!r} + "/course.toml", {str(tmp_path)!r} + "/agents/other/secret"):
            print(os.path.exists(path))
        print(sorted(os.listdir("/tmp")), [name for _, name in socket.if_nameindex()])
        print(len([name for name in os.listdir("/proc") if name.isdigit()]) < 5)
        try:
            open("/usr/mark", "w")
        except OSError:
            print("read-only")
        open("mine", "w").write("x")
        print(sorted(os.listdir(".")))
    """
    write(tmp_path, "spy", spy)
    write(tmp_path, "other", "the answers", "secret")
    run(course(tmp_path, table("spy"), "1"), "--sandbox", "bwrap", "--quiet", "--output", tmp_path / "report")
    said = json.loads((tmp_path / "report" / "runs.jsonl").read_text().splitlines()[0])["measured"]["tail"]
    # Only the path to its own folder, which it sees where it is.
    # Python and this checkout may lie there, too: they are to be seen, to be run.
    ways = (tmp_path, Path(__file__), Path(sys.prefix))
    above = sorted({path.parts[2] for path in ways if path.parts[1] == "tmp"})
    wanted = ["False", "False", f"{above} ['lo']", "True", "read-only", "['agent.py', 'mine']"]
    assert said.splitlines() == wanted
    assert not (tmp_path / "agents" / "spy" / "mine").exists()


@pytest.mark.slow
def test_in_real_time_a_run_is_graded_too(tmp_path, walls):
    write(tmp_path, "robot", ROBOT)
    path = course(tmp_path, table("robot"), "1")
    path.write_text("pace = 'realtime'\nspeed = 5\n" + path.read_text())
    run(path, "--sandbox", walls, "--quiet", "--output", tmp_path / "report")
    for row in rows(tmp_path / "report"):
        assert row["time"] == "60"
        # On a busy machine the answer to the last Measures comes when the run is over.
        assert re.fullmatch(r"time over|left at \d+", row["status"])
        assert int(row["answered"]) + int(row["unanswered"]) == 60
