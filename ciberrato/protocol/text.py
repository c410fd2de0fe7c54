"""Numbers and words on the wire: how each side reads them, and how they are written."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from ciberrato.errors import ProtocolError, UsageError

_REAL = re.compile(
    r"[+-]?(?:(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,9})?|inf|nan)", re.IGNORECASE
)
_INTEGER = re.compile(r"[+-]?[0-9]{1,20}")
_BLANKS = " \t\r\n"
_SPACES = "\t\n\v\f\r \x85\xa0\u1680\u2028\u2029\u202f\u205f\u3000" + "".join(map(chr, range(0x2000, 0x200B)))
"""Characters that the real simulator skips around numbers: all of Unicode's spaces."""
NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
_ESCAPES = str.maketrans(
    {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "\t": "&#9;", "\n": "&#10;", "\r": "&#13;"}
)


def shown(text: str, longest: int = 40) -> str:
    """Return the peer's text for an error message, cut where it is long."""
    return text if len(text) <= longest else text[:longest] + "…"


# --- as the simulator reads: what is no number is 0 ------------------------------------------------


def lenient_real(text: str) -> float:
    """Read a real number as the real simulator does: spaces around it do not matter, anything else is 0."""
    text = text.strip(_SPACES)
    return float(text) if _REAL.fullmatch(text) else 0.0


def lenient_integer(text: str) -> int:
    """Read an integer as the real simulator does: what is not one of 32 bits, with sign, is 0."""
    text = text.strip(_SPACES)
    value = int(text) if _INTEGER.fullmatch(text) else 0
    return value if -(2**31) <= value < 2**31 else 0


def finite_real(text: str, place: str) -> float:
    """Read a real number as `lenient_real` does, but refuse infinities and NaN.

    Raises
    ------
    ProtocolError
        Naming `place`.
    """
    value = lenient_real(text)
    if not math.isfinite(value):
        raise ProtocolError(f"{place}: {shown(text.strip(_SPACES))!r} is not a finite number")
    return value


# --- as clients read: what is no number is an error --------------------------------------------------


def strict_real(text: str, place: str) -> float:
    """Read a real number, ``nan`` and ``inf`` included.

    Raises
    ------
    ProtocolError
        Naming `place`.
    """
    stripped = text.strip(_BLANKS)
    if not _REAL.fullmatch(stripped):
        raise ProtocolError(f"{place}: {shown(text)!r} is not a number")
    return float(stripped)


def strict_integer(text: str, place: str) -> int:
    """Read an integer.

    Raises
    ------
    ProtocolError
        Naming `place`.
    """
    stripped = text.strip(_BLANKS)
    if not _INTEGER.fullmatch(stripped):
        raise ProtocolError(f"{place}: {shown(text)!r} is not an integer")
    return int(stripped)


def required(attributes: Mapping[str, str], element: str, name: str) -> str:
    """Return an attribute that must be there.

    Raises
    ------
    ProtocolError
        Naming element and attribute.
    """
    try:
        return attributes[name]
    except KeyError:
        raise ProtocolError(f"{element}: attribute {name} is missing") from None


# --- writing -----------------------------------------------------------------------------------------


def general(value: float) -> str:
    """Write a number as C's ``%g`` does, with the sign of a negative NaN."""
    if value != value and math.copysign(1.0, value) < 0:
        return "-nan"
    return f"{value:g}"


def exact(value: float) -> str:
    """Return a number as text from which exactly the same number is read."""
    return repr(float(value))


def attribute(text: str, place: str) -> str:
    """Escape text for an attribute value in double quotes.

    Raises
    ------
    UsageError
        If it has a character that XML cannot carry; names `place`.
    """
    if text.isalnum():
        return text
    _check_characters(text, place)
    return text.translate(_ESCAPES)


def cdata(text: str, place: str) -> str:
    """Return a text in CDATA sections; the end mark and carriage returns inside it survive.

    Raises
    ------
    UsageError
        If it has a character that XML cannot carry; names `place`.
    """
    if not text.isalnum():
        _check_characters(text, place)
        # A parser would read a bare carriage return as a newline, and the end mark would end the section.
        text = text.replace("]]>", "]]]]><![CDATA[>").replace("\r", "]]>&#13;<![CDATA[")
    return f"<![CDATA[{text}]]>"


def within(text: str, limit: int, element: str) -> str:
    """Return the text of a client's message.

    Raises
    ------
    UsageError
        If it is longer than a simulator reads; names the element.
    """
    length = len(text.encode())
    if length > limit:
        raise UsageError(
            f"{element}: {length} bytes are too many, a simulator reads {limit}; shorten the text"
        )
    return text


def _check_characters(text: str, place: str) -> None:
    bad = NOT_XML.search(text)
    if bad:
        raise UsageError(f"{place}: character U+{ord(bad.group()):04X} cannot be sent; leave it out")
