"""Hidden labs and seeds, random labs, and what is published."""

import json
from dataclasses import replace

import pytest

from ciberrato.errors import UsageError
from ciberrato.files.lab import read_lab
from ciberrato.grading.course import QUANTITIES, CourseError, read_course
from ciberrato.grading.expressions import Formula
from ciberrato.grading.outcome import Outcome
from ciberrato.grading.runner import Graded
from ciberrato.grading.secret import published, with_secret
from ciberrato.grading.standing import standings
from ciberrato.grading.task import Task
from tests.grading.agents import ROBOT, table, write
from tests.grading.program import rows, run

COURSE = (
    "seeds = [1]\n[points]\nformula = 'score'\n[[lab]]\nname = 'maze'\ngrid = 'maze'\nset = {SimTime = 30}\n"
)
SECRET = """
seeds = [987654321]
[[lab]]
name = 'zyxsecret'
weight = 2
set = { SimTime = 30 }
random = { size = "8x5", seed = 24681357, loops = 0.3 }
"""


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def files(tmp_path):
    """A course and what is secret."""
    write(tmp_path, "robot", ROBOT + "            print('saw', front)\n")
    (tmp_path / "course.toml").write_text(COURSE + table("robot"))
    (tmp_path / "secret.toml").write_text(SECRET)
    return tmp_path / "course.toml", tmp_path / "secret.toml"


def faults(files, text):
    files[1].write_text(text)
    with pytest.raises(CourseError) as caught:
        with_secret(read_course(files[0]), files[1])
    assert all(line.startswith(str(files[1])) for line in caught.value.faults)
    return caught.value.faults


@pytest.mark.slow
def test_what_is_published_holds_nothing_that_is_secret(files, tmp_path):
    course, secret = files
    report, site = tmp_path / "report", tmp_path / "site"
    run(course, "--quiet", "--secret", secret, "--output", report, "--publish", site)
    assert len(rows(report)) == 4
    (shown,) = rows(site)
    assert (shown["lab"], shown["seed"]) == ("maze", "1")
    whole = json.loads((report / "results.json").read_text())["ranking"][0]
    document = json.loads((site / "results.json").read_text())
    (there,) = document["ranking"]
    assert (there["place"], there["points"]) == (whole["place"], whole["points"])
    assert there["labs"] == {"maze": whole["labs"]["maze"], "hidden labs": whole["labs"]["zyxsecret"]}
    assert document["hidden"] == 3
    assert "3 runs in hidden labs" in (site / "index.html").read_text()
    # Everything there is, file by file: no name, seed, recording or output of what is secret.
    (recording,) = (site / "recordings").iterdir()
    assert recording.name in {path.name for path in (report / "recordings").iterdir()}
    kept = [json.loads(line) for line in (report / "runs.jsonl").read_text().splitlines()]
    (open_,) = {line["measured"]["tail"] for line in kept if (line["lab"], line["seed"]) == ("maze", 1)}
    hidden = {line["measured"]["tail"][-60:] for line in kept if line["measured"]["tail"] != open_}
    assert hidden
    for path in filter(lambda path: path.is_file(), site.rglob("*")):
        text = path.read_text(errors="replace")
        for word in ("zyxsecret", "987654321", "24681357", *hidden):
            assert word not in text, path
            assert word not in path.name
    # In the teacher's report Gradescope is told which tests students must not see.
    (results,) = (report / "gradescope").glob("*/results.json")
    tests = json.loads(results.read_text())["tests"]
    assert [test["visibility"] for test in tests] == ["visible", "hidden", "hidden", "hidden"]
    assert "zyxsecret" not in json.dumps(json.loads(results.read_text())["leaderboard"])


@pytest.mark.slow
def test_students_get_what_the_server_gets_for_the_same_lab_and_seed(files, tmp_path):
    course, secret = files
    run(course, "--quiet", "--secret", secret, "--output", tmp_path / "server")
    run(course, "--quiet", "--output", tmp_path / "local")
    (own,) = rows(tmp_path / "local")
    assert own in rows(tmp_path / "server")
    name = next((tmp_path / "local" / "recordings").iterdir()).name
    assert (tmp_path / "local" / "recordings" / name).read_bytes() == (
        tmp_path / "server" / "recordings" / name
    ).read_bytes()


def test_a_report_is_published_into_no_folder_that_holds_something_else(files, tmp_path):
    course, _ = files
    run(course, "--quiet", "--output", tmp_path / "report")
    (tmp_path / "mine" / "recordings").mkdir(parents=True)
    (tmp_path / "mine" / "recordings" / "song").touch()
    for place, what in (("mine", "holds something else"), ("report", "name another folder")):
        words = ("--quiet", "--report", "--output", tmp_path / "report", "--publish", tmp_path / place)
        assert what in run(course, *words, expect=2).stderr
    assert (tmp_path / "mine" / "recordings" / "song").exists()
    assert len(list((tmp_path / "report" / "recordings").iterdir())) == 1


def test_a_random_lab_is_that_of_the_lab_program_with_the_same_seed(files, tmp_path):
    from ciberrato.labtool.cli import main

    course = with_secret(read_course(files[0]), files[1])
    lab = course.labs[-1]
    words = ["new", "--random", "--seed", "24681357", "--size", "8x5", "--loops", "0.3"]
    assert main([*words, "--name", "Random", "-o", str(tmp_path / "made")]) == 0
    assert lab.lab.read_bytes() == (tmp_path / "made_lab.xml").read_bytes()
    assert lab.grid.read_bytes() == (tmp_path / "made_grid.xml").read_bytes()
    assert (read_lab(lab.lab).width, lab.secret, lab.weight) == (16.0, True, 2.0)
    assert course.seeds == (1, 987654321)


def test_hidden_labs_count_by_their_weights_where_they_are_one(files):
    files[1].write_text(SECRET + "[[lab]]\nname = 'other'\nlab = 'open'\nweight = 5\n")
    course = with_secret(read_course(files[0]), files[1])
    scores = {"maze": (4, 6), "zyxsecret": (10, 20), "other": (1, 3)}
    runs = [
        Graded(
            Task(course.agents[0], lab, seed, f"{lab.name}{seed}", f"{lab.name}-{seed}"),
            Outcome(status="finished", registered=True, score=scores[lab.name][number]),
            {},
        )
        for lab in course.labs
        for number, seed in enumerate(course.seeds)
    ]
    ranked = standings(course, runs)
    shown, (standing,) = published(course, ranked)
    assert standing.labs == {"maze": 5.0, "hidden labs": pytest.approx((2 * 15 + 5 * 2) / 7)}
    weights = {lab.name: lab.weight for lab in shown.labs}
    total = sum(standing.labs[name] * weight for name, weight in weights.items()) / sum(weights.values())
    assert standing.total == ranked[0].total == pytest.approx(total)
    assert [run.task.seed for run, _ in standing.runs] == [1]
    assert shown.seeds == (1,)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "holds neither seeds nor [[lab]]"),
        ("seeds = [1]", "seeds: 1 is in the course already"),
        ("agents = 3", "unknown entry 'agents'"),
        (SECRET.replace("zyxsecret", "maze"), "the name 'maze' occurs more than once"),
        (SECRET.replace("8x5", "8"), "size: COLUMNSxROWS"),
        (SECRET.replace("seed = 24681357, ", ""), "seed: is missing"),
        (SECRET.replace("loops = 0.3", "loops = 3"), "loops: a number from 0 to 1"),
        (SECRET.replace("loops", "lops"), "unknown entry 'lops'"),
        (SECRET.replace("8x5", "1x1"), "random: "),
        (SECRET + "lab = 'maze'", "lab: random makes one"),
        (SECRET.replace("loops = 0.3", "symmetric = 1"), "symmetric: true or false"),
    ],
)
def test_each_fault_of_a_secret_file_is_a_line(files, text, what):
    found = faults(files, text)
    assert any(what in line for line in found), found


def test_what_cannot_be_reckoned_does_not_name_a_hidden_run(files):
    course = with_secret(read_course(files[0]), files[1])
    course = replace(course, points=replace(course.points, formula=Formula("1 / score", QUANTITIES)))
    task = Task(course.agents[0], course.labs[-1], 1, "key", "file")
    with pytest.raises(UsageError, match="points of robot, a hidden run: "):
        standings(course, [Graded(task, Outcome(status="finished", registered=True), {})])
