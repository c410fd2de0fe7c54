"""Findings of a check of a file: place, text, interpretation, and the probable intention."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from ciberrato.reprs import short_repr

SEVERITIES = ("error", "warning", "note")


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing in a file that its author should know of.

    Attributes
    ----------
    severity : str
        ``error``: the file cannot be used; ``warning``: something is not what it seems; ``note``: as written,
        but good to know.
    kind : str
        A word or two for programs: ``unknown attribute``, ``not a number``, ``start in wall``, ...
    source : str
        The file's name.
    line : int or None
        Counted from 1.
    found : str
        Text in the file.
    taken : str
        Interpretation, beginning with a verb: ``counts as 0``. Empty where that goes without saying.
    advice : str
        Remedy; empty where there is none.
    instead : str or None
        The nearest right name, or the value to write.
    place : (float, float) or None
        Place in the lab, in units.
    """

    __repr__ = short_repr

    severity: str
    kind: str
    source: str
    line: int | None
    found: str
    taken: str = ""
    advice: str = ""
    instead: str | None = None
    place: tuple[float, float] | None = None

    @property
    def text(self) -> str:
        """Message of the finding, without the place."""
        text = f"{self.found} and {self.taken}" if self.taken else self.found
        return f"{text}; {self.advice}" if self.advice else text

    def __str__(self) -> str:
        place = ":".join(str(part) for part in (self.source or None, self.line) if part is not None)
        return f"{place}: {self.text}" if place else self.text


def warnings_of(findings: Iterable[Finding]) -> tuple[str, ...]:
    """Return the lines of the findings that are not notes, in their order."""
    return tuple(str(finding) for finding in findings if finding.severity != "note")
