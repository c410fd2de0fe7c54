"""A course to begin with: a repository that grades, publishes, and has a template for participants."""

from __future__ import annotations

import importlib.resources
from pathlib import Path

from ciberrato.errors import UsageError
from ciberrato.version import __version__

FILES = {
    "README.md": "README.md",
    "course.toml": "course.toml",
    "secret.example.toml": "secret.toml",
    "agents/follower/agent.py": "follower.py",
    "agents/classic/agent.py": "classic.py",
    ".gitignore": "gitignore",
    ".github/workflows/grade.yml": "grade.yml",
    "participant/README.md": "participant.md",
    "participant/robot/agent.py": "follower.py",
    "participant/test_agent.py": "test_agent.py",
    "participant/.gitignore": "gitignore",
    "participant/.github/workflows/test.yml": "test.yml",
}
"""Files of a course, by the assets that they are copies of."""

_REQUIREMENTS = """\
# The same version gives the same results. In place of it: a wheel that lies here, or an address
# as pip takes it (git+https://...).
ciberrato=={version}
"""
_PARTICIPANT = """\
[[agent]]
name = "me"
command = "python agent.py {host}:{port} {pos} {name}"
folder = "robot"
"""


def course_files() -> dict[str, str]:
    """Return the files of a course by their names.

    Returns
    -------
    dict of str to str
        A participant's labs, seeds and points are the course's.
    """
    source = importlib.resources.files("ciberrato.grading").joinpath("assets", "init")
    texts = {name: source.joinpath(own).read_text(encoding="utf-8") for name, own in FILES.items()}
    requirements = _REQUIREMENTS.format(version=__version__)
    course, _, _ = texts["course.toml"].partition("[[agent]]")
    return texts | {
        "requirements.txt": requirements,
        "participant/requirements.txt": f"{requirements}pytest\n",
        "participant/course.toml": course + _PARTICIPANT,
    }


def write_course(folder: Path) -> list[Path]:
    """Write a course that works: two labs, two agents, workflows, and a participant's template.

    Parameters
    ----------
    folder : Path
        Made if it is not there.

    Returns
    -------
    list of Path
        Files that were written.

    Raises
    ------
    UsageError
        If one of the files is there already (then nothing is written), or cannot be written.
    """
    texts = course_files()
    for name in texts:
        if (folder / name).exists():
            raise UsageError(f"{folder / name} already exists; name another folder")
    written = []
    for name, text in texts.items():
        path = folder / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8", newline="\n")
        except OSError as error:
            raise UsageError(f"{path}: cannot be written: {error.strerror}") from None
        written.append(path)
    return written
