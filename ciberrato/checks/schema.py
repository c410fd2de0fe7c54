"""The RELAX NG schemas that ship, and what a file has that they do not allow."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ciberrato.errors import UsageError
from ciberrato.files import xml_document
from ciberrato.files.findings import Finding

KINDS = ("lab", "grid", "parameters")

_FOLDER = Path(xml_document.__file__).parent / "schemas"


def schema_file(kind: str) -> Path:
    """Find a schema.

    Parameters
    ----------
    kind : str
        ``lab``, ``grid`` or ``parameters``.

    Returns
    -------
    Path

    Raises
    ------
    UsageError
        If there is none of that kind.
    """
    if kind not in KINDS:
        raise UsageError(f"{kind!r} is not a kind of file; choose one of {', '.join(KINDS)}")
    return _FOLDER / f"{kind}.rng"


def schema_findings(data: bytes, source: str, kind: str, known: Sequence[Finding]) -> list[Finding]:
    """Find what the schema does not allow and no other finding reports.

    Parameters
    ----------
    data : bytes
        Bytes of a well-formed file.
    source : str
        The file's name.
    kind : str
        As for `schema_file`.
    known : sequence of Finding
        Findings of the reader, which say more than a schema can; lines that they mention are left out.

    Returns
    -------
    list of Finding
        At most one a line.
    """
    from lxml import etree

    root = xml_document.parse_tree(data, source, "a")
    schema = etree.RelaxNG(etree.parse(str(schema_file(kind))))
    if schema.validate(root):
        return []
    # The schema gives the line where a tag ends, and an error in a child makes others of its parents.
    lines = {int(entry.line): entry.message or "" for entry in schema.error_log}
    told = {finding.line for finding in known}
    begins = {
        xml_document.end_line(node): element.line
        for node, element in zip(root.iter("*"), xml_document.elements_of(root, data), strict=True)
    }
    found = {}
    for line, message in lines.items():
        first = begins.get(line, line)
        if told.isdisjoint(range(first, line + 1)) and (not told or line != xml_document.end_line(root)):
            found[first] = message
    return [
        Finding(
            severity="warning",
            kind="schema",
            source=source,
            line=line,
            found=f"not as the schema says: {message}",
        )
        for line, message in found.items()
    ]
