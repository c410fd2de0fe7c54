from __future__ import annotations

import re
from pathlib import Path

import pytest

from ciberrato import labs as maps
from ciberrato.errors import UsageError
from ciberrato.labs import find_grid, find_lab, find_parameters, names

FOLDER = Path(maps.__file__).parents[1] / "maps"  # data beside the packages; in a wheel inside ciberrato


def test_every_file_that_ships_is_found_by_name():
    found = {find_lab(name) for name in names("lab")}
    found |= {find_grid(name) for name in names("grid")}
    found |= {find_parameters(name) for name in names("params")}
    assert found == set(FOLDER.glob("*.xml"))


@pytest.mark.parametrize("name", ["corridors", "corridors_lab", "corridors_lab.xml"])
def test_a_name_with_or_without_its_ending(name):
    assert find_lab(name) == FOLDER / "corridors_lab.xml"


def test_the_same_name_for_lab_and_grid():
    assert find_grid("corridors") == FOLDER / "corridors_grid.xml"
    assert find_parameters("harsh") == FOLDER / "harsh_params.xml"


def test_a_file_wins_over_a_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert find_lab("maze") == FOLDER / "maze_lab.xml"
    Path("maze").write_text("<Lab/>")
    assert find_lab("maze") == Path("maze")


def test_a_directory_of_that_name_does_not(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("maze").mkdir()
    assert find_lab("maze") == FOLDER / "maze_lab.xml"


def test_a_path_to_any_file(tmp_path):
    path = tmp_path / "anything.xml"
    path.write_text("<Lab/>")
    assert find_lab(path) == path
    assert find_grid(str(path)) == path


@pytest.mark.parametrize(
    ("find", "listed"),
    [
        (find_lab, "corridors, diagonals, lines, maze, open, rooms, standard, twins, wide"),
        (find_grid, "corridors, diagonals, lines, maze, open, rooms, standard, twins, wide"),
        (find_parameters, "default, harsh, requests, seed"),
    ],
)
@pytest.mark.parametrize("name", ["mase", "", "no/such/file.xml", "a\0b", "x" * 5000, "../maps/standard"])
def test_an_unknown_name_lists_what_ships(find, listed, name):
    with pytest.raises(UsageError) as caught:
        find(name)
    assert re.search(f"{re.escape(listed)}(; did you mean .*)?$", str(caught.value))
    assert "\n" not in str(caught.value)


def test_a_directory_lists_what_ships(tmp_path):
    with pytest.raises(UsageError, match=r"is a directory.*corridors"):
        find_lab(tmp_path)
