"""A checkout stands alone: it looks for nothing outside itself unless told."""

import ast
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# A path that climbs out of the folder where it begins.
CLIMBING = re.compile(r"\.\./|[\"']\.\.[\"']|\bos\.pardir\b|\b(ROOT|REPOSITORY)\.parent\b")
# Requests that a server must refuse, a name that is no lab, and the folder of an agent in a repository.
ATTACKS = {
    "tests/viewer/test_server.py",
    "tests/viewer/test_site.py",
    "tests/maps/test_maps.py",
    "tests/grading/test_repositories.py",
    "ciberrato/grading/agents.py",
}


def files():
    """Return what belongs to the repository; in a copy without its history, what is not hidden."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode == 0:
        names = listed.stdout.splitlines()
    else:
        paths = (path.relative_to(ROOT) for path in ROOT.rglob("*") if path.is_file())
        names = [str(path) for path in paths if not any(part.startswith(".") for part in path.parts[:-1])]
    return sorted(name for name in names if (ROOT / name).is_file())


def climbs(name, tree):
    """Yield the lines that take more parents of ``__file__`` than there are folders above it here."""
    depth = name.count("/") + 1
    for node in ast.walk(tree):
        up, place = 0, node
        while isinstance(place, ast.Attribute | ast.Subscript | ast.Call):
            match place:
                case ast.Attribute(attr="parent"):
                    up += 1
                case ast.Subscript(value=ast.Attribute(attr="parents"), slice=ast.Constant(value=index)):
                    up += index + 1
            if isinstance(place, ast.Call):
                if ast.unparse(place) == "Path(__file__)":
                    break
                place = place.func
            else:
                place = place.value
        else:
            continue
        if up > depth:
            yield node.lineno


def wrong_lines(name, text):
    if name not in ATTACKS:
        for number, line in enumerate(text.splitlines(), 1):
            if CLIMBING.search(line):
                yield number
    if name.endswith(".py") and "__file__" in text:
        yield from climbs(name, ast.parse(text))


def test_no_program_test_or_rule_climbs_out_of_the_checkout():
    wrong = {}
    for name in files():
        if name != "tests/structure/test_alone.py" and name.endswith((".py", ".toml", "Makefile")):
            found = sorted(set(wrong_lines(name, (ROOT / name).read_text())))
            if found:
                wrong[name] = found
    assert not wrong
    assert len(files()) > 400


def test_links_of_the_manual_stay_inside():
    wrong = [
        f"{name}: {target}"
        for name in files()
        if name.endswith(".md")
        for target in re.findall(r"\]\(([^)#:]+)[^):]*\)", (ROOT / name).read_text())
        if not (ROOT / name).parent.joinpath(target).resolve().is_relative_to(ROOT)
    ]
    assert not wrong


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("tests/x/test_x.py", 'LABS = ROOT / "../shared/labs"'),
        ("tests/x/test_x.py", "GOLDEN = Path(__file__).parents[3]"),
        ("tests/x/test_x.py", "GOLDEN = Path(__file__).resolve().parents[2].parent / 'a'"),
        ("tests/x/test_x.py", "GOLDEN = ROOT.parent / 'a'"),
        ("agent/x.py", "add('--labs', default=Path('..'))"),
        ("Makefile", "LABS ?= ../labs"),
    ],
)
def test_what_climbs_out_is_found(name, line):
    assert list(wrong_lines(name, line)) != []


def test_the_root_and_what_is_in_it_may_be_named():
    text = "ROOT = Path(__file__).parents[2]\nX = Path(__file__).parent.parent.parent / 'tests'"
    assert list(wrong_lines("tests/x/test_x.py", text)) == []
