"""Recordings, and the page that plays them, opened from a disk."""

import json
import shutil
from itertools import accumulate

import pytest
from playwright.sync_api import sync_playwright

from ciberrato.files.simulator_log import read_simulator_log
from ciberrato.grading.recording import write_recording
from ciberrato.grading.report import player
from tests.grading.agents import ROBOT, table, write
from tests.grading.program import run

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
ARGUMENTS = [
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync"),
]
MILLISECONDS = 300_000  # only a failure takes so long
EVIL = "<img src=x onerror='window.hit=1'>"


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Log of a robot that turns and bumps."""
    from ciberrato import find_grid, find_lab, read_grid, read_lab
    from ciberrato.client import Robot
    from ciberrato.world.parameters import Parameters
    from simulator_stub.recording.log import LogFile
    from simulator_stub.simulation import Simulation

    path = tmp_path_factory.mktemp("log") / "log.xml"
    simulation = Simulation(
        read_lab(find_lab("maze")), read_grid(find_grid("maze")), Parameters(sim_time=80), seed=3
    )
    file = LogFile(path, "then")
    with Robot("r", simulation=simulation) as robot:
        for measures in robot:
            file.actions_read(simulation)
            robot.drive(0.15, 0.15 if measures.time < 40 else -0.05)
    file.world_ended(simulation)
    file.close()
    return path


def test_a_recording_holds_what_the_log_says(log, tmp_path):
    target = tmp_path / "recording.js"
    assert write_recording(log, target, "of somebody")
    text = target.read_text()
    assert text.startswith("ciberratoRecording(")
    recording = json.loads(text[len("ciberratoRecording(") : text.rindex(")")])
    records = read_simulator_log(log).records
    assert list(accumulate(recording["times"])) == [record.time for record in records]
    (robot,) = recording["robots"]
    x, y, heading = (list(accumulate(row)) for row in robot["moves"])
    changes = {row[0]: row[1:] for row in robot["changes"]}
    last = None
    for number, record in enumerate(records):
        (logged,) = record.robots
        assert x[number] / 1000 == pytest.approx(logged.x, abs=6e-4)
        assert y[number] / 1000 == pytest.approx(logged.y, abs=6e-4)
        assert heading[number] / 10 == pytest.approx(logged.direction_deg, abs=0.06)
        last = changes.get(number, last)
        assert last[0] == logged.score
        assert last[3:5] == [logged.collisions, int(logged.collision)]
        assert last[6] == logged.state
    assert len(changes) > 1


def test_a_log_that_is_none_leaves_no_recording(tmp_path):
    (tmp_path / "log.xml").write_text("")
    assert not write_recording(tmp_path / "log.xml", tmp_path / "recording.js", "")
    assert not (tmp_path / "recording.js").exists()


def test_the_script_holds_every_module_of_the_viewers_page_before_those_that_use_it():
    text = player.bundle("main")
    names = [line.split()[1] for line in text.splitlines() if line.startswith("const module_")]
    assert names[-1] == "module_main"
    assert len(names) == len(set(names)) > 15
    assert "WebSocket" not in text
    for number, name in enumerate(names):
        assert text.index(f"const {name} =") == min(
            at for at in (text.find(f"= {name};"), text.index(f"const {name} =")) if at >= 0
        ), names[number]


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here; apt-get install chromium brings one")
def test_a_run_plays_in_a_browser_from_the_disk(tmp_path):
    write(tmp_path, "robot", ROBOT)
    path = tmp_path / "course.toml"
    lab = "[[lab]]\nname = 'maze'\ngrid = 'maze'\nset = {SimTime = 60}\n"
    path.write_text(lab + table("robot").replace("name = 'robot'", f'name = "{EVIL}"'))
    report = tmp_path / "report"
    run(path, "--quiet", "--output", report)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS, timeout=MILLISECONDS)
        page = browser.new_page()
        page.set_default_timeout(MILLISECONDS)
        faults, requests = [], []
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("console", lambda message: faults.append(message.text) if message.type == "error" else None)
        page.on("request", lambda request: requests.append(request.url))
        page.goto((report / "index.html").as_uri())
        assert EVIL in page.inner_text("table.ranking")
        assert page.inner_text("[data-measured=wall]") != ""
        page.click("a.play")
        page.wait_for_function("window.ciberrato?.store.last === 60")
        page.wait_for_function("window.ciberrato.state.t === 60")  # it plays by itself
        assert abs(page.evaluate("ciberrato.store.frames.at(-1).robots[0].dir")) > 5.0
        assert page.evaluate("ciberrato.store.frames[0].robots[0].dir") == 0.0
        # Panels are drawn ten times a second.
        page.wait_for_function(
            "(name) => document.querySelector('#robots').innerText.includes(name)", arg=EVIL
        )
        page.wait_for_function("document.querySelector('#status').innerText.includes('seed 1')")
        page.click("#back")
        page.wait_for_selector("table.ranking")
        assert page.evaluate("window.hit") is None
        assert faults == []
        assert all(url.startswith("file:") for url in requests)
        browser.close()


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here; apt-get install chromium brings one")
def test_a_run_of_a_tournament_plays_with_all_its_robots_as_the_course_calls_them(tmp_path):
    write(tmp_path, "one", ROBOT)
    write(tmp_path, "two", ROBOT)
    path = tmp_path / "course.toml"
    settings = "[tournament]\nplaces = 'draw'\n"
    lab = "[[lab]]\nname = 'maze'\ngrid = 'maze'\nset = {SimTime = 40}\n"
    evil = table("one").replace("name = 'one'", f'name = "{EVIL}"').replace("{name}", "the same")
    path.write_text(settings + lab + evil + table("two").replace("{name}", "the same"))
    report = tmp_path / "report"
    run(path, "--tournament", "--quiet", "--output", report)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS, timeout=MILLISECONDS)
        page = browser.new_page()
        page.set_default_timeout(MILLISECONDS)
        faults = []
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("console", lambda message: faults.append(message.text) if message.type == "error" else None)
        page.goto((report / "index.html").as_uri())
        assert EVIL in page.inner_text("table.duels")
        page.click("#meetings summary")
        assert EVIL in page.inner_text("table.meetings")
        page.click("table.meetings a.play")
        page.wait_for_function("window.ciberrato?.store.last === 40")
        assert page.evaluate("ciberrato.store.frames.at(-1).robots.length") == 2
        for name in (EVIL, "two"):
            page.wait_for_function(
                "(name) => document.querySelector('#robots').innerText.includes(name)", arg=name
            )
        assert page.evaluate("window.hit") is None
        assert faults == []
        browser.close()
