"""The page in a real browser: open, start, watch, stop, reset, look back."""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
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
    "--disable-dev-shm-usage",
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
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS, timeout=MILLISECONDS)
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

    def stop_simulator(self) -> None:
        self._simulator.kill()
        self._simulator.wait(SECONDS)

    def close(self) -> None:
        for robot in self.robots:
            robot.close()
        for process in (self._viewer, self._simulator):
            process.terminate()
            process.communicate(timeout=SECONDS)


@pytest.fixture
def world(tmp_path: Path) -> Iterator[World]:
    endless = tmp_path / "endless.xml"  # no slow machine comes to its end before the test does
    endless.write_text('<Parameters SimTime="100000000"/>')
    made = World("--lab", "open", "--grid", "open", "--speed", "4", "--param", str(endless))
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


def becomes(page: Any, script: str, wanted: object, argument: object = None) -> None:
    """Wait until ``script`` returns ``wanted``: parts of the page are drawn at moments of their own."""
    same = f"([argument, wanted]) => JSON.stringify(({script})(argument)) === wanted"
    text = json.dumps(wanted, ensure_ascii=False, separators=(",", ":"))
    try:
        page.wait_for_function(same, arg=[argument, text])
    except Exception as error:
        raise AssertionError(f"{page.evaluate(script, argument)!r} never became {wanted!r}") from error


def attribute_becomes(page: Any, selector: str, name: str, wanted: str) -> None:
    becomes(page, "([s, n]) => document.querySelector(s)?.getAttribute(n) ?? null", wanted, [selector, name])


def text_becomes(page: Any, selector: str, wanted: str) -> None:
    becomes(page, "(s) => document.querySelector(s)?.textContent ?? null", wanted, selector)


def count_becomes(page: Any, selector: str, wanted: int) -> None:
    becomes(page, "(s) => document.querySelectorAll(s).length", wanted, selector)


def disabled_becomes(page: Any, selector: str, wanted: bool) -> None:
    becomes(page, "(s) => document.querySelector(s)?.disabled", wanted, selector)


PLACE = r"""(robot) => document.querySelector(`.robot-g[data-robot="${robot}"]`)
    .getAttribute("transform").match(/-?[\d.]+(?:e-?\d+)?/g).slice(0, 2).map(Number)"""
DISTANCE = f"(([x, y]) => Math.hypot(x - point[0], y - point[1]))(({PLACE})(robot))"


def distance_exceeds(page: Any, robot: int, point: tuple[float, float], least: float) -> None:
    """Wait until the robot is drawn more than ``least`` units from ``point``."""
    page.wait_for_function(f"([robot, point, least]) => {DISTANCE} > least", arg=[robot, point, least])


def distance_falls_below(page: Any, robot: int, point: tuple[float, float], most: float) -> None:
    """Wait until the robot is drawn less than ``most`` units from ``point``."""
    page.wait_for_function(f"([robot, point, most]) => {DISTANCE} < most", arg=[robot, point, most])


def place_becomes(page: Any, robot: int, wanted: tuple[float, float]) -> None:
    becomes(page, PLACE, list(wanted), robot)


def place(page: Any, robot: int = 1) -> tuple[float, float]:
    x, y = page.evaluate(PLACE, robot)
    return x, y


def expect_text(page: Any, selector: str, pattern: str) -> None:
    script = "([s, p]) => new RegExp(p).test(document.querySelector(s)?.textContent ?? '')"
    page.wait_for_function(script, arg=[selector, pattern])


def wait_for(page: Any, condition: str) -> None:
    # As a function: the page's own policy forbids to evaluate text.
    page.wait_for_function(f"() => {condition}")


def settled(page: Any, expression: str) -> Any:
    """Return the value of an expression once it has stayed the same for ten pictures."""
    return page.evaluate(f"""async () => {{
        const value = () => {expression};
        let last = value();
        for (let same = 0; same < 10; same += 1) {{
            await new Promise(requestAnimationFrame);
            if (value() !== last) [last, same] = [value(), -1];
        }}
        return last;
    }}""")


def test_open_start_watch_stop_look_back_reset(world: World, page: Any) -> None:
    text_becomes(page, "#lab-name", "Open")
    disabled_becomes(page, "#start", True)  # no robot is there to be started
    world.robot("santos", 6)
    page.wait_for_selector('.robot-g[data-robot="6"]')
    place_becomes(page, 6, (3, 5))
    expect_text(page, "#robots .name", "^santos$")
    expect_text(page, "#phase", "ready")

    page.click("#start")
    expect_text(page, "#phase", "running")
    wait_for(page, "Number(document.querySelector('#time').textContent) > 40")
    distance_exceeds(page, 6, (3.0, 5.0), 0.5)

    page.click("#stop")
    expect_text(page, "#phase", "stopped")
    disabled_becomes(page, "#start", False)
    # What the panels show is as old as a tenth of a second; the last cycle is that of the last frame.
    wait_for(page, "ciberrato.state.frame.phase === 'stopped'")
    stopped = int(page.evaluate("ciberrato.state.frame.time"))
    text_becomes(page, "#time", str(stopped))
    moved = place(page, 6)

    # Back to the first cycles: the robot is where it was, the simulator's time stands in the slider's end.
    page.fill("#scrubber", "10")
    expect_text(page, "#time", "^10$")
    wait_for(page, "window.ciberrato.store.gapAt(10) === false")
    distance_falls_below(page, 6, (3.0, 5.0), math.dist(moved, (3.0, 5.0)))  # drawn, too
    attribute_becomes(page, "#live", "aria-pressed", "false")
    attribute_becomes(page, "#scrubber", "max", str(stopped))
    page.fill("#scrubber", "0")
    text_becomes(page, "#time", "0")
    place_becomes(page, 6, (3, 5))
    page.click("#live")
    expect_text(page, "#time", f"^{stopped}$")

    page.click("#reset")
    page.click("#ask-yes")
    expect_text(page, "#phase", "no robots")
    page.wait_for_selector('#status[data-state="watching"]')
    count_becomes(page, ".robot-g", 0)
    text_becomes(page, "#lab-name", "Open")


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
    scale = settled(page, "ciberrato.camera.k")
    page.keyboard.press("+")
    wait_for(page, f"ciberrato.camera.k > {scale}")
    page.keyboard.press("0")
    wait_for(page, f"ciberrato.camera.k === {scale}")
    page.keyboard.press("f")
    page.wait_for_selector('#follow[aria-pressed="true"]')
    wait_for(page, "ciberrato.state.frame.phase === 'stopped'")
    now = int(page.evaluate("ciberrato.state.frame.time"))
    page.keyboard.press(",")
    expect_text(page, "#time", f"^{now - 1}$")
    page.keyboard.press("l")
    page.keyboard.press("Escape")
    page.wait_for_selector('.robot-g[data-robot="2"][data-chosen="false"]')
    dark = page.evaluate("document.documentElement.dataset.theme")
    page.keyboard.press("d")
    wait_for(page, f"document.documentElement.dataset.theme !== '{dark}'")
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
    expect_text(page, "#modes", r"^\(3, 3\) 100 %$")
    count_becomes(page, '[data-shape="goal"]', 1)
    expect_text(page, "#scene", "onerror")  # as text
    assert page.evaluate("window.hit") is None
    painted = """([column, row]) => {
        const canvas = document.querySelector('#paint'), box = canvas.getBoundingClientRect();
        const [x, y] = ciberrato.camera.toScreen(2 * column + 0.3, 2 * row + 0.3);
        const k = canvas.width / box.width;
        return canvas.getContext('2d').getImageData(x * k, y * k, 1, 1).data[3];
    }"""
    wait_for(page, f"({painted})([1, 1]) > 200")
    becomes(page, painted, 0, [9, 4])
    count_becomes(page, "#curve path.entropy", 1)


def test_a_name_is_text_whatever_it_holds(world: World, page: Any) -> None:
    world.robot(EVIL, 1)
    page.wait_for_selector(".robot-g")
    expect_text(page, "#robots .name", "onerror")
    expect_text(page, "#events", "onerror")
    assert page.evaluate("window.hit") is None


WIDTHS = {320: 640, 390: 844, 768: 900, 1024: 700, 1280: 800, 1920: 1080}
LONG = "x" * 400
# Turns the text round, hides itself, rings: in the page they are signs.
UNSEEN = "a\u202eb\u200bc\x7fd"
OVERPRINTED = """() => {
    const labels = [...document.querySelectorAll('#scene > g:last-child > text')];
    const boxes = labels.map((e) => e.getBoundingClientRect());
    const over = (a, b) =>
        a.left < b.right && b.left < a.right && a.top < b.bottom - 3 && b.top < a.bottom - 3;
    return boxes.filter((a, i) => boxes.some((b, j) => j > i && over(a, b))).length;
}"""
OUTSIDE = """() => [...document.querySelectorAll('body *')]
    .filter((e) => e.offsetParent && !e.closest('.symbols, .quiet'))
    .map((e) => [e.id || e.className, e.getBoundingClientRect()])
    .filter(([, box]) => box.width && (box.right > innerWidth + 1 || box.left < -1))
    .map(([name]) => name)"""


def test_no_width_overflows_and_no_label_overprints_another(chromium: Any, world: World) -> None:
    for position, name in enumerate((LONG, EVIL, UNSEEN, "mouse 4"), start=1):
        world.robot(name, position)
    for width, height in WIDTHS.items():
        with chromium.new_context(viewport={"width": width, "height": height}, has_touch=True) as context:
            page = context.new_page()
            page.set_default_timeout(MILLISECONDS)
            page.goto(world.url)
            page.wait_for_selector('.robot-g[data-robot="4"]')
            page.wait_for_selector("#events li:nth-child(4)")
            page.wait_for_selector("#robots li:nth-child(4)")
            wait_for(page, "document.querySelectorAll('#scene > g:last-child > text').length >= 4")
            wait_for(page, f"document.documentElement.scrollWidth <= {width}")
            becomes(page, OUTSIDE, [])
            becomes(page, OVERPRINTED, 0)
            # The lab is as wide, or as high, as there is room for it.
            share = """() => {
                const { camera } = ciberrato, { top, bottom } = camera.insets;
                const wide = camera.lab.width * camera.k / camera.width;
                return Math.max(wide, camera.lab.height * camera.k / (camera.height - top - bottom)) > 0.92;
            }"""
            becomes(page, share, True)
            small = """() => [...document.querySelectorAll('button, input, select')]
                .filter((e) => e.offsetParent && e.getBoundingClientRect().height < 26).map((e) => e.id)"""
            becomes(page, small, [])
            if width == 390:
                page.tap("#start")
                expect_text(page, "#phase", "running")
                page.tap("#stop")
                expect_text(page, "#phase", "stopped")


def test_long_names_are_cut_and_whole_for_those_who_hover(world: World, page: Any) -> None:
    world.robot(LONG, 1)
    world.robot(UNSEEN, 2)
    # Names come after the robots, and panels are drawn ten times a second.
    expect_text(page, "#robots li:nth-child(1) .name", "^x+…$")
    text_becomes(page, "#robots li:nth-child(2) .name", "a\ufffdb\ufffdc\ufffdd")
    attribute_becomes(page, "#robots li:first-child .name", "title", LONG)
    text_becomes(page, '.robot-g[data-robot="1"] title', LONG)
    text_becomes(page, ".tag[data-cut=true] title", LONG)
    titles = "[...document.querySelectorAll('#events li button')].map((one) => one.title)"
    wait_for(page, f"{titles}.some((title) => title.includes('{LONG}'))")


def test_the_events_have_no_needless_scroll_bar(world: World, page: Any) -> None:
    for position in range(1, 9):
        world.robot(f"mouse {position}", position)
    page.wait_for_selector("#events li:nth-child(8)")
    page.wait_for_selector("#robots li:nth-child(8)")
    bars = """(selector) => {
        const { scrollWidth, clientWidth, scrollHeight, clientHeight } = document.querySelector(selector);
        return [scrollWidth - clientWidth, scrollHeight - clientHeight];
    }"""
    becomes(page, f"(selector) => ({bars})(selector)[0]", 0, "#events")
    # Where the panel has room, all of them are seen.
    page.set_viewport_size({"width": 1280, "height": 1300})
    becomes(page, bars, [0, 0], "#events")
    becomes(page, bars, [0, 0], "aside")


def test_projection_shows_the_lab_and_who_leads(world: World, page: Any) -> None:
    for position, name in enumerate((LONG, "two", "three"), start=1):
        world.robot(name, position)
    page.wait_for_selector('.robot-g[data-robot="3"]')
    before = settled(page, "ciberrato.camera.k")
    page.keyboard.press("w")
    page.wait_for_selector("#scores li:nth-child(3)")
    wait_for(page, f"ciberrato.camera.k > 1.2 * {before}")
    page.wait_for_url("**#projection")
    page.wait_for_selector("aside", state="hidden")
    wait_for(page, "document.documentElement.scrollWidth <= 1280")
    order = """async () => {
        const { ranking } = await import('/scoreboard.js');
        const robots = [[1, 5, 'Running'], [2, 9, 'Running'], [3, 99, 'Removed'], [4, 9, 'Finished']];
        return ranking(robots.map(([id, score, state]) => ({ id, score, state }))).map(({ id }) => id);
    }"""
    assert page.evaluate(order) == [2, 4, 1, 3]
    page.keyboard.press("w")
    page.wait_for_selector("aside")
    wait_for(page, f"ciberrato.camera.k === {before}")
    page.goto(f"{world.url}#projection")
    page.wait_for_selector("#scores li:nth-child(3)")


def test_the_state_of_a_simulator_that_is_gone_is_not_running(world: World, page: Any) -> None:
    world.robot("santos", 1)
    page.wait_for_selector(".robot-g")
    page.click("#start")
    expect_text(page, "#phase", "running")
    phases = """async () => {
        const { phaseNow } = await import('/sidebar.js');
        const { state } = await import('/state.js');
        const kept = { connected: state.connected, connection: state.connection };
        const frame = { phase: 'running', robots: [1] };
        const found = [];
        for (const [connected, connection, age] of
            [[true, 'watching', 0],
             [true, 'watching', 9999], [true, 'searching', 0], [false, 'watching', 0]]) {
            Object.assign(state, { connected, connection });
            found.push(phaseNow(frame, state.heard + age));
        }
        Object.assign(state, kept);
        return found;
    }"""
    assert page.evaluate(phases) == ["running", "silent", "gone", "gone"]
    world.stop_simulator()
    expect_text(page, "#phase", "^(silent|no contact)$")
    expect_text(page, "#rate", "–")
    page.wait_for_selector('#status[data-state="searching"]')
    expect_text(page, "#phase", "^no contact$")
    disabled_becomes(page, "#stop", True)


def test_a_page_without_a_simulator_says_where_it_looks(chromium: Any) -> None:
    nowhere = ("--http", "0", "--no-overlay", "--simulator", "127.0.0.1:9")
    command = [sys.executable, "-m", "ciberrato.viewer", *nowhere]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as viewer:
        assert viewer.stdout is not None
        url = viewer.stdout.readline().split()[1]
        page = chromium.new_page()
        page.set_default_timeout(MILLISECONDS)
        # The notice as it first was: before the address is known there is none.
        page.add_init_script("""new MutationObserver(() => {
            const notice = document.querySelector('#notice');
            window.notices ??= new Set();
            if (notice && !notice.hidden) window.notices.add(notice.textContent);
        }).observe(document, { subtree: true, childList: true, attributes: true })""")
        page.goto(url)
        page.wait_for_selector("#notice:not([hidden])")
        assert page.evaluate("[...window.notices].filter((text) => !text.includes('at 127.0.0.1:9.'))") == []
        page.close()
        viewer.terminate()
        viewer.communicate(timeout=SECONDS)


def test_a_picture_older_than_a_message_does_not_go_backwards(page: Any) -> None:
    script = """async () => {
        const { liveRobots } = await import('/time.js');
        const { tween } = await import('/state.js');
        const robot = (x) => ({ id: 1, x, y: 0, dir: 0 });
        const [from, to] = [1, 1.1].map((x) => ({ robots: [robot(x)] }));
        Object.assign(tween, { from, to, start: 1000, length: 50 });
        return [900, 999, 1000, 1025, 1050, 2000].map((now) => liveRobots(now)[0].x);
    }"""
    assert page.evaluate(script) == pytest.approx([1.0, 1.0, 1.0, 1.05, 1.1, 1.1])


def test_labels_find_free_places(page: Any) -> None:
    script = """async (count) => {
        const { arrange, ON } = await import('/labels.js');
        let seed = 1;
        const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647;
        const labels = Array.from({ length: count }, (_, key) => ({
            key, width: 20 + 60 * random(), height: 15, x: 500 * random(), y: 300 * random(), reach: 8,
            needed: key === 0,
            ...(key % 5 === 4 ? { choices: ON } : {}),
        }));
        const taken = labels.map(({ x, y }) => [x - 5, y - 5, x + 5, y + 5]).slice(0, 10);
        const before = new Map();
        const placed = arrange(labels, taken, { width: 500, height: 300 }, before);
        return [placed, taken, arrange(labels, taken, { width: 500, height: 300 }, before)];
    }"""
    placed, taken, again = page.evaluate(script, 40)
    assert placed == again  # nothing jumps while nothing moves
    assert placed[0] is not None
    shown = [box for box in placed if box is not None]
    assert 10 < len(shown) < 40
    for index, (left, top, right, bottom) in enumerate(shown[1:], start=1):
        assert 0 <= left < right <= 500
        assert 0 <= top < bottom <= 300
        for other in [*shown[:index], *taken]:
            assert left >= other[2] or right <= other[0] or top >= other[3] or bottom <= other[1]


def test_the_true_cell_is_that_of_the_beliefs_own_cycle(world: World, page: Any) -> None:
    world.robot("santos", 1)
    page.wait_for_selector(".robot-g")
    page.click("#start")
    wait_for(page, "ciberrato.state.frame.time > 60")
    page.click("#stop")
    expect_text(page, "#phase", "stopped")
    page.fill("#scrubber", "0")
    expect_text(page, "#time", "^0$")
    wait_for(page, "ciberrato.store.gapAt(0) === false")
    x, y = 3, 2
    place_becomes(page, 1, (x, y))
    page.click("#live")
    cells = np.full((7, 14), 0.001)
    cells[int(y // 2), int(x // 2)] = 1.0
    with OverlayClient(port=world.overlay_port) as agent:
        agent.send(OverlayMessage(source="santos", robot=1, time=0, belief=GridBelief(cells=cells)))
        expect_text(page, "#belief-when", r"^As of cycle 0, \d+ cycles ago; the robot was in \(\d+, \d+\)\.$")
    expect_text(page, "#true-cell", "^91 %$")
    # The ring is where the robot was, not where it is.
    page.wait_for_selector(".then", state="attached")
    ring = [float(page.get_attribute(".then", name)) for name in ("cx", "cy")]
    assert ring == pytest.approx([x, y])
    distance_exceeds(page, 1, (x, y), 0.3)
    expect_text(page, "#scene .then-text", "^cycle 0$")
    page.fill("#scrubber", "0")
    wait_for(page, "document.querySelector('.then') === null")


def test_the_page_comes_back_when_the_viewer_was_away(world: World, page: Any) -> None:
    # As long as there is no connection the page says so ...
    page.evaluate("ciberrato.socket.wait = 2 ** 31 - 1")
    page.evaluate("ciberrato.socket.socket.close()")
    page.wait_for_selector('#status[data-state="gone"]')
    page.evaluate("ciberrato.socket.connect()")
    page.wait_for_selector('#status[data-state="watching"]')
    # ... and it makes a new one by itself, at times before the panels are drawn.
    wait_for(page, "ciberrato.socket.wait < 1000")
    page.evaluate("window.before = ciberrato.socket.socket")
    page.evaluate("ciberrato.socket.socket.close()")
    wait_for(page, "ciberrato.socket.socket !== window.before && ciberrato.socket.socket.readyState === 1")
    wait_for(page, "ciberrato.state.connection === 'watching' && ciberrato.state.connected")
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
