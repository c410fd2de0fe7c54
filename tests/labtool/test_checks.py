"""Every mistake is told with its line, what it is taken for, and what was probably meant."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from ciberrato.checks.files import check_files, kind_of
from ciberrato.checks.free_space import free_space
from ciberrato.checks.likeness import turns_alike, twin_parts
from ciberrato.checks.schema import KINDS, schema_file, schema_findings
from ciberrato.checks.things import start_findings, thing_findings
from ciberrato.errors import LabError, nearest_name
from ciberrato.files.lab import LabFile, parse_lab_file, read_lab
from ciberrato.files.parameters import read_parameters_with_warnings
from ciberrato.files.start_grid import parse_grid, parse_grid_file, read_grid_with_warnings
from ciberrato.labs import find_grid, find_lab, find_parameters, names
from ciberrato.labtool.cli import main
from ciberrato.world.start_grid import GridPosition, StartGrid
from tests.recordings import LABS, needs

HEAD = '<Lab Name="Q" Width="8" Height="4">\n'


def lab(inside: str, head: str = HEAD) -> LabFile:
    return parse_lab_file(f"{head}{inside}\n</Lab>".encode(), "my.xml")


@pytest.mark.parametrize(
    ("head", "line", "text", "instead"),
    [
        (
            '<Lab width="8" Height="4">',
            1,
            "means nothing and is passed over, so that Width is 16",
            "Width",
        ),
        ('<Lab Width="8" Heigth="4">', 1, "so that Height is 16; did you mean Height?", "Height"),
        ('<Lab Width="8"\n Height="4"\n Colour="red">', 3, "Lab has these: Name, Width, Height", None),
    ],
)
def test_attributes_of_the_lab(head: str, line: int, text: str, instead: str | None) -> None:
    (finding,) = lab("", head).findings
    assert (finding.severity, finding.kind, finding.line) == ("warning", "unknown attribute", line)
    assert text in str(finding)
    assert finding.instead == instead


def test_one_unit_more_than_whole_cells_is_one_unit() -> None:
    (finding,) = lab("", '<Lab Width="27" Height="4">').findings
    assert str(finding) == "my.xml:1: Lab Width 27 is 13 cells and 1 unit"


@pytest.mark.parametrize(
    ("inside", "kind", "text", "instead"),
    [
        ('<Beacon x="3" Y="1"/>', "unknown attribute", "so that X is 0; did you mean X?", "X"),
        ('<Beacon X="1,5" Y="1"/>', "not a number", "counts as 0; write 1.5, with a point", "1.5"),
        ('<Target X="1" Y="1" Radius="1 unit"/>', "not a number", "counts as 0", None),
        ('<Row Pos="4.0" Pattern=""/>', "not a number", "counts as 0; write 4", "4"),
        ('<Row Pos="1" Pattern="==+"/>', "strange character", 'a "=" in column 0, 1 of row 1 and it', "-"),
        ('<Row Pos="0" Pattern="  ¦"/>', "strange character", "it draws nothing; write |", "|"),
        ('<Row Pos="9999999999.0" Pattern=""/>', "not a number", "counts as 0", None),
        ('<Rows Pos="0" Pattern=""/>', "unknown element", "is passed over; did you mean Row?", "Row"),
        ('<Row Pos="3" Pattern="--+  +  +  "/>', "row outside", "whose rows are 0 to 2", None),
        ('<Row Pos="-1" Pattern="  |"/>', "row outside", "whose rows are 0 to 2", None),
        (
            '<Row Pos="1" Pattern="  +  +  +  +--+  "/>',
            "pattern too long",
            "for a lab of 4 cells that takes 11 and draws 1 wall beyond the right border",
            None,
        ),
        (
            '<Row Pos="1" Pattern=" --+  +  +  "/>',
            "wrong column",
            "a - in column 1, 2 of row 1 and it draws nothing",
            None,
        ),
        (
            '<Row Pos="0" Pattern="   |"/>',
            "wrong column",
            "it stands at x = 2.66667, not between two cells",
            None,
        ),
        ('<Row Pos="1" Pattern="--+··+--+  +  "/>', "wrong column", 'a "·" in column 3 of row 1', None),
        ('<Row Pos="1" Pattern="  |"/>', "upright in an odd row", "stands from y = 1 to 3", None),
        ('<Row Pos="0" Pattern="--+  "/>', "dashes in an even row", "lines on the floor, not walls", None),
        ('<Row Pos="1" Pattern="--+--"/>', "lost wall", "that wall is lost", None),
    ],
)
def test_what_a_lab_says_otherwise_than_meant(inside: str, kind: str, text: str, instead: str | None) -> None:
    (finding,) = [one for one in lab(inside).findings if one.severity == "warning"]
    assert (finding.kind, finding.line, finding.instead) == (kind, 2, instead)
    assert text in str(finding)


def test_a_row_twice_names_the_first() -> None:
    file = lab('<Row Pos="0" Pattern="  |"/>\n\n<Row Pos="0" Pattern="     |"/>')
    (finding,) = file.findings
    assert str(finding) == "my.xml:4: row 0 is in line 2 already and draws its walls over the others"


def test_patterns_as_most_labs_have_them_are_fine() -> None:
    for pattern in ("  +  +  +  ", "--+--+--+--   ", "--+--+  +  ", "--+  +--+  ·", "--H--+  +  "):
        assert lab(f'<Row Pos="1" Pattern="{pattern}"/>').findings == ()
    assert lab('<Row Pos="0" Pattern="--+--+  " Height="0"/>').findings == ()


@pytest.mark.parametrize(
    ("inside", "kind", "text"),
    [
        ('<Beacon X="9" Y="1" Height="4"/>', "beacon outside", "beacon 0 at (9, 1) is outside the lab"),
        ('<Target X="4" Y="-1"/>', "target outside", "target 0 at (4, -1) is outside the lab"),
        ('<Target X="4" Y="1" Radius="0.4"/>', "target too small", "has a radius of 0.4"),
        (
            '<Target X="4" Y="2" Radius="1"/><Target X="4.5" Y="2" Radius="1"/>',
            "targets overlap",
            "target 1 at (4.5, 2) overlaps target 0 of line 2",
        ),
        (
            '<Wall Height="4"><Corner X="1" Y="1"/><Corner X="3" Y="1"/><Corner X="2" Y="3"/></Wall>'
            '<Beacon X="2" Y="2" Height="4"/>',
            "beacon in wall",
            "inside the wall of line 2, which is as high and no robot sees it",
        ),
        (
            '<Wall><Corner X="9" Y="1"/><Corner X="10" Y="1"/><Corner X="9" Y="2"/></Wall>',
            "wall outside",
            "a wall stands outside the lab",
        ),
        (
            '<Wall><Corner X="1" Y="1"/><Corner X="2" Y="1"/><Corner X="1" Y="2"/></Wall>\n'
            '<Wall><Corner X="2" Y="1"/><Corner X="1" Y="2"/><Corner X="1" Y="1"/></Wall>',
            "wall twice",
            "the wall of line 2 is there again",
        ),
    ],
)
def test_things_where_they_cannot_be(inside: str, kind: str, text: str) -> None:
    (finding,) = thing_findings(lab(inside))
    assert (finding.kind, finding.severity) == (kind, "warning")
    assert text in str(finding)
    assert finding.place is not None


def test_beacons_over_the_walls_and_targets_beside_each_other_are_fine() -> None:
    wall = '<Wall Height="2"><Corner X="1" Y="1"/><Corner X="3" Y="1"/><Corner X="2" Y="3"/></Wall>'
    targets = '<Target X="5" Y="2" Radius="1"/><Target X="6" Y="2" Radius="1"/>'
    assert thing_findings(lab(f'{wall}<Beacon X="2" Y="2" Height="3"/>{targets}')) == []


def test_starts_where_no_robot_can_be() -> None:
    wall = '<Wall><Corner X="6" Y="0"/><Corner X="8" Y="0"/><Corner X="8" Y="4"/></Wall>'
    file = lab(f'<Row Pos="0" Pattern="     |     "/>\n{wall}')
    places = ((1, 1), (9, 1), (3.7, 1), (7.5, 1), (1.5, 1.5), (2, 3))
    grid = StartGrid(positions=tuple(GridPosition(x=x, y=y) for x, y in places))
    found = start_findings(grid, file.lab, "g.xml", range(2, 8))
    assert [(one.kind, one.line) for one in found] == [
        ("start outside", 3),
        ("start in wall", 4),
        ("start in wall", 5),
        ("starts overlap", 6),
    ]
    assert "0.2 from a wall" in str(found[1])
    assert "is in a wall and the robot is stuck in it" in str(found[2])


def write(folder: Path, **files: str) -> list[Path]:
    paths = [folder / f"{name}.xml" for name in files]
    for path, text in zip(paths, files.values(), strict=True):
        path.write_text(text, encoding="utf-8")
    return paths


CLOSED = (
    '<Lab Name="Q" Width="12" Height="4">\n<Target X="1" Y="1" Radius="1"/>\n'
    '<Target X="11" Y="1" Radius="1"/>\n'
    '<Row Pos="0" Pattern="              |"/>\n<Row Pos="2" Pattern="              |"/>\n</Lab>'
)


def test_what_cannot_be_reached(tmp_path: Path) -> None:
    closed = CLOSED.replace("              |", "           |  ")
    paths = write(tmp_path, my_lab=closed, my_grid='<Grid>\n<Position X="3" Y="1"/>\n</Grid>')
    found = [finding for one in check_files(paths) for finding in one.findings]
    (warning,) = [one for one in found if one.severity == "warning"]
    assert (warning.kind, warning.line) == ("target out of reach", 3)
    assert "target 1 at (11, 1) cannot be reached from the start" in str(warning)
    assert any(one.kind == "closed room" for one in found)


def test_a_target_that_no_robot_fits_into(tmp_path: Path) -> None:
    wall = '<Wall><Corner X="4" Y="0"/><Corner X="8" Y="0"/><Corner X="8" Y="3"/><Corner X="4" Y="3"/></Wall>'
    paths = write(tmp_path, lab=f'{HEAD}<Target X="6" Y="1.5" Radius="1"/>{wall}</Lab>')
    (one,) = check_files(paths)
    assert [finding.kind for finding in one.findings if finding.severity == "warning"] == ["target in wall"]


def test_grids_go_with_the_lab_of_their_name(tmp_path: Path) -> None:
    grid = '<Grid><Position X="15" Y="1"/></Grid>'
    wide = '<Lab Width="20" Height="4"/>'
    paths = write(tmp_path, a_lab=f"{HEAD}</Lab>", b_lab=wide, a_grid=grid, b_grid=grid, c_grid=grid)
    kinds = {Path(one.source).stem: [f.kind for f in one.findings] for one in check_files(paths)}
    assert kinds["a_grid"] == ["start outside"]
    assert kinds["b_grid"] == []
    assert kinds["c_grid"] == ["no lab"]
    (_, other) = check_files([paths[0], paths[4]])
    assert [finding.kind for finding in other.findings] == ["start outside"]


@pytest.mark.slow
def test_files_that_ship_have_notes_only() -> None:
    folder = find_lab("maze").parent
    findings = [f for one in check_files(sorted(folder.glob("*.xml"))) for f in one.findings]
    assert [str(finding) for finding in findings if finding.severity != "note"] == []
    assert {finding.kind for finding in findings} == {
        "wrong column",
        "symmetry",
        "closed room",
        "turned rooms",
        "twins",
        "target out of reach",
    }


@needs("CIBERRATO_LABS")
@pytest.mark.slow
def test_public_labs_have_few_warnings_and_all_of_them_are_right() -> None:
    kinds = set()
    for folder in sorted({path.parent for path in LABS.rglob("*.xml")}):
        for one in check_files(sorted(folder.glob("*.xml"))):
            kinds |= {(Path(one.source).name, f.kind) for f in one.findings if f.severity != "note"}
    assert kinds == {("C1-lab.xml", "dashes in an even row")}


def test_symmetry_and_twins() -> None:
    open_lab = read_lab(find_lab("open"))
    space = free_space(open_lab)
    assert space is not None
    assert [(round(turn.angle, 3), share) for turn, share in turns_alike(open_lab, space)] == [(3.142, 1.0)]
    maze = read_lab(find_lab("maze"))
    space = free_space(maze)
    assert space is not None
    assert turns_alike(maze, space) == []
    assert list(twin_parts(space)) == []
    twins = free_space(read_lab(find_lab("twins")))
    assert twins is not None
    for one, other in list(twin_parts(twins))[:2]:
        here, there = twins.places(one), twins.places(other)
        rooms = [twins.clearance[twins.part == part].sum() for part in (one, other)]
        assert rooms[0] == pytest.approx(rooms[1])
        assert here - here[0] == pytest.approx(there - there[0])
        assert (here[0] != there[0]).any()


# --- schemas -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_schemas_take_what_ships(kind: str) -> None:
    schema = etree.RelaxNG(etree.parse(str(schema_file(kind))))
    find = {"lab": find_lab, "grid": find_grid, "parameters": find_parameters}[kind]
    files = [find(name) for name in names("params" if kind == "parameters" else kind)]
    assert [path for path in files if not schema.validate(etree.parse(str(path)))] == []


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("lab", '<Lab width="8"/>'),
        ("lab", '<Lab><Row Pos="1.5"/></Lab>'),
        ("lab", "<Lab><Wall><Corner/></Wall></Lab>"),
        ("lab", '<Lab Width="8,5"/>'),
        ("lab", "<Lab><Foo/></Lab>"),
        ("grid", "<Grid/>"),
        ("grid", '<Grid><Position x="1"/></Grid>'),
        ("parameters", '<Parameters MotorsNoise="1,5"/>'),
        ("parameters", '<Parameters GPS="on"/>'),
        ("parameters", '<Parameters Foo="1"/>'),
    ],
)
def test_schemas_refuse_mistakes_of_form(kind: str, text: str) -> None:
    schema = etree.RelaxNG(etree.parse(str(schema_file(kind))))
    assert not schema.validate(etree.fromstring(text))
    assert len(schema_findings(text.encode(), "f.xml", kind, ())) == 1


ATTRIBUTES = st.dictionaries(
    st.sampled_from(["Name", "Width", "Height", "width", "Heigth", "Foo"]),
    st.sampled_from(["8", " 8.5 ", "8,5", "-1e1", "x", ""]),
)
CHILDREN = st.lists(
    st.sampled_from(
        [
            '<Row Pos="0" Pattern="  |"/>',
            '<Row Pos="a"/>',
            '<Beacon X="1" Y="2"/>',
            '<Beacon z="1"/>',
            "<Foo/>",
            "<Lab/>",
        ]
    ),
    max_size=4,
)


@settings(max_examples=150, deadline=None)
@given(ATTRIBUTES, CHILDREN)
def test_schema_and_reader_agree_on_labs(attributes: dict[str, str], children: list[str]) -> None:
    attributes.pop("Name", None)
    shown = " ".join(f'{name}="{value}"' for name, value in attributes.items())
    text = f"<Lab {shown}>{''.join(children)}</Lab>".encode()
    try:
        known = parse_lab_file(text, "x", any_size=True).findings
    except LabError:
        return
    form = {"unknown attribute", "unknown element", "not a number"}
    valid = etree.RelaxNG(etree.parse(str(schema_file("lab")))).validate(etree.fromstring(text))
    assert valid == (not any(finding.kind in form for finding in known))


# --- the program ---------------------------------------------------------------------------------------


def test_the_program_tells_every_mistake_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = write(
        tmp_path,
        my_lab='<Lab Name="Q"\n width="8" Height="4">\n<Beacon X="1,5" Y="1" Height="4"/>\n</Lab>',
        my_grid='<Grid>\n<Position X="1" Y="9" Dir="0"/>\n</Grid>',
        params='<Parameters SimTime="100"\n MotorNoise="1"\n MotorsNoise="1,5"/>',
    )
    words = ["check", *map(str, paths)]
    assert main(words) == 0
    lines = capsys.readouterr().out.splitlines()
    shown = [line.removeprefix(f"{tmp_path}/") for line in lines if ": warning: " in line]
    assert shown == [
        'my_lab.xml:2: warning: Lab width="8" means nothing and is passed over, so that Width is 16; '
        "did you mean Width?",
        'my_lab.xml:3: warning: Beacon X="1,5" is not a number and counts as 0; write 1.5, with a point',
        "my_grid.xml:2: warning: start 1 at (1, 9) is outside the lab of 16 x 4 and the robot stands there",
        'params.xml:2: warning: Parameters MotorNoise="1" means nothing and is passed over, so that '
        "MotorsNoise stays 1.5; did you mean MotorsNoise?",
        'params.xml:3: warning: Parameters MotorsNoise="1,5" is not a number and counts as 0; '
        "write 1.5, with a point",
    ]
    assert lines[-1].startswith("3 files: 5 warnings")
    assert main([*words, "--strict"]) == 2
    capsys.readouterr()
    png = tmp_path / "found.png"
    assert main([*words, "--json", "--png", str(png)]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["counts"]["warning"] == 5
    assert {finding["instead"] for finding in told["findings"]} >= {"Width", "1.5", "MotorsNoise"}
    assert png.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "<Lab>\n<Row>\n</Lab>",
            "3: error: is not well-formed XML (mismatched tag: </Lab> where </Row> is due, as Row of line 2",
        ),
        ("<lab/>", "1: error: the root element is lab, not Lab, Grid or Parameters; did you mean Lab?"),
        ("<Grid/>", "1: error: the start grid has no Position"),
        ("", "1: error: is empty"),
    ],
)
def test_files_that_cannot_be_used(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, message: str
) -> None:
    (path,) = write(tmp_path, x=text)
    assert main(["check", str(path)]) == 2
    assert capsys.readouterr().out.startswith(f"{path}:{message}")


def test_command_lines_that_cannot_be_used(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (path,) = write(tmp_path, g="<Grid><Position/></Grid>")
    for words in (
        ["check", str(tmp_path / "none.xml")],
        ["check", str(path), "--png", str(tmp_path / "x.png")],
        ["draw", "no-such-lab"],
        ["schema", "labs"],
        ["new", "--size", "14"],
        ["new", "--size", "0x3", "-o", str(tmp_path / "n")],
        ["new", "--loops", "2"],
        [],
    ):
        assert main(words) == 2, words
        error = capsys.readouterr().err
        assert error.startswith("ciberrato-lab: ")
        assert error.count("\n") == 1


def test_schema_and_draw(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema", "lab"]) == 0
    etree.RelaxNG(etree.fromstring(capsys.readouterr().out.encode()))
    assert main(["schema", "grid", "--path"]) == 0
    assert Path(capsys.readouterr().out.strip()) == schema_file("grid")
    png = tmp_path / "rooms.png"
    assert main(["draw", "rooms", "--grid", "rooms", "-o", str(png)]) == 0
    assert png.read_bytes().startswith(b"\x89PNG")


def test_functions_that_the_manual_names(tmp_path: Path) -> None:
    grid, params = write(tmp_path, g='<Grid><Position X="1,0"/></Grid>', p='<Parameters GPS="on"/>')
    assert read_grid_with_warnings(grid)[0] == parse_grid(grid.read_bytes())
    assert "write 1.0" in read_grid_with_warnings(grid)[1][0]
    assert "write On or Off" in read_parameters_with_warnings(params)[1][0]


def test_kinds_of_files() -> None:
    assert kind_of(b"<Foo><Parameters/></Foo>", "x") == "parameters"
    assert [kind_of(f"<{name}/>".encode(), "x") for name in ("Lab", "Grid", "X")] == [
        "lab",
        "grid",
        "unknown",
    ]
    assert nearest_name("heigth", ("Height", "Width")) == "Height"
    assert nearest_name("zzz", ("Height", "Width")) is None
    assert parse_grid_file(b"<Grid><Position X='1' Y='1'/></Grid>").findings == ()
