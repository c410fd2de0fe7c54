"""Errors that say whose fault they are.

Each message is one line that says what is wrong, where, and what to do about it.
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from typing import Any


class CiberratoError(Exception):
    """Base of every error that this project raises for what its users and peers do."""


class ProtocolError(CiberratoError):
    """The peer's bytes are not a message of the protocol."""


class LabError(CiberratoError):
    """A lab, grid, parameter, log or belief file has the wrong contents.

    Parameters
    ----------
    problem : str
        Fault and remedy, without the place.
    source : str
        The file's name, as the user gave it.
    line : int or None
        The line in the file, counted from 1.
    findings : sequence of `ciberrato.files.findings.Finding`
        All that was found in the file, this and other errors among them; empty where the reading ended here.
    """

    def __init__(
        self, problem: str, *, source: str = "", line: int | None = None, findings: Sequence[Any] = ()
    ) -> None:
        place = ":".join(str(part) for part in (source or None, line) if part is not None)
        super().__init__(f"{place}: {problem}" if place else problem)
        self.problem = problem
        self.source = source
        self.line = line
        self.findings = tuple(findings)


class UsageError(CiberratoError):
    """The command line, or another argument, cannot be used as given."""


def nearest_name(name: str, names: Iterable[str]) -> str | None:
    """Find the right name that a wrong one was probably meant to be.

    Parameters
    ----------
    name : str
    names : iterable of str
        The right ones.

    Returns
    -------
    str or None
        None if no right name is like it. Small and capital letters do not matter.
    """
    import difflib  # needed after mistakes only

    right = {candidate.lower(): candidate for candidate in names}
    close = difflib.get_close_matches(name.lower(), right, n=1, cutoff=0.6)
    return right[close[0]] if close else None


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return ``"; did you mean 'maze'?"`` for the end of a message, or nothing where no known name is near.

    Parameters
    ----------
    name : str
        Name that was not found.
    known : iterable of str
        Names that exist.

    Returns
    -------
    str
    """
    meant = nearest_name(name, known)
    return "" if meant is None else f"; did you mean {meant!r}?"
