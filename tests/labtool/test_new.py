"""Random labs: clean, of one piece, the same nowhere, and the same again for the same seed."""

from __future__ import annotations

import collections
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from ciberrato.checks.files import check_files
from ciberrato.checks.free_space import free_space
from ciberrato.checks.likeness import turns_alike
from ciberrato.errors import UsageError
from ciberrato.files.lab import parse_lab_with_warnings
from ciberrato.files.start_grid import parse_grid
from ciberrato.labtool.cli import main
from ciberrato.labtool.making import Order, empty_lab, random_lab
from ciberrato.labtool.maze import random_doors, row_patterns

ORDERS = st.builds(
    Order,
    rows=st.integers(3, 8),  # smaller ones without dead ends are rings, the same turned round
    columns=st.integers(5, 15),
    loops=st.floats(0, 0.4),
    dead_ends=st.floats(0.3, 1),
    polygons=st.none(),
    starts=st.integers(1, 3),
    targets=st.integers(0, 2),
)
POLYGONS = st.builds(
    Order,
    rows=st.integers(4, 8),
    columns=st.integers(5, 14),
    polygons=st.floats(0.3, 1),
    starts=st.integers(1, 3),
    targets=st.integers(0, 2),
)


@settings(
    max_examples=8,
    deadline=None,
    phases=[Phase.explicit, Phase.reuse, Phase.generate],
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(order=ORDERS | POLYGONS, seed=st.integers(0, 2**32))
def test_every_lab_is_clean_reachable_and_not_symmetric(tmp_path: Path, order: Order, seed: int) -> None:
    made = random_lab(order, seed)
    paths = [tmp_path / "r_lab.xml", tmp_path / "r_grid.xml"]
    for path, text in zip(paths, (made.lab_xml, made.grid_xml), strict=True):
        path.write_text(text)
    assert [str(finding) for one in check_files(paths) for finding in one.findings] == []
    lab, warnings = parse_lab_with_warnings(made.lab_xml.encode())
    assert (lab, warnings) == (made.lab, ())
    space = free_space(lab)
    assert space is not None
    assert space.part.max() == 0
    assert turns_alike(lab, space) == []
    assert len(parse_grid(made.grid_xml.encode()).positions) == order.starts
    assert random_lab(order, seed) == made


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 12), st.integers(1, 12), st.floats(0, 1), st.floats(0, 1), st.integers(0, 2**32))
def test_mazes_are_of_one_piece_and_as_dense_as_asked(
    rows: int, columns: int, loops: float, dead_ends: float, seed: int
) -> None:
    doors = random_doors(rows, columns, np.random.default_rng(seed), loops=loops, dead_ends=dead_ends)
    around = collections.defaultdict(list)
    for one, other in doors:
        around[one].append(other)
        around[other].append(one)
    seen, waiting = {(0, 0)}, [(0, 0)]
    while waiting:
        fresh = set(around[waiting.pop()]) - seen
        seen |= fresh
        waiting += sorted(fresh)
    assert len(seen) == rows * columns
    everywhere = rows * (columns - 1) + columns * (rows - 1)
    tree = rows * columns - 1
    opened = round(loops * (everywhere - tree))
    assert len(doors) >= tree + opened
    if dead_ends == 1.0:
        assert len(doors) == tree + opened
    if dead_ends == 0.0 and min(rows, columns) > 1:
        assert min(len(around[cell]) for cell in seen) >= 2


def test_patterns_draw_the_walls_between_cells_without_a_door() -> None:
    doors = random_doors(3, 4, np.random.default_rng(1), loops=0.2, dead_ends=1.0)
    rows = "".join(
        f'<Row Pos="{position}" Pattern="{pattern}"/>' for position, pattern in row_patterns(doors, 3, 4)
    )
    lab, warnings = parse_lab_with_warnings(f'<Lab Width="8" Height="6">{rows}</Lab>'.encode())
    assert warnings == ()

    def wall_between(one: tuple[int, int], other: tuple[int, int]) -> bool:
        x, y = (one[1] + other[1] + 1.0, one[0] + other[0] + 1.0)
        return any(
            min(cx for cx, _ in wall.corners) <= x <= max(cx for cx, _ in wall.corners)
            and min(cy for _, cy in wall.corners) <= y <= max(cy for _, cy in wall.corners)
            for wall in lab.walls
        )

    for row in range(3):
        for column in range(4):
            for other in ((row + 1, column), (row, column + 1)):
                if other[0] < 3 and other[1] < 4:
                    assert wall_between((row, column), other) == (((row, column), other) not in doors)


def test_symmetric_labs_if_asked() -> None:
    made = random_lab(Order(rows=5, columns=6, symmetric=True), 4)
    space = free_space(made.lab)
    assert space is not None
    assert any(share > 0.98 for _, share in turns_alike(made.lab, space))


def test_what_cannot_be_made_is_said() -> None:
    for order in (Order(rows=1, columns=1), Order(loops=1.0), Order(starts=99), Order(rows=0)):
        with pytest.raises(UsageError):
            random_lab(order, 1)


def test_labs_too_large_to_be_looked_at_are_made_all_the_same() -> None:
    made = random_lab(Order(rows=70, columns=70), 1)
    assert (made.lab.width, free_space(made.lab)) == (140.0, None)
    assert parse_lab_with_warnings(made.lab_xml.encode()) == (made.lab, ())


def test_an_empty_lab_is_ready_to_be_drawn_in() -> None:
    made = empty_lab(Order(rows=2, columns=3))
    lab, warnings = parse_lab_with_warnings(made.lab_xml.encode())
    assert (lab, warnings) == (made.lab, ())
    assert lab.walls == ()
    assert made.lab_xml.count("<Row ") == 3


def test_the_program_writes_two_files_and_none_over_another(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["new", "--random", "--size", "5x4", "--seed", "7", "-o", str(tmp_path / "a")]
    assert main([*words, "--png", str(tmp_path / "a.png")]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "a_grid.xml", "a_lab.xml"]
    before = (tmp_path / "a_lab.xml").read_bytes()
    assert main([*words[:-1], str(tmp_path / "b")]) == 0
    assert (tmp_path / "b_lab.xml").read_bytes() == before.replace(b'"a"', b'"b"')
    capsys.readouterr()
    assert main(words) == 2
    assert "already exists" in capsys.readouterr().err
    assert main([*words, "--force"]) == 0


def test_an_empty_lab_is_not_named_random(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new"]) == 0
    assert main(["new", "--random", "--seed", "1"]) == 0
    assert sorted(path.stem for path in tmp_path.iterdir()) == [
        "empty_grid",
        "empty_lab",
        "random_grid",
        "random_lab",
    ]


def test_nothing_is_written_where_something_cannot_be(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = str(tmp_path / "a")
    for picture in ("none/a.png", "a.odd"):
        assert main(["new", "-o", name, "--png", str(tmp_path / picture)]) == 2
    for nameless in ("", "/", "."):
        assert main(["new", "-o", nameless]) == 2
        assert "names no file" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_largest_empty_lab_has_no_wall() -> None:
    made = empty_lab(Order(name="Wide", rows=40, columns=60))
    assert made.lab_xml.count("<Row ") == 79
    assert "|" not in made.lab_xml
    assert "--" not in made.lab_xml
