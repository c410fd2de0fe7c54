"""A second look at messages of clients that are not quite XML, but that the real simulator's parser takes.

Taken are: an attribute twice (the last one counts), no blank between attributes, control characters and
references to them (``&#0;``; each becomes ``?``, as XML cannot carry them), a document type (passed over),
and references to entities other than the five of XML. These are never expanded, whatever the document type
declares: where text is ignored anyway they do no harm, and in an attribute or a Say they make the
message one that is refused, with a note.
"""

from __future__ import annotations

import re

from ciberrato.errors import ProtocolError
from ciberrato.protocol.limits import NESTING_LIMIT, TOLERANCE_LIMIT
from ciberrato.protocol.text import NOT_XML, shown
from ciberrato.protocol.xmltree import Element, as_utf8

_NAME = r"[A-Za-z_:\u0080-\U0010ffff][-\w.:\u00b7]*"
_BLANK = "[ \t\r\n]"
_PROLOG = re.compile(rf"\ufeff?(?:<\?xml{_BLANK}[^<>]*?\?>)?")
_COMMENT = "<!--(?:[^-]|-(?!-))*-->"
_PASSED_OVER = re.compile(rf"{_BLANK}+|{_COMMENT}|<\?(?!xml{_BLANK})[A-Za-z][^<>]*?\?>")
_DOCTYPE = re.compile(rf"<!DOCTYPE{_BLANK}+{_NAME}")
# Each part of a document type can be read in one way only: so no way is tried twice.
_DOCTYPE_PART = re.compile(rf"{_COMMENT}|\"[^\"]*\"|'[^']*'|[^\"']")
_START = re.compile(rf"<({_NAME})")
_ATTRIBUTE = re.compile(rf"{_BLANK}*({_NAME}){_BLANK}*={_BLANK}*(?:\"([^<\"]*)\"|'([^<']*)')")
_START_END = re.compile(rf"{_BLANK}*(/?)>")
_END = re.compile(rf"</({_NAME}){_BLANK}*>")
_TEXT = re.compile(r"[^<]+")
_CDATA = re.compile(r"<!\[CDATA\[(.*?)\]\]>", re.DOTALL)
_REFERENCE = re.compile(rf"&(?:#([0-9]{{1,8}})|#x([0-9A-Fa-f]{{1,7}})|({_NAME}));|&")
_PREDEFINED = {"lt": "<", "gt": ">", "amp": "&", "quot": '"', "apos": "'"}

ENTITY = "\uffff"
"""Stands for a reference to an entity in a parsed text; otherwise no text has it, as XML cannot carry it."""


class _UnreadableError(Exception):
    """The real parser would not take it either, as far as is known."""


def parse_tolerantly(data: bytes) -> Element | None:
    """Parse a document that is not well-formed as the real simulator does.

    Parameters
    ----------
    data : bytes
        Without the terminating NUL.

    Returns
    -------
    Element or None
        The root; None if there is no way to read it, or it is longer than `TOLERANCE_LIMIT`.

    Raises
    ------
    ProtocolError
        If an attribute, or the text of a Say, has a reference to an entity.
    """
    if len(data) > TOLERANCE_LIMIT:
        return None
    try:
        return _Reader(as_utf8(data, "?").decode("utf-8")).document()
    except _UnreadableError:
        return None


class _Reader:
    """Reads one document from its beginning to its end, each part once."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._place = 0

    def document(self) -> Element:
        """Read it all."""
        self._take(_PROLOG)
        self._pass_over()
        if self._take(_DOCTYPE):
            self._document_type()
            self._pass_over()
        root = self._element()
        self._pass_over()
        if self._place < len(self._text):
            raise _UnreadableError
        return root

    def _take(self, pattern: re.Pattern[str]) -> re.Match[str] | None:
        match = pattern.match(self._text, self._place)
        if match:
            self._place = match.end()
        return match

    def _need(self, pattern: re.Pattern[str]) -> re.Match[str]:
        match = self._take(pattern)
        if match is None:
            raise _UnreadableError
        return match

    def _pass_over(self) -> None:
        while self._take(_PASSED_OVER):
            pass

    def _document_type(self) -> None:
        """Skip what follows the name of a document type, up to its end."""
        declarations = False
        while (part := self._need(_DOCTYPE_PART)[0]) != ">" or declarations:
            if part in "[]":
                declarations = part == "["

    def _element(self) -> Element:
        """Read an element and all that is in it."""
        root, closed = self._tag()
        open_elements = [] if closed else [root]
        last_closed: Element | None = None
        while open_elements:
            here = open_elements[-1]
            if end := self._take(_END):
                if end[1] != here.name:
                    raise _UnreadableError
                last_closed = open_elements.pop()
            elif text := self._characters():
                if last_closed is None:
                    here.text = _without_entity(here.text + text, here)
                else:
                    last_closed.tail = _without_entity(last_closed.tail + text, last_closed)
            elif not self._take(_PASSED_OVER):
                if len(open_elements) >= NESTING_LIMIT:
                    raise _UnreadableError
                child, closed = self._tag()
                here.children.append(child)
                last_closed = child if closed else None
                if not closed:
                    open_elements.append(child)
        return root

    def _tag(self) -> tuple[Element, bool]:
        """Read a start tag; return whether it is an end tag too."""
        element = Element(self._need(_START)[1], {})
        while attribute := self._take(_ATTRIBUTE):
            name, double, single = attribute.groups()
            value = re.sub("\r\n|[\t\r\n]", " ", single if double is None else double)
            element.attributes.pop(name, None)  # so that the last one counts, in its place
            element.attributes[name] = _resolved(value)
            if ENTITY in element.attributes[name]:
                raise ProtocolError(
                    f"{shown(element.name)} {shown(name)}: entities are not part of the protocol; "
                    "write the text itself"
                )
        return element, self._need(_START_END)[1] == "/"

    def _characters(self) -> str:
        """Read text up to the next tag; an empty one if there is none."""
        if text := self._take(_TEXT):
            if "]]>" in text[0]:
                raise _UnreadableError
            return _resolved(text[0].replace("\r\n", "\n").replace("\r", "\n"))
        section = self._take(_CDATA)
        return NOT_XML.sub("?", section[1].replace("\r\n", "\n").replace("\r", "\n")) if section else ""


def _without_entity(text: str, element: Element) -> str:
    if element.name == "Say" and ENTITY in text:
        raise ProtocolError("Say: entities are not part of the protocol; write the text itself")
    return text


def _resolved(text: str) -> str:
    """Replace references by characters; what XML cannot carry becomes a question mark."""
    return _REFERENCE.sub(_character, NOT_XML.sub("?", text))


def _character(reference: re.Match[str]) -> str:
    decimal, hexadecimal, name = reference.groups()
    if name:
        return _PREDEFINED.get(name, ENTITY)
    if not (decimal or hexadecimal):
        raise _UnreadableError
    code = int(decimal) if decimal else int(hexadecimal, 16)
    return NOT_XML.sub("?", chr(code)) if code < 0x110000 else "?"
