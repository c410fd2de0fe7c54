"""Recordings of the real simulator that the tests compare with.

A part of them comes with the tests. The full set, and the public labs that it names, are optional: the
variables CIBERRATO_GOLDEN and CIBERRATO_LABS name their folders. Without, what
needs them is skipped, and says so.
"""

import os
from pathlib import Path

import pytest

OWN = Path(__file__).parent / "data" / "golden"
VARIABLES = ("CIBERRATO_GOLDEN", "CIBERRATO_LABS")


def needs(*folders: Path | None) -> pytest.MarkDecorator:
    """Return the mark that skips a test where one of these folders is not there."""
    absent = [name for name, folder in zip(VARIABLES, folders, strict=False) if folder is None]
    return pytest.mark.skipif(bool(absent), reason=f"set {' and '.join(absent)} to run this")


GOLDEN, LABS = (
    Path(name).resolve() if (name := os.environ.get(variable)) else None for variable in VARIABLES
)
FOLDERS = (OWN,) if GOLDEN is None else (OWN, GOLDEN)
