"""XML documents on disk: files to bytes, and attributes to numbers.

Lab, grid and parameter files are read by one set of rules, those of the real simulator: an attribute that
does not hold a number counts as 0, whatever stands where nothing is expected is ignored, and only
what is not XML at all is refused. What is ignored is reported as a finding with its line.
"""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ciberrato.errors import LabError, UsageError
from ciberrato.files.findings import Finding
from ciberrato.files.xml_document import Element
from ciberrato.reprs import short_repr
from ciberrato.system.opening import open_patiently

MAX_FILE_SIZE = 16 * 2**20
"""Bytes; a larger file is refused before it is parsed."""

_PIECE = 1 << 16

MAX_FINDINGS = 1000
"""A file with more mistakes is not what it is taken for: it is refused."""

_REAL = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[+-]?(?:inf|nan)", re.IGNORECASE)
_INTEGER = re.compile(r"[+-]?[0-9]+")
_SWITCH_WORDS = dict.fromkeys(("on", "yes", "true", "1"), "On") | dict.fromkeys(
    ("off", "no", "false", "0"), "Off"
)


@dataclass(slots=True)
class Reader:
    """Turns attributes into numbers as the real simulator does, and remembers what it had to guess.

    Attributes
    ----------
    source : str
        The file's name, for messages.
    findings : list of Finding
        In the order in which they were met.
    """

    __repr__ = short_repr

    source: str
    findings: list[Finding] = field(default_factory=list)

    def warn(self, element: Element, kind: str, found: str, taken: str = "", **more: Any) -> None:
        """Add a warning about an element; see `Finding`.

        Parameters
        ----------
        element : Element
        kind, found, taken : str
        attribute : str, optional
            The one that it is about: its line counts.
        severity, advice, instead, place : optional
            As of `Finding`.
        """
        line = element.line_of(more.pop("attribute", ""))
        if len(self.findings) >= MAX_FINDINGS:
            problem = f"has more than {MAX_FINDINGS} mistakes up to here; give the right file"
            raise LabError(problem, source=self.source, line=line)
        self.findings.append(
            Finding(
                **{"severity": "warning", **more},
                kind=kind,
                source=self.source,
                line=line,
                found=found,
                taken=taken,
            )
        )

    def note(self, element: Element, kind: str, found: str, taken: str = "", **more: Any) -> None:
        """Add a note about an element; see `warn`."""
        self.warn(element, kind, found, taken, severity="note", **more)

    def error(self, element: Element, problem: str) -> LabError:
        """Return the error for an element; the caller raises it."""
        return LabError(problem, source=self.source, line=element.line)

    def refuse(self, element: Element, attribute: str, problem: str) -> None:
        """Note that an attribute makes the file unusable; `finish` raises it, after all others are found."""
        self.warn(element, "unusable", problem, attribute=attribute, severity="error")

    def finish(self) -> None:
        """End the reading.

        Raises
        ------
        LabError
            If something was refused: the first such thing; all findings are with it.
        """
        found = sorted(self.findings, key=lambda finding: finding.line or 0)
        for finding in found:
            if finding.severity == "error":
                raise LabError(finding.found, source=self.source, line=finding.line, findings=found)

    def real(self, element: Element, attribute: str, default: float) -> float:
        """Read an attribute that should hold a real number; 0 where it does not.

        A number that is infinite or not a number, or too large for a double, is refused.
        """
        text = element.attributes.get(attribute)
        if text is None:
            return default
        stripped = text.strip()
        if _REAL.fullmatch(stripped):
            value = float(stripped)
            if math.isfinite(value):
                return value
        elif not _NOT_FINITE.fullmatch(stripped):
            self._not_a_number(element, attribute, stripped, "a number", _meant(stripped))
            return 0.0
        problem = f'{element.name} {attribute}="{_short(text)}" is not finite: write a finite number'
        self.refuse(element, attribute, problem)
        return 0.0

    def integer(self, element: Element, attribute: str, default: int) -> int:
        """Return an attribute that should hold an integer of 32 bits; 0 where it does not."""
        return self._integer(element, attribute, default, -(2**31), 2**31 - 1)

    def natural(self, element: Element, attribute: str, default: int) -> int:
        """Return an attribute that should hold an unsigned integer of 32 bits; 0 where it does not."""
        return self._integer(element, attribute, default, 0, 2**32 - 1)

    def _integer(self, element: Element, attribute: str, default: int, least: int, greatest: int) -> int:
        text = element.attributes.get(attribute)
        if text is None:
            return default
        stripped = text.strip()
        # Python refuses to convert thousands of digits; no number of 32 bits has more than ten.
        if _INTEGER.fullmatch(stripped) and len(stripped) < 100:
            value = int(stripped)
            if least <= value <= greatest:
                return value
        meant = float(_meant(stripped) or "nan")
        instead = f"{meant:.0f}" if meant.is_integer() and least <= meant <= greatest else None
        what = f"an integer from {least} to {greatest}"
        self._not_a_number(element, attribute, stripped, what, instead)
        return 0

    def _not_a_number(
        self, element: Element, attribute: str, text: str, what: str, meant: str | None
    ) -> None:
        shown = element.attributes[attribute]
        self.warn(
            element,
            "not a number",
            f'{element.name} {attribute}="{_short(shown)}" is not {what}',
            "counts as 0",
            attribute=attribute,
            advice=f"write {meant}{', with a point' if ',' in text else ''}" if meant else "",
            instead=meant,
        )

    def switch(self, element: Element, attribute: str, default: bool) -> bool:
        """Return whether an attribute is on: whether it is exactly ``On``."""
        text = element.attributes.get(attribute)
        if text is None:
            return default
        if text not in ("On", "Off"):
            self.warn(
                element,
                "not a switch",
                f'{element.name} {attribute}="{_short(text)}" is not "On"',
                'counts as "Off"',
                attribute=attribute,
                advice="write On or Off",
                instead=_SWITCH_WORDS.get(text.strip().lower()),
            )
        return text == "On"


def _short(text: str) -> str:
    return text if len(text) <= 40 else text[:40] + "…"


def _meant(text: str) -> str | None:
    """Return the number that a text which is none was probably meant to be."""
    candidate = text.replace(",", ".").removesuffix("%").strip()
    return candidate if _REAL.fullmatch(candidate) else None


def read_file(path: str | Path) -> bytes:
    """Read a whole file.

    Raises
    ------
    UsageError
        If there is no such file, or it cannot be read.
    LabError
        If it is larger than `MAX_FILE_SIZE`.
    """
    if not isinstance(path, str | os.PathLike):
        raise TypeError(f"path: {path!r:.60} is not the path of a file")  # open() would take 0 for stdin
    try:
        pieces, size = [], 0
        with open_patiently(path) as file:
            # Asked for all at once it would get a buffer of the largest size for each small file.
            while size <= MAX_FILE_SIZE and (piece := file.read(_PIECE)):
                pieces.append(piece)
                size += len(piece)
        data = b"".join(pieces)
    except FileNotFoundError:
        raise UsageError(f"{path}: no such file; check the path") from None
    except IsADirectoryError:
        raise UsageError(f"{path}: is a directory; name a file in it") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise UsageError(f"{path}: cannot be read ({reason}); check the path and its permissions") from None
    if len(data) > MAX_FILE_SIZE:
        raise LabError(f"is larger than {MAX_FILE_SIZE >> 20} MiB; give the right file", source=str(path))
    return data
