"""What a notebook shows of labs, beliefs, runs and estimates: a picture of bounded size, names inert."""

from __future__ import annotations

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from ciberrato import Lab, Parameters, PoseFilter, find_grid, find_lab, read_grid, read_lab
from ciberrato.files.beliefs import parse_beliefs
from ciberrato.files.run_records import Cycle, RecordedRun, RunHeader
from ciberrato.localization.pose_filter import Estimate
from ciberrato.plot.shown import MOST_INCHES, html_of
from ciberrato.protocol import RobotRegistration
from ciberrato.world.lab import Wall
from simulator_stub.simulation import Simulation

EVIL = '"><script>alert(1)</script><img src=x onerror=alert(2)>$\\frac{'
HEADER = RunHeader(
    lab_name="x.xml", lab_sha256="", parameters=Parameters(), sensor_angles=(0.0, 60.0, -60.0, 180.0)
)
SMALL = Lab(
    name="small",
    width=8.0,
    height=6.0,
    walls=[Wall(corners=((1.9, 2.0), (2.1, 2.0), (2.1, 6.0), (1.9, 6.0)))],
)


class Elements(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.found, self.attributes, self.text = [], [], ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append(tag)
        self.attributes += [name for name, _ in attrs]

    def handle_data(self, data):
        self.text += data


def picture(text):
    (data,) = re.findall(r'src="data:image/png;base64,([^"]*)"', text)
    return Image.open(BytesIO(base64.b64decode(data)))


def run_of(cycles, **more):
    return RecordedRun(replace(HEADER, **more), tuple(cycles))


def belief(rows, columns, blocks=3):
    block = "\n".join(" ".join([f"{1 / (rows * columns):.12f}"] * columns) for _ in range(rows))
    certain = "\n".join(
        " ".join("1" if (r, c) == (0, 0) else "0" for c in range(columns)) for r in range(rows)
    )
    return parse_beliefs("\n\n".join([block, *[certain] * (blocks - 1)]))[0]


LIVE = [
    Cycle(time=t, estimate=(1 + 0.1 * t, 3.0, 0.0, min(1.0, t / 20)), entropy=6.0 / (1 + t))
    for t in range(40)
]
SHOWN = {
    "lab": SMALL,
    "belief": belief(7, 14),
    "long belief": belief(3, 3, 400),
    "run": run_of(LIVE),
    "run without estimates": run_of(Cycle(time=t, infrared=(1.0, 2.0, None, 0.5)) for t in range(9)),
    "long run": run_of(Cycle(time=t, infrared=(1.0, 2.0, None, 0.5)) for t in range(20_000)),
    "crowded lab": Lab(name="x" * 5000, width=40.0, height=20.0, walls=SMALL.walls * 3000),
    "large lab": Lab(width=1e6, height=1e6),
}


@pytest.mark.parametrize("name", sorted(SHOWN))
def test_it_is_a_picture_of_bounded_size_with_a_caption(name):
    text = SHOWN[name]._repr_html_()
    image = picture(text)
    assert max(image.size) <= MOST_INCHES * 80
    assert len(text) < 400_000
    assert len(np.unique(np.asarray(image.convert("L")))) > 10  # something is drawn
    assert set(Elements(text).found) == {"figure", "img", "figcaption", "code"}


@pytest.mark.parametrize(
    "record",
    [
        Lab(name=EVIL, width=8.0, height=6.0),
        run_of(LIVE, lab_name=EVIL, robot_name=EVIL),
        PoseFilter(Lab(name=EVIL, width=8.0, height=6.0), Parameters()),
    ],
    ids=["lab", "run", "filter"],
)
def test_names_are_inert(record):
    shown = Elements(record._repr_html_())
    assert set(shown.found) == {"figure", "img", "figcaption", "code"}
    assert set(shown.attributes) == {"style", "alt", "src"}
    assert "<script>" in shown.text  # as text


@pytest.mark.parametrize(
    "record",
    [
        Lab(width=0.0),
        Lab(width=-3.0, height=1e9),
        Lab(width=1e5, height=1.0),
        run_of([]),
        belief(1, 300),
    ],
    ids=["no width", "negative", "flat", "no cycles", "one row"],
)
def test_what_has_no_shape_to_draw_has_its_caption(record):
    assert Elements(record._repr_html_()).found == ["figure", "figcaption", "code"]


def test_an_estimate_is_a_table_of_the_poses_it_may_be(tmp_path, monkeypatch):
    monkeypatch.setenv("CIBERRATO_CACHE", str(tmp_path))
    simulation = Simulation(SMALL, read_grid(find_grid("standard")), seed=3)
    robot = simulation.register(RobotRegistration(name="r"))
    with PoseFilter(SMALL, Parameters(), wait=True) as localizer:
        before = localizer.estimate()._repr_html_()
        found = localizer.observe(simulation.launch()[robot])
        poses, weights = localizer.states()
        assert weights.sum() == pytest.approx(1.0)
        near = np.hypot(poses[:, 0] - found.x, poses[:, 1] - found.y) <= 0.5
        near &= np.abs(np.remainder(poses[:, 2] - found.heading + np.pi, 2 * np.pi) - np.pi) <= np.radians(10)
        assert weights[near].sum() == pytest.approx(found.probability, abs=0.01)
        entropy = -np.sum(weights * np.log2(weights))
        assert entropy == pytest.approx(found.entropy, abs=0.01)
        assert picture(localizer._repr_html_()).size[0] > 300
    assert "before the first message" in before
    shown = Elements(found._repr_html_())
    assert shown.found.count("tr") == 1 + min(len(found.modes), 8)
    assert f"probability {found.probability:.3f}" in shown.text


def test_nothing_known_is_said():
    nan = float("nan")
    empty = Estimate(
        time=None, x=nan, y=nan, heading=nan, probability=0.0, certain=False, modes=(), entropy=nan, behind=2
    )
    assert "nothing known yet, 2 messages wait" in empty._repr_html_()


def test_other_records_are_refused():
    with pytest.raises(TypeError, match="record: 3 is not shown"):
        html_of(3)


def test_labs_that_ship_are_shown():
    assert picture(read_lab(find_lab("lines"))._repr_html_()).size[0] > 300
