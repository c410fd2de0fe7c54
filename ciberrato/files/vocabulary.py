"""The names in lab and grid files, and what is said of names that are none."""

from __future__ import annotations

from collections.abc import Mapping

from ciberrato.errors import nearest_name
from ciberrato.files.xml import Reader
from ciberrato.files.xml_document import Element

Names = Mapping[str, Mapping[str, str]]
"""Elements, the attributes of each, and their defaults as printed."""

LAB: Names = {
    "Lab": {"Name": '"NO NAMED LAB"', "Width": "16", "Height": "16"},
    "Beacon": {"X": "0", "Y": "0", "Height": "0"},
    "Target": {"X": "0", "Y": "0", "Radius": "2"},
    "Wall": {"Height": "4"},
    "Corner": {"X": "0", "Y": "0"},
    "Row": {"Pos": "0", "Pattern": "empty", "Height": "4"},
}
GRID: Names = {"Grid": {}, "Position": {"X": "0", "Y": "0", "Dir": "0"}}

_NEEDED = {
    "Lab": ("Width", "Height"),
    "Beacon": ("X", "Y"),
    "Target": ("X", "Y"),
    "Corner": ("X", "Y"),
    "Row": ("Pos", "Pattern"),
    "Position": ("X", "Y"),
}
"""Attributes that each element of the kind should have; where one is missing, that is a note."""


def check_attributes(element: Element, names: Names, reader: Reader) -> None:
    """Report attributes that mean nothing, needed ones that are missing, and stray text.

    Parameters
    ----------
    element : Element
        Of a name in `names`.
    names : Names
    reader : Reader
        Gets the findings.
    """
    known = names[element.name]
    explained = set()
    for attribute in element.attributes:
        if attribute in known or ":" in attribute:  # xml:space, xsi:schemaLocation: not for us
            continue
        meant = nearest_name(attribute, known)
        taken = "is passed over"
        if meant is not None and meant not in element.attributes:
            explained.add(meant)
            taken += f", so that {meant} is {known[meant]}"
        listed = ", ".join(known) or "none"
        reader.warn(
            element,
            "unknown attribute",
            f'{element.name} {attribute}="{_short(element.attributes[attribute])}" means nothing',
            taken,
            attribute=attribute,
            advice=f"did you mean {meant}?" if meant else f"{element.name} has these: {listed}",
            instead=meant,
        )
    for attribute in _NEEDED.get(element.name, ()):
        if attribute not in element.attributes and attribute not in explained:
            reader.note(
                element, "missing attribute", f"{element.name} has no {attribute}", f"gets {known[attribute]}"
            )
    if element.text:
        reader.note(
            element, "text", f'there is text "{_short(element.text)}" in {element.name}', "is passed over"
        )


def check_unknown_element(element: Element, names: Names, reader: Reader, what: str) -> None:
    """Report an element that means nothing where it stands.

    Parameters
    ----------
    element : Element
    names : Names
    reader : Reader
        Gets the finding.
    what : str
        The kind of file: ``a lab``.
    """
    meant = nearest_name(element.name, names)
    where = " outside a Wall" if element.name == "Corner" else ""
    reader.warn(
        element,
        "unknown element",
        f"{element.name}{where} means nothing in {what}",
        "is passed over",
        advice=f"did you mean {meant}?" if meant not in (None, element.name) else "",
        instead=meant if meant != element.name else None,
    )


def check_place(element: Element, root: Element, reader: Reader) -> None:
    """Report an element that counts although its parent is not the root."""
    if element.parent is not None and element.parent is not root:
        inside = element.parent.name
        reader.note(
            element, "nesting", f"{element.name} stands inside {inside}", "counts as if it were outside"
        )


def _short(text: str) -> str:
    return text if len(text) <= 40 else text[:40] + "…"
