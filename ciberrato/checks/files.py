"""Check files: which kind each is, what is odd in it, and which of them belong together."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ciberrato.checks.free_space import free_space
from ciberrato.checks.likeness import likeness_findings
from ciberrato.checks.schema import schema_findings
from ciberrato.checks.things import reach_findings, start_findings, thing_findings
from ciberrato.errors import LabError, UsageError, nearest_name
from ciberrato.files.findings import Finding
from ciberrato.files.lab import LabFile, parse_lab_file
from ciberrato.files.parameters import ParameterFile, parse_parameter_file
from ciberrato.files.start_grid import GridFile, parse_grid_file
from ciberrato.files.xml import read_file
from ciberrato.files.xml_document import parse_elements
from ciberrato.labs import find_grid, find_lab
from ciberrato.reprs import short_repr

_KIND_WORDS = re.compile(r"[ _.-]*(?:lab|grid|grd|pos)(?=$|[^a-z])|\.xml$", re.IGNORECASE)


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """A file, and what was found in it.

    Attributes
    ----------
    source : str
        As it was named.
    kind : str
        ``lab``, ``grid``, ``parameters`` or ``unknown``.
    contents : LabFile, GridFile, ParameterFile or None
        None if the file cannot be used.
    findings : tuple of Finding
        In order of lines.
    """

    __repr__ = short_repr

    source: str
    kind: str
    contents: LabFile | GridFile | ParameterFile | None
    findings: tuple[Finding, ...]


def check_files(paths: Sequence[str | Path]) -> list[Checked]:
    """Check lab, grid and parameter files, each by itself and start grids against their lab.

    Parameters
    ----------
    paths : sequence of str or Path
        A start grid belongs to the lab whose name is the same but for the words ``lab`` and ``grid``; where
        no name fits, to the only lab.

    Returns
    -------
    list of Checked
        In the order of the paths.

    Raises
    ------
    UsageError
        If a file cannot be read.
    """
    checked = [_check_alone(read_file(path), str(path)) for path in paths]
    partners = _partners(checked)
    result = []
    for one in checked:
        extra: list[Finding] = []
        if isinstance(one.contents, GridFile):
            extra += _with_lab(one.contents, partners.get(one.source))
        elif isinstance(one.contents, LabFile):
            grids = [
                each.contents
                for each in checked
                if isinstance(each.contents, GridFile) and partners.get(each.source) is one.contents
            ]
            extra += _check_space(one.contents, grids)
        findings = sorted((*one.findings, *extra), key=lambda finding: finding.line or 0)
        result.append(replace(one, findings=tuple(findings)))
    return result


def kind_of(data: bytes, source: str) -> str:
    """Return what a file is: ``lab``, ``grid``, ``parameters``, or ``unknown``.

    Raises
    ------
    LabError
        If it is not XML.
    """
    elements = parse_elements(data, source, "a lab, grid or parameter")
    roots = {"Lab": "lab", "Grid": "grid", "Parameters": "parameters"}
    if elements[0].name in roots:
        return roots[elements[0].name]
    return "parameters" if any(element.name == "Parameters" for element in elements) else "unknown"


def _check_alone(data: bytes, source: str) -> Checked:
    kind = "unknown"
    try:
        kind = kind_of(data, source)
        if kind == "unknown":
            raise _unknown(data, source)
        contents: LabFile | GridFile | ParameterFile
        if kind == "lab":
            contents = parse_lab_file(data, source)
            known = (*contents.findings, *thing_findings(contents))
        elif kind == "grid":
            contents = parse_grid_file(data, source)
            known = contents.findings
        else:
            contents = parse_parameter_file(data, source)
            known = (*contents.findings, *_named_files(contents))
        known = (*known, *schema_findings(data, source, kind, known))
    except LabError as error:
        found = Finding(
            severity="error", kind="unusable", source=source, line=error.line, found=error.problem
        )
        return Checked(source=source, kind=kind, contents=None, findings=error.findings or (found,))
    return Checked(source=source, kind=kind, contents=contents, findings=known)


def _unknown(data: bytes, source: str) -> LabError:
    root = parse_elements(data, source, "a")[0]
    meant = nearest_name(root.name, ("Lab", "Grid", "Parameters"))
    advice = f"did you mean {meant}?" if meant else "give a lab, grid or parameter file"
    return LabError(
        f"the root element is {root.name}, not Lab, Grid or Parameters; {advice}",
        source=source,
        line=root.line,
    )


def _named_files(file: ParameterFile) -> list[Finding]:
    found = []
    for attribute, name, find in (
        ("Lab", file.parameters.lab_file, find_lab),
        ("Grid", file.parameters.grid_file, find_grid),
    ):
        if name is not None:
            try:
                find(name)
            except UsageError:
                text = f'{attribute}="{name}" is no file here, and none that ships'
                advice = "paths are relative to where the simulator is started"
                line = file.lines.get(attribute)
                found.append(
                    Finding(
                        severity="note",
                        kind="no such file",
                        source=file.source,
                        line=line,
                        found=text,
                        advice=advice,
                    )
                )
    return found


def _partners(checked: Sequence[Checked]) -> dict[str, LabFile]:
    """Return the lab of each start grid that has one, by the grid's source."""
    labs = {_stem(one.source): one.contents for one in checked if isinstance(one.contents, LabFile)}
    grids = {one.source: _stem(one.source) for one in checked if isinstance(one.contents, GridFile)}
    fitting = {source: labs[stem] for source, stem in grids.items() if stem in labs}
    if fitting or len(labs) != 1:
        return fitting
    (only,) = labs.values()
    return dict.fromkeys(grids, only)


def _stem(source: str) -> str:
    path = Path(source)
    return str(path.parent / _KIND_WORDS.sub("", path.name)).lower()


def _with_lab(file: GridFile, lab: LabFile | None) -> list[Finding]:
    if lab is not None:
        return start_findings(file.grid, lab.lab, file.source, file.lines)
    text = "no lab was given with this start grid: its positions were not looked at"
    return [Finding(severity="note", kind="no lab", source=file.source, line=None, found=text)]


def _check_space(file: LabFile, grids: Sequence[GridFile]) -> list[Finding]:
    space = free_space(file.lab)
    if space is None:
        text = "the lab is too large: what can be reached, and what looks the same, was not looked at"
        return [Finding(severity="note", kind="too large", source=file.source, line=1, found=text)]
    if space.part.max() < 0:
        text = "there is no place for a robot in this lab"
        return [Finding(severity="warning", kind="no place", source=file.source, line=1, found=text)]
    starts = [(position.x, position.y) for grid in grids for position in grid.grid.positions]
    return [
        *reach_findings(file, space, starts),
        *likeness_findings(file.lab, space, file.source, 1),
    ]
