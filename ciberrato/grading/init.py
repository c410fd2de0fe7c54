"""A course to begin with."""

from __future__ import annotations

import importlib.resources
from pathlib import Path

from ciberrato.errors import UsageError

FILES = {
    "course.toml": "course.toml",
    "agents/follower/agent.py": "follower.py",
    "agents/classic/agent.py": "classic.py",
}


def write_course(folder: Path) -> list[Path]:
    """Write a course that works: two labs, two agents.

    Parameters
    ----------
    folder : Path
        Made if it is not there.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    UsageError
        If one of the files is there already (then nothing is written), or cannot be written.
    """
    source = importlib.resources.files("ciberrato.grading").joinpath("assets", "init")
    for name in FILES:
        if (folder / name).exists():
            raise UsageError(f"{folder / name} is there already; name another folder")
    written = []
    for name, own in FILES.items():
        path = folder / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(source.joinpath(own).read_bytes())
        except OSError as error:
            raise UsageError(f"{path}: cannot be written: {error.strerror}") from None
        written.append(path)
    return written
