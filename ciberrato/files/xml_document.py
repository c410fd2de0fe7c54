"""XML documents by lxml: bytes to a flat list of elements, each with the line where its tag begins.

lxml keeps the line where a start tag ends, but no lines of attributes. So the text is searched once more for
its tags, which are easy to find, as it is well-formed by then. Entities, external documents and the network
stay off; libxml2 bounds depth (256) and length (10 MB) of what it reads.
"""

from __future__ import annotations

import bisect
import contextlib
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ciberrato.errors import LabError
from ciberrato.reprs import short_repr

if TYPE_CHECKING:
    from lxml import etree

MAX_TAGS = 100_000
"""Start and end tags, comments and the like of a document."""
MAX_ATTRIBUTES = 256
"""Of one tag."""

_XML = "{http://www.w3.org/XML/1998/namespace}"
_ATTRIBUTE = r"""\s+([^\s=>/"']+)\s*=\s*(?:"[^"]*"|'[^']*')"""
_SKIPPED = r"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>|<!DOCTYPE[^\[>]*(?:\[.*?\]\s*)?>|</[^>]*>"
_TAG = re.compile(rf"{_SKIPPED}|<([^\s/>!?]+)((?:{_ATTRIBUTE})*)\s*/?>", re.DOTALL)
_VALUE = re.compile(rb"""=\s*["']""")
_ONE_ATTRIBUTE = re.compile(_ATTRIBUTE)
_DECLARED_ENCODING = re.compile(rb"""<\?xml[^>]*?\sencoding\s*=\s*["']([A-Za-z0-9._:-]*)["']""")
_NOT_UTF8 = "bytes that are not UTF-8; save it as UTF-8, or declare its encoding"
MISMATCH = re.compile(r"Opening and ending tag mismatch: (\S+) line (\d+) and (\S+)")
_LEFT_OPEN = re.compile(r"Premature end of data in tag (\S+) line (\d+)")


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
    attribute_lines : dict of str to int
        Lines of the attributes that are not on the tag's.
    text : str
        Character data directly inside, without blanks around it.
    """

    __repr__ = short_repr

    name: str
    attributes: dict[str, str]
    line: int
    parent: Element | None
    attribute_lines: dict[str, int] = field(default_factory=dict)
    text: str = ""

    def line_of(self, attribute: str) -> int:
        """Return the line of an attribute, or of the tag if it has none."""
        return self.attribute_lines.get(attribute, self.line)


def parse_elements(data: bytes, source: str, what: str) -> list[Element]:
    """Return all start tags of an XML document, in document order.

    Parameters
    ----------
    data : bytes
        In any encoding that libxml2 knows: UTF-8, UTF-16 with byte order mark, or as declared.
    source : str
        The file's name, for messages.
    what : str
        Expected kind of document, for messages: ``a lab``.

    Raises
    ------
    LabError
        If the data are not well-formed XML, declare entities, or are nested deeper than 256 elements.
    """
    return elements_of(parse_tree(data, source, what), data)


def parse_tree(data: bytes, source: str, what: str) -> etree._Element:
    """Return the root of an XML document, see `parse_elements`."""
    if not data.strip():
        raise LabError(f"is empty; give {what} file", source=source, line=1)
    _check_counts(data, source, what)
    root, faults = _parsed(data)
    if root is None:
        code, line, message = next((fault for fault in faults if fault[2]), (0, 1, "error"))
        if "entit" in message.lower() and b"<!ENTITY" in data.replace(b"\0", b""):
            raise _entities(data, source, what)
        raise LabError(_problem(code, message, what), source=source, line=line or 1)
    declared = root.getroottree().docinfo.internalDTD
    if declared is not None and list(declared.iterentities()):  # type: ignore[attr-defined]
        raise _entities(data, source, what)
    document: Any = root.getroottree().docinfo
    if document.system_url is not None or document.public_id is not None:
        problem = f"has a DOCTYPE that names another document, which {what} file must not; remove it"
        raise LabError(problem, source=source, line=_line_of(data, b"<!DOCTYPE"))
    return root


def _check_counts(data: bytes, source: str, what: str) -> None:
    """Refuse what is too much to be read in reasonable time and memory, by counting characters."""
    data = data.replace(b"\0", b"")  # of UTF-16
    tags = data.count(b"<")
    if tags > MAX_TAGS:
        problem = f"has {tags} tags, {MAX_TAGS} at most; give {what} file"
        raise LabError(problem, source=source, line=1)
    line = 1
    for piece in data.split(b"<"):
        # Most pieces have few signs of equality; a comment may be full of them.
        if piece.count(b"=") > MAX_ATTRIBUTES and len(_VALUE.findall(piece)) > MAX_ATTRIBUTES:
            problem = f"has a tag with more than {MAX_ATTRIBUTES} attributes; give {what} file"
            raise LabError(problem, source=source, line=line)
        line += piece.count(b"\n")


def _parsed(data: bytes, **options: Any) -> tuple[etree._Element | None, list[tuple[int, int, str]]]:
    """Return the root, or None and the faults: their code, line and message."""
    from lxml import etree

    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False, **options
    )
    try:
        return etree.fromstring(data, parser), []
    except etree.XMLSyntaxError as error:
        entries = list(parser.error_log)  # the error's own log is that of all parsers so far
        faults = [(entry.type, entry.line, entry.message or "") for entry in entries]
        faults = faults or [(0, error.lineno or 1, error.msg or "")]
    except (LookupError, ValueError) as error:
        return None, [(etree.ErrorTypes.ERR_UNKNOWN_ENCODING, 1, str(error))]
    if not options:
        if entries and all(entry.domain_name == "NAMESPACE" for entry in entries):
            return _parsed(data, recover=True)  # well-formed: the real parser knows no name spaces
        declared = _DECLARED_ENCODING.match(data)
        if declared and faults[0][0] == etree.ErrorTypes.ERR_UNSUPPORTED_ENCODING:
            with contextlib.suppress(LookupError, ValueError):  # one that only Python knows
                return _parsed(data.decode(declared[1].decode("ascii")).encode(), encoding="utf-8")
    return None, faults


def _entities(data: bytes, source: str, what: str) -> LabError:
    problem = f"declares XML entities, which {what} file must not; remove them"
    return LabError(problem, source=source, line=_line_of(data, b"<!ENTITY"))


def _line_of(data: bytes, mark: bytes) -> int:
    before, found, _ = data.replace(b"\0", b"").partition(mark)
    return before.count(b"\n") + 1 if found else 1


def _problem(code: int | None, message: str, what: str) -> str:
    """Return what is wrong, in plain words where the parser's own are not."""
    from lxml.etree import ErrorTypes

    if mismatch := MISMATCH.search(message):
        opened, line, closed = mismatch.groups()
        why = f"mismatched tag: </{closed}> where </{opened}> is due, as {opened} of line {line} is left open"
    elif left_open := _LEFT_OPEN.search(message):
        why = f"the end is missing: {left_open[1]} of line {left_open[2]} is left open"
    elif "depth" in message.lower() or "huge" in message.lower():
        return f"is nested too deeply or too long in one piece; give {what} file"
    elif code in (ErrorTypes.ERR_UNSUPPORTED_ENCODING, ErrorTypes.ERR_UNKNOWN_ENCODING):
        return f"declares an encoding that cannot be read ({message}); use UTF-8"
    elif "not proper UTF-8" in message:  # libxml2 before 2.14 counts it among other invalid characters
        why = _NOT_UTF8
    else:
        known = {
            ErrorTypes.ERR_DOCUMENT_EMPTY: "it does not begin with an element",
            ErrorTypes.ERR_LT_IN_ATTRIBUTE: "a < within a value: the quote that ends it is missing",
            ErrorTypes.ERR_HYPHEN_IN_COMMENT: "-- within a comment",
            ErrorTypes.ERR_DOCUMENT_END: "something follows the end of the document",
            ErrorTypes.ERR_ATTRIBUTE_REDEFINED: f"duplicate attribute: {message}",
            ErrorTypes.ERR_ATTRIBUTE_NOT_STARTED: "a value without quotes around it",
            ErrorTypes.ERR_INVALID_ENCODING: _NOT_UTF8,
        }
        why = known.get(code or -1, " ".join(message.split()))
    return f"is not well-formed XML ({why}); correct it, or give {what} file"


def elements_of(root: etree._Element, data: bytes) -> list[Element]:
    """Return all elements of a tree, in document order.

    Parameters
    ----------
    root : lxml element
    data : bytes
        Bytes of the document.
    """
    nodes = list(root.iter("*"))
    lines = _tag_lines(data, root.getroottree().docinfo.encoding or "UTF-8")
    if len(lines) != len(nodes):  # an encoding that Python does not know
        lines = [(end_line(node), {}) for node in nodes]
    made: dict[object, Element] = {}
    elements = []
    for node, (line, attribute_lines) in zip(nodes, lines, strict=True):
        parent = node.getparent()
        pieces = [node.text, *(child.tail for child in node)]
        element = Element(
            _name(node, str(node.tag)),
            {_name(node, str(key)): str(value) for key, value in node.attrib.items()},
            line,
            None if parent is None else made[parent],
            attribute_lines,
            " ".join(piece.strip() for piece in pieces if piece and piece.strip()),
        )
        made[node] = element
        elements.append(element)
    return elements


def end_line(node: etree._Element) -> int:
    """Return the line where a start tag ends."""
    return int(getattr(node, "sourceline", None) or 1)


def _name(node: etree._Element, name: str) -> str:
    """Return the name as written: with its prefix, not with the namespace that it stands for."""
    if not name.startswith("{"):
        return name
    space, local = name[1:].split("}")
    if name.startswith(_XML):
        return f"xml:{local}"
    prefix = (
        node.prefix
        if name == node.tag
        else next((p for p, s in node.nsmap.items() if p and s == space), None)
    )
    return f"{prefix}:{local}" if prefix else local


def _tag_lines(data: bytes, encoding: str) -> list[tuple[int, dict[str, int]]]:
    """Return for every start tag its line, and the lines of its attributes that are on others."""
    try:
        text = data.decode(encoding)
    except (LookupError, ValueError):
        return []
    ends = [match.start() for match in re.finditer("\n", text)]
    lines = []
    for tag in _TAG.finditer(text):
        if tag[1] is None:
            continue
        line = bisect.bisect_left(ends, tag.start()) + 1
        others = {}
        if "\n" in tag[0]:
            for attribute in _ONE_ATTRIBUTE.finditer(tag[0]):
                others[attribute[1]] = bisect.bisect_left(ends, tag.start() + attribute.start(1)) + 1
        lines.append((line, others))
    return lines
