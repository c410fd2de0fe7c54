from __future__ import annotations

import pytest

from ciberrato.errors import LabError
from ciberrato.files.start_grid import default_grid, parse_grid, parse_grid_with_warnings, read_grid
from ciberrato.labs import find_grid, names
from ciberrato.world.start_grid import GridPosition


def test_built_in_grid():
    assert default_grid().positions == (GridPosition(x=9.0, y=3.0, direction_deg=0.0),)


def test_grids_that_ship_are_read():
    for name in names("grid"):
        assert read_grid(find_grid(name)).positions
    assert read_grid(find_grid("standard")).positions[0] == GridPosition(x=5.0, y=7.0, direction_deg=0.0)


def test_directions_are_kept_as_written():
    grid = parse_grid(b'<Grid>\\n"<Position X="1" Y="2" Dir="720"/><Position Dir="-90"/></Grid>')
    assert [position.direction_deg for position in grid.positions] == [720.0, -90.0]


def test_warnings_have_a_line():
    data = b'<Grid>\n<Place/>\n<Position X="a"/>\n</Grid>'
    _, warnings = parse_grid_with_warnings(data, "g.xml")
    assert warnings == (
        "g.xml:2: Place means nothing in a start grid and is passed over",
        'g.xml:3: Position X="a" is not a number and counts as 0',
    )


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"<Grid/>", "g.xml:1: the start grid has no Position"),
        (b"<Lab/>", "g.xml:1: the root element is Lab, not Grid"),
        (b'<Grid><Position X="nan"/></Grid>', 'g.xml:1: Position X="nan" is not finite'),
        (b"<Grid>", "g.xml:1: is not well-formed XML"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(data, message):
    with pytest.raises(LabError) as caught:
        parse_grid(data, "g.xml")
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_an_empty_grid_may_be_asked_for():
    assert parse_grid(b"<Grid></Grid>", allow_empty=True).positions == ()
