"""docs/extending.md: each section, done to a copy of the packages, works, and in as few files as it says."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "extending.md").read_text()
PACKAGES = ("ciberrato", "agent", "simulator_stub", "maps")
SECTIONS = dict(re.findall(r"^## An? ([^\n]+)\n(.*?)(?=^## |\Z)", TEXT, re.MULTILINE | re.DOTALL))
FILES = {"sensor": 4, "scoring mode": 2, "transport": 2, "drive": 2, "motion model": 1, "sensor model": 1}


@pytest.fixture
def house(tmp_path):
    for package in PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def edit(path, hunks):
    text = path.read_text()
    for hunk in re.split(r"^@@\n", hunks, flags=re.MULTILINE):
        lines = hunk.splitlines(keepends=True)
        before = "".join(line[1:] for line in lines if line[0] in " -")
        after = "".join(line[1:] for line in lines if line[0] in " +")
        assert text.count(before) == 1, f"{path}: found {text.count(before)} times:\n{before}"
        text = text.replace(before, after)
    path.write_text(text)


def changes(section):
    return re.findall(
        r"^`([\w/.]+)`( \(new\))?:\n\n```(?:python|diff)\n(.*?)```", section, re.MULTILINE | re.DOTALL
    )


@pytest.mark.parametrize("kind", FILES)
def test_adding_one_works(house, kind):
    section = SECTIONS[kind]
    for name, is_new, text in changes(section):
        path = house / name
        assert path.exists() != bool(is_new)
        if is_new:
            path.write_text(text)
        else:
            edit(path, text)
    (program,) = re.findall(r"^It works:\n\n```python\n(.*?)```", section, re.MULTILINE | re.DOTALL)
    (house / "it_works.py").write_text(program)
    done = subprocess.run(
        [sys.executable, "-W", "error", "it_works.py"],
        cwd=house,
        env={"PYTHONPATH": str(house), "PATH": "/usr/bin:/bin", "TMPDIR": str(house)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(("kind", "files"), FILES.items())
def test_it_takes_as_few_files_as_the_table_says(kind, files):
    table = dict(re.findall(r"^\| ([^|]+?) \| (\d)", TEXT, re.MULTILINE))
    said = int(table.get(kind, 0)) or int(table["sensor with a field of its own on the wire"]) + int(
        table["parameter of a sensor, announced"]
    )
    assert len({name for name, _, _ in changes(SECTIONS[kind])}) == said == files


def test_a_copy_is_what_runs(house):
    # Else the sections would be tried on the checkout, which knows nothing of what they add.
    words = [sys.executable, "-c", "import ciberrato, agent; print(ciberrato.__file__, agent.__file__)"]
    done = subprocess.run(
        words, cwd=house, env={"PYTHONPATH": str(house)}, capture_output=True, text=True, check=True
    )
    assert [Path(name).parents[1] for name in done.stdout.split()] == [house, house]
