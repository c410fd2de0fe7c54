"""Tournaments run to their end: several agents on one simulator, each in its own sandbox."""

import json
import re
import signal
import subprocess

import pytest

from tests.grading.agents import CRASHING, EATING, FLOODING, HANGING, LINK, ROBOT, table, write
from tests.grading.program import command, rows, run, wait_for_a_run
from tests.grading.test_grading import files

HEAD = """
    title = 'Cup <i>'
    seeds = [3]
    [limits]
    time = 60
    memory = 150
    silence = 1
    [points]
    formula = 'max(0, 100 - 2 * collisions - finished)'
    [tournament]
    TABLE
    [[lab]]
    name = 'maze'
    grid = 'maze'
    set = {SimTime = 60}
""".replace("\n    ", "\n")
PLACED = ROBOT.replace("Robot(sys.argv[3],", "Robot(sys.argv[3], position=int(sys.argv[4]), host=")
POSITION = "python agent.py {host} {port} {name} {pos}"
SECOND = """
    import sys
    from ciberrato import Robot
    address = f"{sys.argv[1]}:{sys.argv[2]}"
    with Robot("one", address) as one, Robot("two", address) as two:
        for measures in one:
            one.drive(0.1, 0.1)
"""
LOOKING = """
    import os, socket, sys
    from ciberrato import Robot
    from ciberrato.net import UdpLink
    with UdpLink(sys.argv[1], int(sys.argv[2])) as link:
        link.register(b"<View/>\\0")
        print(link.receive(60.0))
    print(sorted(name for name in os.listdir(os.path.dirname(os.getcwd())) if name.startswith("secret")))
    print(len([name for name in os.listdir("/proc") if name.isdigit()]) < 6)
    with Robot("looks", f"{sys.argv[1]}:{sys.argv[2]}") as robot:
        for measures in robot:
            robot.drive(0.1, 0.1)
"""


def course(folder, agents, settings="rounds = 1"):
    path = folder / "course.toml"
    path.write_text(HEAD.replace("TABLE", settings) + agents)
    return path


@pytest.mark.slow
def test_agents_of_a_run_that_do_harm_do_not_stop_the_others(tmp_path, walls):
    agents = ""
    for name, program in {"robot": PLACED, "crashing": CRASHING, "link": LINK}.items():
        write(tmp_path, name, program)
        agents += table(name, POSITION)
    write(tmp_path, "failing", "raise SystemExit(3)")
    path = course(tmp_path, agents + table("failing"), "rounds = 1\nrobots = 4")
    # croblink's agent asks for place 1 whatever it is told.
    (tmp_path / "agents/link/agent.py").write_text(
        (tmp_path / "agents/link/agent.py").read_text().replace('"link", 1,', '"link", int(sys.argv[4]),')
    )
    report = tmp_path / "report"
    said = run(path, "--tournament", "--sandbox", walls, "--quiet", "--output", report).stdout.splitlines()
    found = rows(report)
    assert len(found) == 16  # four agents, once from each place
    for name, wanted in {
        "robot": ("time over", "", "60"),
        "link": ("time over", "", "60"),
        "crashing": ("crashed at 21", "exit status 1", "60"),
        "failing": ("never registered", "exit status 3", "0"),
    }.items():
        own = [row for row in found if row["agent"] == name]
        assert {(row["status"], row["detail"], row["time"]) for row in own} == {wanted}
        assert sorted(row["start"] for row in own) == ["1", "2", "3", "4"]
    assert {row["points"] for row in found if row["agent"] == "failing"} == {"0.0"}
    assert {row["place"] for row in found if row["agent"] == "failing"} == {"4"}
    assert said[3].split()[1] == "failing"
    document = json.loads((report / "results.json").read_text())
    assert [one["agent"] for one in document["ranking"]] == [line.split()[1] for line in said[:4]]
    # One recording a run, with all robots in it, called as the course calls them.
    recordings = sorted((report / "recordings").iterdir())
    assert len(recordings) == 4
    text = recordings[0].read_text()
    recording = json.loads(text[text.index("(") + 1 : text.rindex(")")])
    assert len(recording["robots"]) == 3
    (roster,) = (news["robots"] for news in recording["news"] if news["type"] == "roster")
    assert {robot["name"] for robot in roster} == {"robot", "link", "crashing"}
    page = (report / "index.html").read_text()
    assert "Who beat whom" in page
    assert len(re.findall(r'class="play"', page)) == 16 + 4


@pytest.mark.slow
def test_bad_agents_end_as_they_would_alone_and_runs_are_the_same_again_after_an_interruption(tmp_path):
    agents = ""
    for name, program in {"robot": ROBOT, "hanging": HANGING, "flooding": FLOODING, "eating": EATING}.items():
        write(tmp_path, name, program)
        agents += table(name)
    path = course(tmp_path, agents, "robots = 2\nrounds = 1")
    whole, halves = tmp_path / "whole", tmp_path / "halves"
    run(path, "--tournament", "--quiet", "--output", whole)
    found = {(row["agent"], row["status"], row["detail"]) for row in rows(whole)}
    assert found == {
        ("robot", "time over", ""),
        ("hanging", "silent since 20", ""),
        ("flooding", "stopped at 20", "output limit"),
        ("eating", "stopped at 20", "memory limit"),
    }
    for number, status in ((signal.SIGINT, 130), (signal.SIGKILL, -signal.SIGKILL)):
        words = command(path, "--tournament", "--output", halves, "--jobs", "1")
        process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        wait_for_a_run(process)
        process.send_signal(number)
        process.communicate(timeout=300)
        assert process.returncode == status
    done = (halves / "runs.jsonl").read_bytes().splitlines()
    assert 2 <= len(done) < 4
    run(path, "--tournament", "--quiet", "--output", halves)
    assert (halves / "runs.jsonl").read_bytes().splitlines()[: len(done)] == done
    assert files(whole) == files(halves)
    (halves / "index.html").unlink()
    run(path, "--tournament", "--report", "--output", halves)
    assert files(whole) == files(halves)


@pytest.mark.slow
def test_who_takes_what_is_not_its_own_is_left_out_of_the_run(tmp_path, walls):
    write(tmp_path, "robot", PLACED)
    write(tmp_path, "double", SECOND)
    write(tmp_path, "last", PLACED)
    agents = table("robot", POSITION) + table("double") + table("last", POSITION.replace("{pos}", "3"))
    path = course(tmp_path, agents, "rounds = 1\nrobots = 3")
    run(path, "--tournament", "--sandbox", walls, "--quiet", "--output", tmp_path / "report")
    for row in rows(tmp_path / "report"):
        if row["agent"] == "double":
            # What it asks for once the run has begun is refused, and ends it.
            assert (row["status"], row["detail"]) in {
                ("never registered", "a second robot was registered"),
                ("crashed at 1", "exit status 1"),
            }
        elif row["agent"] == "robot" or row["start"] == "3":
            assert (row["status"], row["time"]) == ("time over", "60")
        else:
            wanted = f"start place 3 was taken, not {row['start']}; {{pos}} says which"
            assert (row["status"], row["detail"]) == ("never registered", wanted)


@pytest.mark.slow
def test_agents_of_a_run_see_neither_each_other_nor_the_robots(tmp_path, walls):
    if walls == "none":
        pytest.skip("there is nothing to be hidden")
    write(tmp_path, "looks", LOOKING)
    write(tmp_path, "robot", PLACED)
    write(tmp_path, "robot", "the answers", "secret")
    agents = table("looks") + table("robot", POSITION)
    path = course(tmp_path, agents, "rounds = 1\nplaces = 'draw'")
    for words in (["--tournament"], []):
        report = tmp_path / f"report{len(words)}"
        run(path, *words, "--sandbox", "bwrap", "--quiet", "--output", report)
        documents = [json.loads(line) for line in (report / "runs.jsonl").read_text().splitlines()]
        parts = [part for document in documents for part in document.get("agents", [document])]
        (tail,) = (part["measured"]["tail"] for part in parts if part["agent"] == "looks")
        assert tail.splitlines()[0].startswith('b\'<Reply Status="Refused"')
        assert tail.splitlines()[1:] == ["[]", "True"]
