"""Recordings of the real simulator that the tests compare with.

A part of them comes with the tests. The full set, and the public labs that it names, are optional: the
variables CIBERRATO_GOLDEN and CIBERRATO_LABS name their folders. Without, what
needs them is skipped, and says so.
"""

import os
from pathlib import Path
from typing import Any

import pytest

OWN = Path(__file__).parent / "data" / "golden"
VARIABLES = ("CIBERRATO_GOLDEN", "CIBERRATO_LABS")


def needs(*variables: str) -> pytest.MarkDecorator:
    """Return the mark of a test that is skipped where one of these variables is not set."""
    return pytest.mark.recordings([name for name in variables if not os.environ.get(name)])


def by_name(found: dict[str, Path]) -> list[Any]:
    """Return recordings as parameters with ids, those that do not come along with their mark."""
    return [
        pytest.param(name, marks=() if path.is_relative_to(OWN) else needs("CIBERRATO_GOLDEN"))
        for name, path in sorted(found.items())
    ]


GOLDEN, LABS = (
    Path(name).resolve() if (name := os.environ.get(variable)) else None for variable in VARIABLES
)
FOLDERS = (OWN,) if GOLDEN is None else (OWN, GOLDEN)
