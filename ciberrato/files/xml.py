"""XML documents on disk: bytes to a flat list of elements, and attributes to numbers.

Lab, grid and parameter files are read by one set of rules, those of the real simulator: an attribute that
does not hold a number counts as 0, whatever stands where nothing is expected is passed over, and only
what is not XML at all is refused. What is passed over is reported as a warning with its line.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from ciberrato.errors import LabError, UsageError

MAX_FILE_SIZE = 16 * 2**20
"""Bytes; a larger file is refused before it is parsed."""

_REAL = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[+-]?(?:inf|nan)", re.IGNORECASE)
_INTEGER = re.compile(r"[+-]?[0-9]+")


@dataclass(frozen=True, slots=True)
class Element:
    """One start tag.

    Attributes
    ----------
    name : str
    attributes : dict of str to str
    line : int
        Line of the tag, counted from 1.
    parent : Element or None
        The element around it; None for the root.
    """

    name: str
    attributes: dict[str, str]
    line: int
    parent: Element | None


@dataclass(slots=True)
class Reader:
    """Turns attributes into numbers as the real simulator does, and remembers what it had to guess.

    Attributes
    ----------
    source : str
        The file's name, for messages.
    warnings : list of str
        One line each: ``file:line: what was found, and what was made of it``.
    """

    source: str
    warnings: list[str] = field(default_factory=list)

    def warn(self, element: Element, problem: str) -> None:
        """Add a warning about an element."""
        self.warnings.append(f"{self.source}:{element.line}: {problem}")

    def error(self, element: Element, problem: str) -> LabError:
        """Make the error that an element deserves; the caller raises it."""
        return LabError(problem, source=self.source, line=element.line)

    def real(self, element: Element, attribute: str, default: float) -> float:
        """Value of an attribute that should hold a real number; 0 where it does not.

        Raises
        ------
        LabError
            If the number is infinite or not a number, or too large for a double.
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
            self.warn(element, f'{element.name} {attribute}="{text}" is not a number and counts as 0')
            return 0.0
        raise self.error(element, f'{element.name} {attribute}="{text}" is not finite: write a finite number')

    def integer(self, element: Element, attribute: str, default: int) -> int:
        """Value of an attribute that should hold an integer of 32 bits; 0 where it does not."""
        return self._integer(element, attribute, default, -(2**31), 2**31 - 1)

    def natural(self, element: Element, attribute: str, default: int) -> int:
        """Value of an attribute that should hold an unsigned integer of 32 bits; 0 where it does not."""
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
        self.warn(
            element,
            f'{element.name} {attribute}="{text}" is not an integer from {least} to {greatest} '
            "and counts as 0",
        )
        return 0

    def switch(self, element: Element, attribute: str, default: bool) -> bool:
        """Value of an attribute that is on where it says exactly ``On``."""
        text = element.attributes.get(attribute)
        if text is None:
            return default
        if text not in ("On", "Off"):
            self.warn(element, f'{element.name} {attribute}="{text}" is not "On" and counts as "Off"')
        return text == "On"


def read_file(path: str | Path) -> bytes:
    """Read a whole file.

    Raises
    ------
    UsageError
        If there is no such file, or it cannot be read.
    LabError
        If it is larger than `MAX_FILE_SIZE`.
    """
    try:
        with open(path, "rb") as file:
            data = file.read(MAX_FILE_SIZE + 1)
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


def parse_elements(data: bytes, source: str, what: str) -> list[Element]:
    """All start tags of an XML document, in the order of the document.

    Parameters
    ----------
    data : bytes
        In any encoding that expat knows: UTF-8, UTF-16 with byte order mark, or as declared.
    source : str
        The file's name, for messages.
    what : str
        What the document should be, for messages: ``a lab``.

    Raises
    ------
    LabError
        If the data are not well-formed XML, or declare entities.
    """
    elements: list[Element] = []
    open_elements: list[Element | None] = [None]
    parser = expat.ParserCreate()

    def start(name: str, attributes: dict[str, str]) -> None:
        element = Element(name, attributes, parser.CurrentLineNumber, open_elements[-1])
        elements.append(element)
        open_elements.append(element)

    def end(_name: str) -> None:
        open_elements.pop()

    def entity(*_declaration: object) -> None:
        problem = f"declares XML entities, which {what} file must not; remove them"
        raise LabError(problem, source=source, line=parser.CurrentLineNumber)

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.EntityDeclHandler = entity
    if not data.strip():
        raise LabError(f"is empty; give {what} file", source=source, line=1)
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        problem = f"is not well-formed XML ({expat.ErrorString(error.code)}); correct it, or give {what} file"
        raise LabError(problem, source=source, line=error.lineno) from None
    except (LookupError, ValueError) as error:  # Python does not know it, or it is not one byte a character
        problem = f"declares an encoding that cannot be read ({error}); use UTF-8"
        raise LabError(problem, source=source, line=1) from None
    return elements
