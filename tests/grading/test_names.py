"""Names of agents, labs and courses that would like to be more than names: inert in every report."""

import unicodedata
from pathlib import Path

import pytest
from lxml import etree
from playwright.sync_api import sync_playwright

from ciberrato.grading.course import QUANTITIES, Agent, Course, GradedLab, Limits, Points
from ciberrato.grading.expressions import Formula
from ciberrato.grading.outcome import Outcome
from ciberrato.grading.report import junit, write_report
from ciberrato.grading.report.pieces import MOST_NAME_SHOWN
from ciberrato.grading.runner import Graded
from ciberrato.grading.standing import standings
from ciberrato.grading.task import Task
from ciberrato.grading.telling import shown
from tests.grading.test_playing import ARGUMENTS, CHROMIUM, MILLISECONDS

NAMES = [
    "<img src=x onerror='window.hit=1'>",
    "</title></script><script>window.hit=1</script>",
    "\x1b[2J\x1b]0;mine\x07\x9b31m\x00",
    "\u202egnp.exe\u2066\u200b\u2028next",
    '"onmouseover="window.hit=1" x="',
    "m" * 400,
    "\u0645" * 400,
]


@pytest.fixture(scope="module")
def graded():
    labs = tuple(GradedLab(name, Path(str(number))) for number, name in enumerate(NAMES))
    agents = tuple(Agent(name, ("x",)) for name in NAMES)
    points = Points(Formula("score", QUANTITIES))
    course = Course(NAMES[1], agents, labs, (1,), True, 1.0, None, Limits(), points)
    outcome = Outcome(status="finished", detail=NAMES[0], registered=True, score=5, time=9, cycle_time=50)
    runs = [
        Graded(Task(agent, lab, 1, f"{i} {j}", f"{i}-{j}"), outcome, {"tail": "\n".join(NAMES), "wall": 0.5})
        for i, agent in enumerate(agents)
        for j, lab in enumerate(labs)
    ]
    return course, standings(course, runs)


def unseen(text):
    return {sign for sign in text if unicodedata.category(sign) in ("Cc", "Cf", "Zl", "Zp")} - {
        "\n",
        "\u200d",
    }


def test_names_are_inert_in_junit_and_in_the_terminal(graded):
    root = etree.fromstring(junit.junit_document(*graded).encode())
    suites = [suite.get("name") for suite in root.iter("testsuite")]
    assert sorted(suites) == sorted(map(shown, NAMES))
    texts = [value for element in root.iter() for value in (*element.attrib.values(), element.text or "")]
    assert not unseen("".join(texts))


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here; apt-get install chromium brings one")
def test_names_are_inert_in_the_report(graded, tmp_path):
    write_report(*graded, tmp_path, missing=0)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS, timeout=MILLISECONDS)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.set_default_timeout(MILLISECONDS)
        page.goto((tmp_path / "index.html").as_uri())
        page.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
        page.mouse.move(300, 300)
        assert page.evaluate("window.hit") is None
        assert page.locator("img, body script:not([src])").count() == 0
        text = page.evaluate("document.body.textContent")
        assert not unseen(text) - {"\t"}
        assert NAMES[0] in text
        # Long names are cut, and whole on hover; they do not make the page wider.
        links = page.locator(".ranking a")
        assert max(map(len, links.all_text_contents())) <= max(MOST_NAME_SHOWN, len(NAMES[1]))
        titles = page.locator(".ranking a span[title]").evaluate_all("(all) => all.map((one) => one.title)")
        assert NAMES[5] in titles
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        page.screenshot(path=tmp_path / "report.png")
        browser.close()
