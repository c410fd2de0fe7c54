"""The score scripts' arithmetic, worked out by hand."""

from __future__ import annotations

import pytest

from ciberrato.files.map_scores import MAP_COLUMNS, MAP_LINES, map_faults, mapping_score, planning_score


def text_map(*marks):
    """A map with characters at offsets from the middle."""
    lines = [[" "] * MAP_COLUMNS for _ in range(MAP_LINES)]
    for dx, dy, character in marks:
        lines[MAP_LINES // 2 - dy][MAP_COLUMNS // 2 + dx] = character
    return "".join("".join(line) + "\n" for line in lines)


CORRIDOR = [(0, 0, "I"), (1, 0, "X"), (2, 0, "X"), (3, 0, "|"), (0, 1, "-"), (2, 1, "-")]
REFERENCE = text_map(*CORRIDOR)


def test_the_reference_itself_gets_ten_points_a_character():
    assert mapping_score(REFERENCE, REFERENCE) == 60.0


def test_a_wrong_character_costs_five():
    drawn = text_map(*CORRIDOR[:3], (3, 0, "X"), (0, 1, "-"), (5, 5, "X"))
    assert mapping_score(REFERENCE, drawn) == 4 * 10 - 2 * 5


def test_blanks_are_free():
    assert mapping_score(REFERENCE, text_map((0, 0, "I"))) == 10.0
    assert mapping_score(REFERENCE, "") == 0.0


@pytest.mark.parametrize(("dx", "dy", "factor"), [(1, 0, 0.85), (0, -2, 0.85**2), (-2, 2, 0.85**4)])
def test_a_shifted_map_is_recognized_at_a_price(dx, dy, factor):
    drawn = text_map(*((x + dx, y + dy, character) for x, y, character in CORRIDOR))
    assert mapping_score(REFERENCE, drawn) == pytest.approx(60 * factor)


def test_a_map_shifted_by_three_is_not():
    drawn = text_map(*((x, y + 3, character) for x, y, character in CORRIDOR))
    assert mapping_score(REFERENCE, drawn) < 0


def test_planning_out_serves_as_a_reference():
    assert mapping_score(REFERENCE + " 0 1 0\n8.000000\n", REFERENCE) == 60.0


def test_faults_of_the_layout_are_named():
    assert map_faults(REFERENCE) == []
    assert map_faults("X" * 54 + "\n") == [
        "line 1 has 54 characters, not 55",
        "there are 1 lines, not 27",
    ]


# A corridor of three cells to the right of the start, with targets at both ends and in the middle.
CELLS = [(0, 0, "0"), (1, 0, "X"), (2, 0, "1"), (3, 0, "X"), (4, 0, "2"), (5, 0, "X"), (6, 0, "X")]
PLANNING = text_map(*CELLS) + " 0 1 2 0\n8.000000\n"


def tour(*places):
    return "".join(f"{x} {y}\n" for x, y in places)


def test_the_best_tour_gets_one():
    assert planning_score(PLANNING, tour((0, 0), (2, 0), (4, 0), (2, 0), (0, 0))) == 1.0


def test_a_detour_costs_its_share():
    there_and_on = tour((0, 0), (2, 0), (4, 0), (6, 0), (4, 0), (2, 0), (0, 0))
    assert planning_score(PLANNING, there_and_on) == pytest.approx(8 / 12)


def test_a_target_left_out_costs_and_caps():
    # Length 4 of 8 would be 2; a third of the targets is missing.
    assert planning_score(PLANNING, tour((0, 0), (2, 0), (0, 0))) == pytest.approx(2 / 3)
    # Twice as long as the best way, and a third missing: 8/16 - 1/3.
    idle = tour(*[(0, 0), (2, 0)] * 4, (0, 0))
    assert planning_score(PLANNING, idle) == pytest.approx(8 / 16 - 1 / 3)


@pytest.mark.parametrize(
    "bad",
    [
        tour((2, 0), (0, 0)),
        tour((0, 0), (2, 0)),
        tour((0, 0), (0, 2), (0, 0)),
        tour((0, 0)),
        tour((0, 0), (400, 0), (0, 0)),
        "",
        "0 0\nnan 0\n0 0\n",
        "0 0\nthere\n0 0\n",
    ],
)
def test_a_tour_that_breaks_the_rules_gets_nothing(bad):
    assert planning_score(PLANNING, bad) == 0.0
