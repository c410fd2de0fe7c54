"""The page in a real browser: open, start, watch, stop, reset, look back."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from ciberrato.files.lab import read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import other_robot_distance, sensor_distances
from ciberrato.labs import find_lab
from ciberrato.net import UdpLink
from ciberrato.net.overlay import OverlayClient
from ciberrato.overlay import Circle, GridBelief, OverlayMessage, Text
from ciberrato.protocol import Actions, Measures, RobotRegistration, decode_simulator_message, encode
from ciberrato.viewer.page_messages import lab_document

from .conftest import SECONDS

MILLISECONDS = 1000 * SECONDS
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
EVIL = "<img src=x onerror='window.hit=1'>"

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here; apt-get install chromium brings one"),
    pytest.mark.slow,
]


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    # For this module only: while it runs, no other asyncio loop can in this thread.
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()


class Driver(threading.Thread):
    """A robot that drives in a circle as long as it is let."""

    def __init__(self, port: int, name: str, position: int = 0) -> None:
        super().__init__(daemon=True)
        self._link = UdpLink("127.0.0.1", port)
        self._link.register(encode(RobotRegistration(name=name, robot_id=position)))
        reply = self._link.receive(SECONDS)
        assert reply is not None
        assert b"Ok" in reply
        self.over = threading.Event()
        self.start()

    def run(self) -> None:
        while not self.over.is_set():
            data = self._link.receive(0.2)
            if data is not None and isinstance(decode_simulator_message(data), Measures):
                self._link.send(encode(Actions(left_motor=0.08, right_motor=0.1)))

    def close(self) -> None:
        self.over.set()
        self.join(SECONDS)
        self._link.close()


class World:
    """A simulator, a viewer, and robots."""

    def __init__(self, *simulator_options: str) -> None:
        self.robots: list[Driver] = []
        self._simulator = self._start("simulator_stub", "--port", "0", "--seed", "1", *simulator_options)
        self.port = int(self._expect(self._simulator, r"listening on udp .*:(\d+)"))
        self._viewer = self._start(
            "ciberrato.viewer", "--simulator", f"127.0.0.1:{self.port}", "--http", "0", "--overlay", "0"
        )
        self.url = self._expect(self._viewer, r"page: (\S+)")
        self.overlay_port = int(self._expect(self._viewer, r"overlay: 127.0.0.1:(\d+)"))

    def _start(self, module: str, *arguments: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", module, *arguments]
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)

    def _expect(self, process: subprocess.Popen[str], pattern: str) -> str:
        assert process.stdout is not None
        for line in process.stdout:
            found = re.match(pattern, line)
            if found:
                return found.group(1)
        raise AssertionError(f"{process.args} ended without saying {pattern}")

    def robot(self, name: str, position: int = 0) -> Driver:
        self.robots.append(Driver(self.port, name, position))
        return self.robots[-1]

    def close(self) -> None:
        for robot in self.robots:
            robot.close()
        for process in (self._viewer, self._simulator):
            process.terminate()
            process.communicate(timeout=SECONDS)


@pytest.fixture
def world() -> Iterator[World]:
    made = World("--lab", "open", "--grid", "open", "--speed", "4")
    yield made
    made.close()


@pytest.fixture
def page(chromium: Any, world: World) -> Iterator[Any]:
    page = chromium.new_page(viewport={"width": 1280, "height": 800})
    page.set_default_timeout(MILLISECONDS)
    problems: list[str] = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda message: problems.append(message.text) if message.type == "error" else None)
    page.goto(world.url)
    page.wait_for_selector('#status[data-state="watching"]')
    yield page
    page.close()
    assert problems == []


def place(page: Any, robot: int = 1) -> tuple[float, float]:
    transform = page.get_attribute(f'.robot-g[data-robot="{robot}"]', "transform")
    x, y = map(float, re.findall(r"-?[\d.]+(?:e-?\d+)?", transform))
    return x, y


def expect_text(page: Any, selector: str, pattern: str) -> None:
    script = "([s, p]) => new RegExp(p).test(document.querySelector(s)?.textContent ?? '')"
    page.wait_for_function(script, arg=[selector, pattern])


def wait_for(page: Any, condition: str) -> None:
    # As a function: the page's own policy forbids to evaluate text.
    page.wait_for_function(f"() => {condition}")


def test_open_start_watch_stop_look_back_reset(world: World, page: Any) -> None:
    assert page.text_content("#lab-name") == "Open"
    assert page.is_disabled("#start")  # nobody is there to be started
    world.robot("santos", 6)
    page.wait_for_selector('.robot-g[data-robot="6"]')
    assert place(page, 6) == (3.0, 5.0)
    expect_text(page, "#robots .name", "^santos$")
    expect_text(page, "#phase", "ready")

    page.click("#start")
    expect_text(page, "#phase", "running")
    wait_for(page, "Number(document.querySelector('#time').textContent) > 40")
    moved = place(page, 6)
    assert math.dist(moved, (3.0, 5.0)) > 0.5

    page.click("#stop")
    expect_text(page, "#phase", "stopped")
    stopped = int(page.text_content("#time"))
    wait_for(page, "document.querySelector('#start').disabled === false")

    # Back to the first cycles: the robot is where it was, the simulator's time stands in the slider's end.
    page.fill("#scrubber", "10")
    expect_text(page, "#time", "^10$")
    wait_for(page, "window.ciberrato.store.gapAt(10) === false")
    at_ten = place(page, 6)
    assert math.dist(at_ten, (3.0, 5.0)) < math.dist(moved, (3.0, 5.0))
    assert page.get_attribute("#live", "aria-pressed") == "false"
    assert int(page.get_attribute("#scrubber", "max")) == stopped
    page.fill("#scrubber", "0")
    wait_for(page, "document.querySelector('#time').textContent === '0'")
    assert place(page, 6) == (3.0, 5.0)
    page.click("#live")
    expect_text(page, "#time", f"^{stopped}$")

    page.click("#reset")
    page.click("#ask-yes")
    expect_text(page, "#phase", "no robots")
    page.wait_for_selector('#status[data-state="watching"]')
    assert page.locator(".robot-g").count() == 0
    assert page.text_content("#lab-name") == "Open"


def test_keys_do_what_buttons_do(world: World, page: Any) -> None:
    world.robot("one", 1)
    world.robot("two", 2)
    page.wait_for_selector('.robot-g[data-robot="2"]')
    page.keyboard.press("2")
    page.wait_for_selector('.robot-g[data-robot="2"][data-chosen="true"]')
    page.keyboard.press("Space")
    expect_text(page, "#phase", "running")
    wait_for(page, "Number(document.querySelector('#time').textContent) > 5")
    page.keyboard.press("Space")
    expect_text(page, "#phase", "stopped")
    scale = page.evaluate("ciberrato.camera.k")
    page.keyboard.press("+")
    assert page.evaluate("ciberrato.camera.k") > scale
    page.keyboard.press("0")
    assert page.evaluate("ciberrato.camera.k") == scale
    page.keyboard.press("f")
    page.wait_for_selector('#follow[aria-pressed="true"]')
    now = int(page.text_content("#time"))
    page.keyboard.press(",")
    expect_text(page, "#time", f"^{now - 1}$")
    page.keyboard.press("l")
    page.keyboard.press("Escape")
    page.wait_for_selector('.robot-g[data-robot="2"][data-chosen="false"]')
    dark = page.evaluate("document.documentElement.dataset.theme")
    page.keyboard.press("d")
    assert page.evaluate("document.documentElement.dataset.theme") != dark
    page.keyboard.press("?")
    page.wait_for_selector("#keys[open]")
    page.keyboard.press("Escape")
    page.wait_for_selector("#keys:not([open])", state="hidden")
    page.keyboard.press("c")
    wait_for(page, "document.querySelectorAll('.cones').length === 2")
    # Everything that can be pressed can be reached with the tab key, and says what it is.
    names = page.evaluate("""[...document.querySelectorAll('button, select, input')]
        .filter((e) => !(e.ariaLabel || e.textContent.trim()))
        .map((e) => e.outerHTML)""")
    assert names == []


def test_removing_a_robot_is_asked_for_and_done(world: World, page: Any) -> None:
    world.robot("one", 1)
    page.click("#robots .remove")
    page.click("#ask-yes")
    page.wait_for_selector('.robot-g[data-robot="1"][data-state="Removed"]')
    expect_text(page, "#events", "one was removed")


def test_beliefs_and_shapes_of_an_agent_are_drawn_and_kept(world: World, page: Any) -> None:
    world.robot("santos", 1)
    page.wait_for_selector(".robot-g")
    beliefs = [np.full((7, 14), 1 / 98), np.zeros((7, 14))]
    beliefs[1][1, 1] = 1.0
    with OverlayClient(port=world.overlay_port) as agent:
        for time, belief in zip((0, 10), beliefs, strict=True):
            shapes = (
                Circle(id="goal", x=5.0, y=5.0, radius=1.0, ttl=None),
                Text(id="note", x=5.0, y=5.0, text=EVIL, ttl=None),
            )
            cells = GridBelief(cells=belief)
            agent.send(OverlayMessage(source=EVIL, robot=1, time=time, belief=cells, shapes=shapes))
            expect_text(page, "#entropy", "^6.61$" if time == 0 else "^0.00$")
    expect_text(page, "#modes", "1, 1 100 %")
    assert page.locator('[data-shape="goal"]').count() == 1
    expect_text(page, "#scene", "onerror")  # as text
    assert page.evaluate("window.hit") is None
    painted = """([column, row]) => {
        const canvas = document.querySelector('#paint'), box = canvas.getBoundingClientRect();
        const [x, y] = ciberrato.camera.toScreen(2 * column + 0.3, 2 * row + 0.3);
        const k = canvas.width / box.width;
        return canvas.getContext('2d').getImageData(x * k, y * k, 1, 1).data[3];
    }"""
    wait_for(page, f"({painted})([1, 1]) > 200")
    assert page.evaluate(painted, [9, 4]) == 0
    assert page.locator("#curve path.entropy").count() == 1


def test_a_name_is_text_whatever_it_holds(world: World, page: Any) -> None:
    world.robot(EVIL, 1)
    page.wait_for_selector(".robot-g")
    expect_text(page, "#robots .name", "onerror")
    expect_text(page, "#events", "onerror")
    assert page.evaluate("window.hit") is None


def test_a_phone_shows_everything_without_scrolling_sideways(chromium: Any, world: World) -> None:
    world.robot("santos", 1)
    with chromium.new_context(viewport={"width": 390, "height": 844}, has_touch=True) as context:
        page = context.new_page()
        page.goto(world.url)
        page.wait_for_selector(".robot-g", timeout=MILLISECONDS)
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        small = page.evaluate("""[...document.querySelectorAll('button, input, select')]
            .filter((e) => e.offsetParent)
            .map((e) => [e.id, e.getBoundingClientRect()])
            .filter(([, box]) => box.right > 390 || box.left < 0 || box.height < 26)
            .map(([id]) => id)""")
        assert small == []
        page.tap("#start")
        expect_text(page, "#phase", "running")


def test_the_page_comes_back_when_the_viewer_was_away(world: World, page: Any) -> None:
    page.evaluate("ciberrato.socket.socket.close()")
    page.wait_for_selector('#status[data-state="gone"]')
    page.wait_for_selector('#status[data-state="watching"]')


def test_cones_are_computed_as_the_library_does(page: Any) -> None:
    script = """async ([lab, poses, others]) => {
        const { look, reflectors } = await import('/infrared.js');
        const scene = reflectors(lab), nothing = { faces: [], corners: [] };
        const finite = (d) => Number.isFinite(d) ? d : -1;
        return poses.map(([x, y, direction], i) => {
            const other = { id: 2, x: others[i][0], y: others[i][1] };
            return [
                finite(look(scene, { id: 1, x, y }, direction).distance),
                finite(look(nothing, { id: 1, x, y }, direction, [other]).distance),
            ];
        });
    }"""
    rng = np.random.default_rng(4)
    count = 300
    for name in ("rooms", "diagonals", "lines"):
        lab = read_lab(find_lab(name))
        x, y = rng.uniform(0.6, lab.width - 0.6, count), rng.uniform(0.6, lab.height - 0.6, count)
        direction = rng.uniform(-math.pi, math.pi, count)
        others = np.stack([x, y], axis=1) + rng.uniform(-3.0, 3.0, (count, 2))
        poses = np.stack([x, y, direction], axis=1)
        expected = sensor_distances(WallMap.from_lab(lab), x, y, direction)
        robot = np.array([other_robot_distance(*p, *q) for p, q in zip(poses, others, strict=True)])
        assert np.isfinite(robot).any()
        got = np.array(page.evaluate(script, [lab_document(lab), poses.tolist(), others.tolist()]))
        np.testing.assert_allclose(got[:, 0], expected, atol=1e-9, err_msg=name)
        np.testing.assert_allclose(got[:, 1], np.where(np.isfinite(robot), robot, -1.0), atol=1e-9)
