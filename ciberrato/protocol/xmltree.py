"""XML bytes of one message to a small tree, by expat, with everything refused that a peer could abuse."""

from __future__ import annotations

import re
from typing import Literal
from xml.parsers.expat import ExpatError, ParserCreate
from xml.parsers.expat.errors import messages as _error_messages

from ciberrato.errors import ProtocolError
from ciberrato.protocol.limits import NESTING_LIMIT
from ciberrato.protocol.text import shown

_DECLARED_ENCODING = re.compile(rb"""<\?xml[^>]*?\sencoding\s*=\s*["']([A-Za-z0-9._:-]*)["']""")
_KNOWN_ENCODINGS = {
    "utf-8": "utf-8",
    "utf8": "utf-8",
    "us-ascii": "utf-8",
    "ascii": "utf-8",
    "iso-8859-1": "latin-1",
    "latin1": "latin-1",
    "latin-1": "latin-1",
}
_UNDECODED = re.compile("[\udc80-\udcff]")


class Element:
    """One element of a message.

    Attributes
    ----------
    name : str
    attributes : dict of str to str
        In the order of the wire.
    children : list of Element
    text : str
        Character data between the start tag and the first child, or the end tag.
    tail : str
        Character data between the end tag and the next tag.
    """

    __slots__ = ("attributes", "children", "name", "tail", "text")

    def __init__(self, name: str, attributes: dict[str, str]) -> None:
        self.name = name
        self.attributes = attributes
        self.children: list[Element] = []
        self.text = ""
        self.tail = ""


def message_bytes(data: bytes, limit: int | None = None) -> bytes:
    """Return the part of a datagram that counts: what its first `limit` bytes have before the first NUL."""
    if limit is not None and len(data) > limit:
        data = data[:limit]
    end = data.find(0)
    return data if end < 0 else data[:end]


def parse_document(data: bytes, *, invalid_bytes: Literal["?", "latin-1"]) -> Element:
    """Parse one XML document.

    Parameters
    ----------
    data : bytes
        Without the terminating NUL.
    invalid_bytes : {"?", "latin-1"}
        Replacement of bytes that are not UTF-8 where no encoding is declared: a question mark each, as the
        real simulator does, or Latin-1 letters, as the real simulator sends them.

    Returns
    -------
    Element
        The root.

    Raises
    ------
    ProtocolError
        If the bytes are not well-formed XML, have a document type (and so entities of their own), declare an
        encoding other than UTF-8, ASCII or Latin-1, or are nested too deeply.
    """
    if not data.isascii() or data.startswith(b"<?xml"):
        data = as_utf8(data, invalid_bytes)
    roots: list[Element] = []
    open_elements: list[Element] = []
    closed: list[Element] = []

    def start(name: str, attributes: dict[str, str]) -> None:
        element = Element(name, attributes)
        if open_elements:
            if len(open_elements) >= NESTING_LIMIT:
                raise ProtocolError(f"{shown(name)}: nested more than {NESTING_LIMIT} elements deep")
            open_elements[-1].children.append(element)
        else:
            roots.append(element)
        open_elements.append(element)
        closed.clear()

    def end(_name: str) -> None:
        closed[:] = (open_elements.pop(),)

    def characters(text: str) -> None:
        if closed:
            closed[0].tail += text
        else:
            open_elements[-1].text += text

    # The encoding given here wins over a declared one; no other decoder of Python's is ever reached.
    parser = ParserCreate("utf-8")
    parser.buffer_text = True
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = characters
    parser.StartDoctypeDeclHandler = _refuse_doctype
    try:
        parser.Parse(data, True)
    except ExpatError as error:
        problem = _error_messages.get(error.code, "error")
        raise ProtocolError(
            f"not an XML document: {problem} (line {error.lineno}, column {error.offset + 1})"
        ) from None
    return roots[0]


def _refuse_doctype(name: str, _system: str | None, _public: str | None, _internal: int) -> None:
    raise ProtocolError(f"DOCTYPE {shown(name)}: document types and entities are not part of the protocol")


def as_utf8(data: bytes, invalid_bytes: Literal["?", "latin-1"]) -> bytes:
    """Convert bytes of any encoding to UTF-8."""
    declared = _DECLARED_ENCODING.match(data)
    if declared:
        name = declared.group(1).decode("ascii").lower()
        encoding = _KNOWN_ENCODINGS.get(name)
        if encoding is None:
            raise ProtocolError(f"XML declaration: encoding {shown(name)!r} is not supported; use UTF-8")
        if encoding == "latin-1":
            return data.decode("latin-1").encode("utf-8")
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        if invalid_bytes == "latin-1":
            return data.decode("latin-1").encode("utf-8")
        return _UNDECODED.sub("?", data.decode("utf-8", "surrogateescape")).encode("utf-8")
    return data
