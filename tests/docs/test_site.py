"""The manual as a site: it builds without warnings, and what its commands say is what the programs take."""

import importlib.util
import os
import re
import shlex
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs").glob("*.md"))
MODULES = {
    "agent": "agent",
    "simulator": "simulator_stub",
    "viewer": "ciberrato.viewer",
    "evaluate": "ciberrato.evaluation",
    "lab": "ciberrato.labtool",
    "grade": "ciberrato.grading",
}


@pytest.mark.slow
@pytest.mark.skipif(not importlib.util.find_spec("sphinx"), reason="Sphinx is not installed (extra docs)")
def test_it_builds_without_a_warning_and_without_the_network(tmp_path):
    words = [sys.executable, "-m", "sphinx", "-W", "-q", "-b", "html", "-d", str(tmp_path / "trees")]
    environment = {**os.environ, "http_proxy": "http://127.0.0.1:9", "https_proxy": "http://127.0.0.1:9"}
    source = tmp_path / "docs"
    for name in ("CHANGELOG.md", "SECURITY.md"):
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    subprocess.run(["cp", "-r", str(ROOT / "docs"), str(source)], check=True)
    for name in ("ciberrato", "agent", "simulator_stub", "maps", "examples"):
        (tmp_path / name).symlink_to(ROOT / name)
    done = subprocess.run(
        [*words, str(source), str(tmp_path / "site")], capture_output=True, text=True, env=environment
    )
    assert (done.returncode, done.stderr) == (0, "")
    site = tmp_path / "site"
    for page in PAGES:
        assert (site / f"{page.stem}.html").exists(), page.name
    assert "No such file" not in (site / "commands.html").read_text()
    assert "https://" not in re.sub(
        r'href="[^"]*"',
        "",
        " ".join(re.findall(r"<(?:script|link)[^>]*>", (site / "index.html").read_text())),
    )


@cache
def usage(*words: str) -> str:
    """Return the help of a program or of one of its subcommands."""
    return subprocess.run([sys.executable, "-m", *words, "--help"], capture_output=True, text=True).stdout


def commands():
    """Yield page, program and words of every command line of a program of ours in the manual."""
    for page in [*PAGES, ROOT / "README.md"]:
        if page.name == "changelog.md":
            continue
        text = page.read_text().replace("\\\n", " ")
        for line in re.findall(r"^(?:\$ )?(ciberrato-\w+ .*)$|`(ciberrato-\w+ [^`]*)`", text, re.MULTILINE):
            if found := re.match(r"ciberrato-(\w+)(.*?)(?: {3,}.*| &| \|.*| >.*)?$", max(line)):
                yield page.name, found[1], found[2]


@pytest.mark.parametrize("page", sorted({page for page, _, _ in commands()}))
def test_the_options_in_a_page_are_options_of_the_programs(page):
    for where, program, rest in commands():
        if where != page:
            continue
        words = shlex.split(rest, comments=True)
        known = usage(MODULES[program])
        subcommands = program in {"agent", "lab"} or words[:1] == ["check"]
        if words and not words[0].startswith("-") and subcommands:
            known = usage(MODULES[program], words[0])
        for word in words:
            if option := re.match(r"--[a-z-]+", word):
                assert re.search(rf"{option[0]}\b", known), f"{page}: ciberrato-{program}{rest}"


def test_the_commands_are_found():
    assert len(list(commands())) > 60
