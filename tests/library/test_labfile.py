from __future__ import annotations

import contextlib
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ciberrato.errors import LabError
from ciberrato.files.lab import (
    default_lab,
    parse_lab,
    parse_lab_with_warnings,
    read_lab,
    read_lab_with_warnings,
    total_turn,
)
from ciberrato.files.row_pattern import row_walls
from ciberrato.labs import find_lab, names
from ciberrato.world.lab import Beacon, Target
from tests.recordings import LABS, needs


def lab(inside: str, attributes: str = 'Name="Q" Width="28" Height="14"') -> bytes:
    return f"<Lab {attributes}>\n{inside}\n</Lab>\n".encode()


def test_built_in_lab_has_the_walls_of_the_standard_lab():
    built_in, standard = default_lab(), read_lab(find_lab("standard"))
    assert built_in.walls == standard.walls
    assert len(built_in.walls) == 54
    assert (built_in.rows, built_in.columns) == (7, 14)
    assert built_in.beacons == standard.beacons == (Beacon(x=25.0, y=7.0, height=4.0),)
    assert built_in.targets == standard.targets == (Target(x=25.0, y=7.0, radius=1.0),)


def test_labs_that_ship_are_read_without_warnings():
    for name in names("lab"):
        assert read_lab_with_warnings(find_lab(name))[1] == ()


@needs("CIBERRATO_LABS")
def test_public_labs_give_warnings_with_file_and_line():
    warnings = [
        warning
        for path in sorted(LABS.rglob("*ab*.xml"))
        if b"<Lab" in path.read_bytes()
        for warning in read_lab_with_warnings(path)[1]
    ]
    for warning in warnings:
        file, line, _ = warning.split(":", 2)
        assert file.endswith(".xml")
        assert int(line) > 0


def test_size_of_a_lab_of_any_shape():
    assert (parse_lab(lab("", 'Width="17.5" Height="17.5"')).rows, parse_lab(lab("")).columns) == (8, 14)
    wide = read_lab(find_lab("wide"))
    assert (wide.rows, wide.columns) == (14, 28)


@pytest.mark.parametrize(
    ("inside", "line", "what"),
    [
        ('<Row Pos="1" Pattern="--+--"/>', 2, "ends before its last wall does and that wall is lost"),
        ('<Wall><Corner X="1" Y="1"/></Wall>', 2, "a wall has 1 corner and is dropped"),
        (
            '\n<Wall><Corner/><Corner X="3" Y="3"/><Corner X="3"/><Corner Y="3"/></Wall>',
            3,
            "the sides of a wall cross",
        ),
        ('<Row Pos="4" Height="abc" Pattern="  |"/>', 2, 'Row Height="abc" is not a number and counts as 0'),
        ('<Row Pos="4.5" Pattern="  |"/>', 2, 'Row Pos="4.5" is not an integer'),
        ('<Beacon X="1,5"/>', 2, 'Beacon X="1,5" is not a number'),
        ("<row/>", 2, "row means nothing"),
        ("<Corner/>", 2, "Corner outside a Wall means nothing"),
    ],
)
def test_what_is_passed_over_is_reported_with_its_line(inside, line, what):
    _, warnings = parse_lab_with_warnings(lab(inside), "my.xml")
    assert len(warnings) == 1
    assert warnings[0].startswith(f"my.xml:{line}: ")
    assert what in warnings[0]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"<Lab>", "my.xml:1: is not well-formed XML (the end is missing: Lab of line 1 is left open)"),
        (b"<Lab Width='4' Width='5'/>", "my.xml:1: is not well-formed XML (duplicate attribute: "),
        (b"<Lab>\n\n<Row </Lab>", "my.xml:3: is not well-formed XML"),
        (
            b"<Lab>\n<Wall>\n<Corner>\n</Wall></Lab>",
            "my.xml:4: is not well-formed XML (mismatched tag: </Wall> where </Corner> is due, "
            "as Corner of line 3 is left open)",
        ),
        (
            b"<Lab>\n<Wall>\n</Lab>",
            "my.xml:3: is not well-formed XML (mismatched tag: </Lab> where </Wall> is due, ",
        ),
        (b"<Lab>" + b"<a>" * 40_000 + b"</a>" * 40_000 + b"</Lab>", "my.xml:1: is nested too deeply"),
        (b'<!DOCTYPE Lab [<!ENTITY % p SYSTEM "p.dtd"> %p;]><Lab/>', "my.xml:1: declares XML entities"),
        (b"<Lab Width=4/>", "my.xml:1: is not well-formed XML (a value without quotes around it)"),
        (b"<Lab Name='\xe9'/>", "my.xml:1: is not well-formed XML (bytes that are not UTF-8"),
        (b"<Maze/>", "my.xml:1: the root element is Maze, not Lab"),
        (b"<Lab/> x", "my.xml:1: is not well-formed XML (something follows the end of the document)"),
        (b"", "my.xml:1: is empty"),
        (b" \n\t", "my.xml:1: is empty"),
        (b"\x89PNG\r\n\x1a\n\0\0", "my.xml:1: is not well-formed XML"),
        (b"\x7fELF\x02\x01\x01" + bytes(range(256)), "my.xml:1: is not well-formed XML"),
        (b'<?xml version="1.0" encoding="klingon"?><Lab/>', "my.xml:1: "),
        (b'<!DOCTYPE Lab [\n<!ENTITY a "b">]><Lab Name="&a;"/>', "my.xml:2: declares XML entities"),
        (lab("", 'Width="0" Height="14"'), 'my.xml:1: Lab Width="0" gives a side of 0 units'),
        (
            lab("", 'Width="28,5" Height="14"'),
            'my.xml:1: Lab Width="28,5" is not a number and gives a side of 0 units; it must be from 2',
        ),
        (
            lab("", 'Width="wide" Height="14"'),
            'my.xml:1: Lab Width="wide" is not a number and gives a side of 0',
        ),
        (
            b"Width = 14",
            "my.xml:1: is not well-formed XML (it does not begin with an element)",
        ),
        (
            b'<Lab Name="a>\n<Row/>',
            "my.xml:2: is not well-formed XML (a < within a value: the quote that ends it is missing)",
        ),
        (b"<Lab>\n<!-- a -- b --></Lab>", "my.xml:2: is not well-formed XML (-- within a comment)"),
        (lab("", 'Width="1e9" Height="14"'), 'my.xml:1: Lab Width="1e9" gives a side of 1e+09 units'),
        (lab("", 'Width="28" Height="-14"'), 'my.xml:1: Lab Height="-14"'),
        (lab("", 'Width="nan" Height="14"'), 'my.xml:1: Lab Width="nan" is not finite'),
        (lab('<Wall><Corner X="1e999"/></Wall>'), 'my.xml:2: Corner X="1e999" is not finite'),
        (lab('<Target Radius="inf"/>'), 'my.xml:2: Target Radius="inf" is not finite'),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(data, message):
    with pytest.raises(LabError) as caught:
        parse_lab(data, "my.xml")
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_entities_do_not_grow():
    levels = "".join(f'<!ENTITY a{n} "{f"&a{n - 1};" * 10}">' for n in range(1, 12))
    bomb = f'<!DOCTYPE Lab [<!ENTITY a0 "ha">{levels}]><Lab Name="&a11;"/>'
    with pytest.raises(LabError, match="entities"):
        parse_lab(bomb.encode())


def test_nested_elements_are_read_up_to_a_bound():
    assert len(parse_lab(b"<Lab>" + b"<a>" * 250 + b"</a>" * 250 + b"</Lab>").walls) == 0


def test_no_file_is_read_but_the_one_that_is_named(tmp_path):
    (tmp_path / "other.dtd").write_text('<!ATTLIST Lab Width CDATA "8">')
    text = f'<!DOCTYPE Lab SYSTEM "{tmp_path}/other.dtd"><Lab/>'
    with pytest.raises(LabError, match="names another document"):
        parse_lab(text.encode())


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "iso-8859-1", "cp1252", "latin-1"])
def test_declared_encodings(encoding):
    text = f'<?xml version="1.0" encoding="{encoding}"?>\n<Lab Name="Águeda"\n Width="8"/>'
    read = parse_lab(text.encode(encoding))
    assert (read.name, read.width) == ("Águeda", 8.0)


def test_prefixes_without_a_name_space_are_passed_over():
    read, warnings = parse_lab_with_warnings(b"<Lab><x:Row/><Row Pos='0' Pattern='  |'/></Lab>")
    assert len(read.walls) == 1
    assert "x:Row means nothing" in warnings[0]
    assert parse_lab(b'<Lab xmlns="http://example.org" Width="8"/>').width == 8.0


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=300))
def test_any_bytes_are_read_or_refused(data):
    with contextlib.suppress(LabError):
        assert parse_lab(b"<Lab>" + data + b"</Lab>").width == 16.0


@settings(max_examples=200, deadline=None)
@given(st.text(max_size=60), st.integers(-3, 30), st.floats(-5, 5))
def test_row_walls_stand_in_their_row_and_keep_their_order(pattern, position, height):
    walls, _ = row_walls(pattern, position, height)
    for wall in walls:
        assert abs(total_turn(wall.corners)) == pytest.approx(2 * math.pi)
        ys = [y for _, y in wall.corners]
        assert position - 0.11 <= min(ys)
        assert max(ys) <= position + 2.11
        assert wall.height in (height, 0.0)


def test_total_turn_of_a_regular_polygon():
    corners = [(math.cos(2 * math.pi * k / 7), math.sin(2 * math.pi * k / 7)) for k in range(7)]
    assert total_turn(corners) == pytest.approx(2 * math.pi)
    assert total_turn(corners[::-1]) == pytest.approx(-2 * math.pi)
    assert total_turn(corners[::2] + corners[1::2]) == pytest.approx(4 * math.pi)


def test_a_side_that_is_no_number_says_how_to_write_it() -> None:
    with pytest.raises(LabError, match=r"\(one cell\) to 2000; write 28\.5, with a point$"):
        parse_lab(lab("", 'Width="28,5" Height="14"'), "my.xml")
