"""Screenshots of the viewer's page, for the manual: ``python -m examples.viewer_figures [FOLDER]``.

Starts simulators, viewers and robots on free ports, and takes the pictures with Chromium without a screen.
Needs the packages of the ``dev`` extra and Chromium.
"""

from __future__ import annotations

import contextlib
import re
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ciberrato.errors import UsageError
from ciberrato.net import UdpLink
from ciberrato.protocol import Actions, Measures, RobotRegistration, decode_simulator_message, encode

FOLDER = Path("docs/figures")
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]
DESKTOP = {"width": 1280, "height": 800}
PHONE = {"width": 390, "height": 844}
BEAMER = {"width": 1920, "height": 1080}
TURN = 0.06
SCRUB = "const s = document.querySelector('#scrubber'); s.value = 45; s.dispatchEvent(new Event('input'))"
NEAR = 1.3
"""Reading of the front sensor at which a wanderer turns; every third one is bolder, and hits things."""


class Wanderer(threading.Thread):
    """A robot that drives on until something is near, and then turns where there is more room."""

    def __init__(self, port: int, name: str, position: int) -> None:
        super().__init__(daemon=True)
        self._link = UdpLink("127.0.0.1", port)
        self._link.register(encode(RobotRegistration(name=name, robot_id=position)))
        if b"Ok" not in (self._link.receive(10.0) or b""):
            raise UsageError(f"the simulator takes no robot at position {position}")
        self._turning = 0
        self._near = 30.0 if position % 3 == 0 else NEAR
        self.start()

    def run(self) -> None:
        """Drive until the simulator falls silent."""
        with self._link:
            while (data := self._link.receive(3.0)) is not None:
                message = decode_simulator_message(data)
                if isinstance(message, Measures):
                    left, right = self._steer([reading or 0.0 for reading in message.infrared])
                    self._link.send(encode(Actions(left_motor=left, right_motor=right)))

    def _steer(self, infrared: Sequence[float]) -> tuple[float, float]:
        front, left, right, _ = infrared
        if front > self._near or max(left, right) > 2.0 * self._near:
            self._turning = self._turning or (1 if right >= left else -1)
            return -TURN * self._turning, TURN * self._turning
        self._turning = 0
        return 0.11, 0.11


@contextlib.contextmanager
def started(pattern: str, module: str, *arguments: str) -> Iterator[re.Match[str]]:
    """Start a program of ours; return the first line of its output that matches."""
    command = [sys.executable, "-m", module, *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        try:
            assert process.stdout is not None
            matches = (re.match(pattern, line) for line in process.stdout)
            yield next(match for match in matches if match is not None)
        finally:
            process.terminate()


@contextlib.contextmanager
def simulated(lab: str, robots: int, *arguments: str) -> Iterator[tuple[str, int, int]]:
    """Run a simulator with wanderers and a viewer; yield the page, the simulator's and the overlay port."""
    simulator = ("--lab", lab, "--grid", lab, "--port", "0", "--seed", "7", *arguments)
    with started(r"listening on udp .*:(\d+)", "simulator_stub", *simulator) as listening:
        port = int(listening[1])
        watched = ("--simulator", f"127.0.0.1:{port}", "--http", "0", "--overlay", str(_free_udp_port()))
        with started(r"page: (\S+)", "ciberrato.viewer", *watched) as page:
            for number in range(1, robots + 1):
                Wanderer(port, f"mouse {number}", number)
            yield page[1], port, int(watched[-1])


def _free_udp_port() -> int:
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def shrink(path: Path) -> None:
    """Write a picture again with 256 colours, which is what such pages and figures need."""
    from PIL import Image

    with Image.open(path) as picture:
        # This method keeps the hues of thin lines: no colour is off by more than a tenth.
        method, dither = Image.Quantize.MAXCOVERAGE, Image.Dither.NONE
        small = picture.convert("RGB").quantize(256, method=method, kmeans=2, dither=dither)
    small.save(path, optimize=True)


class Studio:
    """Takes pictures of pages.

    Parameters
    ----------
    browser : playwright Browser
    folder : Path
    """

    def __init__(self, browser: Any, folder: Path) -> None:
        self._browser = browser
        self._folder = folder

    def take(
        self,
        name: str,
        url: str,
        until: str,
        *,
        size: dict[str, int] = DESKTOP,
        scheme: str = "light",
        act: str = "",
    ) -> None:
        """Open a page, wait until a condition in JavaScript holds, do something, take the picture."""
        context = self._browser.new_context(
            viewport=size, color_scheme=scheme, device_scale_factor=2 if size is PHONE else 1
        )
        page = context.new_page()
        page.set_default_timeout(90_000)
        page.goto(url)
        page.wait_for_function(f"() => window.ciberrato?.state.lab && ({until})")
        if act:
            page.evaluate(act)
        page.wait_for_timeout(700)  # the panels are written ten times a second
        path = self._folder / f"viewer-{name}.png"
        page.screenshot(path=path)
        context.close()
        shrink(path)
        print(path)


def take_all(studio: Studio, folder: Path) -> None:
    """Capture all pictures.

    Parameters
    ----------
    studio : Studio
    folder : Path
        For the files that the programs write.
    """
    frame = "ciberrato.state.frame"
    with simulated("maze", 3) as (url, _, _):
        studio.take("ready", url, f"{frame}.robots.length === 3")
    with simulated("corridors", 0, "--autostart", "1") as (url, port, overlay):
        agent = ("-h", f"127.0.0.1:{port}", "--viewer", f"127.0.0.1:{overlay}", "-p", "2", "-r", "santos")
        command = [sys.executable, "-m", "examples.overlay_agent", *agent, "-m", "corridors"]
        with subprocess.Popen(command) as process:
            studio.take("belief", url, f"{frame}.time >= 25")
            studio.take("dark", url, f"{frame}.time >= 75", scheme="dark")
            studio.take("phone", url, f"{frame}.time >= 100", size=PHONE)
            studio.take("scrubbed", url, f"{frame}.time >= 170", act=SCRUB)
            process.terminate()
    _record(folder)
    shown = ("--run", str(folder / "run.jsonl"), "--beliefs", str(folder / "localization.out"), "--http", "0")
    with started(r"page: (\S+)", "ciberrato.viewer", *shown) as page:
        studio.take("recording", page[1], "ciberrato.store.last > 50", act=SCRUB)
    short = folder / "short.xml"
    short.write_text('<Parameters SimTime="700" MotorsNoise="1.5"/>')
    with simulated("maze", 4, "--autostart", "4", "--speed", "4", "--param", str(short)) as (url, _, _):
        studio.take("end", url, f"{frame}.phase === 'finished' && ciberrato.state.marks.length > 3")
    with simulated("open", 20, "--autostart", "20", "--speed", "3") as (url, _, _):
        studio.take("twenty", url, f"{frame}.time >= 250")
    with simulated("maze", 4, "--autostart", "4") as (url, _, _):
        studio.take("projection", f"{url}#projection", f"{frame}.time >= 120", size=BEAMER)
    with simulated("lines", 1, "--autostart", "1") as (url, _, _):
        act = "document.querySelector('#follow').click()"
        studio.take("follow", url, f"{frame}.time >= 60", act=act)


def _record(folder: Path) -> None:
    """Record the log of the agent's drive through a corridor."""
    simulator = ("--lab", "corridors", "--grid", "corridors", "--port", "0", "--seed", "7", "--lockstep")
    arguments = (*simulator, "--autostart", "1", "--speed", "20")
    with started(r"listening on udp .*:(\d+)", "simulator_stub", *arguments) as listening:
        agent = ("-h", f"127.0.0.1:{listening[1]}", "-m", "corridors", "-p", "2", "-r", "santos")
        files = ("--log", str(folder / "run.jsonl"), "-o", str(folder / "localization.out"))
        command = [sys.executable, "-m", "agent", *agent, *files, "--exit-at-wall", "--quiet"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the pictures to a folder, by default docs/figures."""
    words = sys.argv[1:] if arguments is None else arguments
    folder = Path(words[0]) if words else FOLDER
    chromium = shutil.which("chromium")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        chromium = None
    if chromium is None:
        print("viewer_figures: needs Chromium (apt-get install chromium) and playwright", file=sys.stderr)
        return 2
    folder.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as scratch:
        browser = playwright.chromium.launch(executable_path=chromium, args=ARGUMENTS)
        take_all(Studio(browser, folder), Path(scratch))
        browser.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
