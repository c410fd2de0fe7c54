"""The command line of ciberrato-lab."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ciberrato.command_line import ProgramParser, run_program
from ciberrato.errors import UsageError
from ciberrato.plaintext import plain

PROGRAM = "ciberrato-lab"


def main(arguments: Sequence[str] | None = None) -> int:
    """Generate, draw or check labs.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line without the program's name.

    Returns
    -------
    int
        Exit status: 0; 2 for what the user can put right: files that cannot be used, and with ``--strict``
        all warnings.
    """
    shows = False

    def body() -> int:
        nonlocal shows
        options = _parser().parse_args(arguments)
        shows = options.run in (_check, _schema)
        status: int = options.run(options)
        return status

    return run_program(PROGRAM, body, shows=lambda: shows)


def _check(options: argparse.Namespace) -> int:
    from ciberrato.checks.files import check_files

    checked = check_files([_found(name) for name in options.files])
    findings = [finding for one in checked for finding in one.findings]
    counts = {severity: sum(finding.severity == severity for finding in findings) for severity in _SEVERITIES}
    if options.json:
        files = [{"file": one.source, "kind": one.kind} for one in checked]
        listed = [
            {name: getattr(finding, name) for name in _FIELDS} | {"text": finding.text}
            for finding in findings
        ]
        print(
            json.dumps({"files": files, "counts": counts, "findings": listed}, ensure_ascii=False, indent=1)
        )
    else:
        for finding in findings:
            if finding.severity != "note" or not options.no_notes:
                place, _, text = str(finding).partition(f": {finding.text}")
                print(plain(f"{place}: {finding.severity}: {finding.text}{text}"))
        told = ", ".join(f"{number} {name}{'s' * (number != 1)}" for name, number in counts.items() if number)
        print(f"{len(checked)} file{'s' * (len(checked) != 1)}: {told or 'clean'}")
    if options.png is not None:
        from ciberrato.labtool.picture import draw_checked

        draw_checked(checked, options.png)
    return 2 if counts["error"] or (options.strict and counts["warning"]) else 0


_SEVERITIES = ("error", "warning", "note")
_FIELDS = ("source", "line", "severity", "kind", "found", "taken", "advice", "instead", "place")


def _found(name: str) -> Path:
    """Find a file by its path, or by the name of one that ships with its kind: ``maze_lab``."""
    from ciberrato.labs import find_grid, find_lab, find_parameters

    if os.path.exists(name):
        return Path(name)
    for ending, find in (("_grid", find_grid), ("_params", find_parameters), ("", find_lab)):
        if name.removesuffix(".xml").endswith(ending):
            return find(name)
    raise UsageError(f"{name}: no such file; check the path")


def _draw(options: argparse.Namespace) -> int:
    from ciberrato.files.lab import read_lab
    from ciberrato.files.start_grid import read_grid
    from ciberrato.labs import find_grid, find_lab
    from ciberrato.labtool.picture import draw_lab

    grid = None if options.grid is None else read_grid(find_grid(options.grid))
    draw_lab(read_lab(find_lab(options.lab)), options.output, grid)
    print(options.output)
    return 0


def _new(options: argparse.Namespace) -> int:
    from ciberrato.files.atomic import replace_file
    from ciberrato.labtool.making import MOST_RANDOM_CELLS, Order, empty_lab, random_lab

    output = options.output if options.output is not None else ("random" if options.random else "empty")
    if not Path(output).name:
        raise UsageError(f"-o {output!r}: names no file; give a name, with or without a folder before it")
    paths = [Path(f"{output}_{kind}.xml") for kind in ("lab", "grid")]
    for path in paths:
        if path.exists() and not options.force:
            raise UsageError(f"{path}: already exists; name another -o, or use --force")
    if options.png is not None:
        from agent.views.figures.canvas import figure_kind

        figure_kind(options.png)  # before anything is written
    columns, rows = options.size
    order = Order(
        name=options.name or Path(output).name,
        rows=rows,
        columns=columns,
        loops=options.loops,
        dead_ends=options.dead_ends,
        polygons=options.polygons,
        starts=options.starts,
        targets=options.targets,
        symmetric=options.symmetric,
    )
    if options.random and 400 < rows * columns <= MOST_RANDOM_CELLS:
        print(f"{PROGRAM}: {columns * rows} cells may take a minute", file=sys.stderr)
    made = random_lab(order, _seed(options)) if options.random else empty_lab(order)
    for path, text in zip(paths, (made.lab_xml, made.grid_xml), strict=True):
        replace_file(path, text.encode())
        print(path)
    if options.png is not None:
        from ciberrato.files.start_grid import parse_grid
        from ciberrato.labtool.picture import draw_lab

        draw_lab(made.lab, options.png, parse_grid(made.grid_xml.encode()))
        print(options.png)
    return 0


def _seed(options: argparse.Namespace) -> int:
    if options.seed is not None:
        return int(options.seed)
    import secrets

    seed = secrets.randbits(32)
    print(f"seed {seed}")
    return seed


def _schema(options: argparse.Namespace) -> int:
    from ciberrato.checks.schema import schema_file

    path = schema_file(options.kind)
    print(path if options.path else path.read_text(encoding="utf-8"), end="\n" if options.path else "")
    return 0


def _size(text: str) -> tuple[int, int]:
    columns, _, rows = text.lower().partition("x")
    if not (columns.isascii() and columns.isdigit() and rows.isascii() and rows.isdigit() and len(text) < 20):
        raise argparse.ArgumentTypeError(f"{text!r} is not COLUMNSxROWS, like 14x7")
    return int(columns), int(rows)


def _count(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 19):
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number, 0 or more")
    return int(text)


def _share(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number from 0 to 1")
    return value


class _CommandParser(ProgramParser):
    """A parser of one subcommand, as argparse makes it."""

    def __init__(self, *, prog: str, **options: Any) -> None:
        super().__init__(prog, options.pop("description", None) or "", **options)


def _parser() -> argparse.ArgumentParser:
    parser = ProgramParser(PROGRAM, "Generate, draw and check labs, start grids and parameter files.")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=_CommandParser)

    check = commands.add_parser(
        "check",
        help="report what the simulator would silently read as something else",
        description="Report what the simulator would silently read as something else than was meant.",
    )
    check.add_argument(
        "files",
        nargs="+",
        metavar="FILE",
        help="labs, start grids, parameter files; list a grid with its lab",
    )
    check.add_argument("--strict", action="store_true", help="exit with status 2 if there are warnings")
    check.add_argument("--no-notes", action="store_true", help="leave out the notes")
    check.add_argument("--json", action="store_true", help="print the findings as JSON")
    check.add_argument("--png", type=Path, metavar="FILE", help="draw the lab with the findings marked")
    check.set_defaults(run=_check)

    draw = commands.add_parser("draw", help="draw a lab", description="Draw a lab.")
    draw.add_argument("lab", metavar="LAB", help="file, or name of a lab that ships")
    draw.add_argument("--grid", metavar="GRID", help="draw the start positions of this start grid, too")
    draw.add_argument(
        "-o", "--output", type=Path, default=Path("lab.png"), metavar="FILE", help="picture; default: lab.png"
    )
    draw.set_defaults(run=_draw)

    new = commands.add_parser(
        "new",
        help="generate a lab and a start grid",
        description="Generate a lab and its start grid: empty, or with --random a maze or free polygons.",
    )
    new.add_argument(
        "--random",
        action="store_true",
        help="generate walls; default: an empty lab, ready for walls to be drawn in",
    )
    new.add_argument("--seed", type=_count, metavar="N", help="seed of all random numbers; default: random")
    new.add_argument(
        "--size", type=_size, default=(14, 7), metavar="COLUMNSxROWS", help="size in cells; default: 14x7"
    )
    new.add_argument(
        "--loops", type=_share, default=0.15, metavar="P", help="share of walls removed; default: 0.15"
    )
    new.add_argument(
        "--dead-ends", type=_share, default=1.0, metavar="P", help="share of dead ends kept; default: 1"
    )
    new.add_argument(
        "--polygons",
        type=_share,
        metavar="P",
        help="generate free polygons of this density instead of cell walls",
    )
    new.add_argument(
        "--starts", type=_count, default=1, metavar="N", help="number of start positions; default: 1"
    )
    new.add_argument(
        "--targets",
        type=_count,
        default=1,
        metavar="N",
        help="number of targets, each with a beacon; default: 1",
    )
    new.add_argument(
        "--symmetric", action="store_true", help="generate a lab that looks the same after half a turn"
    )
    new.add_argument("--name", help="name of the lab; default: that of the file")
    new.add_argument(
        "-o",
        "--output",
        metavar="NAME",
        help="write NAME_lab.xml and NAME_grid.xml; default: random, or empty without --random",
    )
    new.add_argument("--png", type=Path, metavar="FILE", help="draw the lab, too")
    new.add_argument("--force", action="store_true", help="overwrite existing files")
    new.set_defaults(run=_new)

    schema = commands.add_parser(
        "schema",
        help="print the RELAX NG schema of a kind of file, for editors",
        description="Print the RELAX NG schema of a kind of file, for editors that check as you type.",
    )
    schema.add_argument("kind", choices=("lab", "grid", "parameters"))
    schema.add_argument("--path", action="store_true", help="print the path of the schema instead")
    schema.set_defaults(run=_schema)
    return parser
