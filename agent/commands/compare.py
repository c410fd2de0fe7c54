"""The subcommand ``compare``: how two belief files differ."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from agent.commands.files import check_size, read_lab_file
from agent.commands.parser import OptionParser
from agent.run.reporter import PROGRAM

if TYPE_CHECKING:
    from agent.run.signals import Interrupts


def make_parser() -> OptionParser:
    """Return the parser of the subcommand."""
    parser = OptionParser(f"{PROGRAM} compare", "Show where and by how much two belief files differ.")
    parser.add_argument("first", type=Path, metavar="FILE", help="belief file")
    parser.add_argument("second", type=Path, metavar="FILE", help="belief file to compare with")
    parser.add_argument("--png", type=Path, metavar="FILE", help="draw the differences into a picture")
    parser.add_argument("-m", "--map", metavar="LAB", help="draw the walls of this lab, too")
    return parser


def run(options: argparse.Namespace, interrupts: Interrupts) -> int:
    """Print the differences, and draw them with ``--png``; return the exit status."""
    from agent.offline.comparison import compare_beliefs, comparison_table
    from ciberrato.files.beliefs import read_beliefs

    first, second = (read_beliefs(path)[-1].beliefs for path in (options.first, options.second))
    comparison = compare_beliefs(first, second)
    print(comparison_table(comparison))
    if options.png is not None:
        from agent.views.figures.differences import difference_panels

        lab = None if options.map is None else read_lab_file(options.map)[0]
        if lab is not None:
            check_size(first.shape, lab)
        names = (options.first.name, options.second.name)
        if names[0] == names[1]:
            names = (str(options.first), str(options.second))
        difference_panels(comparison, options.png, lab=lab, names=names)
        print(f"figure: {options.png}")
    return 0
