"""Parameter files: XML to `Parameters`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ciberrato.errors import nearest_name
from ciberrato.files.findings import Finding, warnings_of
from ciberrato.files.xml import Reader, read_file
from ciberrato.files.xml_document import Element, parse_elements
from ciberrato.reprs import short_repr
from ciberrato.world.parameter_names import FILE_NAMES, INTEGERS, REALS, SWITCHES
from ciberrato.world.parameters import Parameters

# In files the collision latency has a small letter, and the line sensor's probability can be set, which is
# never announced.
_SIGNED = {name: INTEGERS[name] for name in ("ReturnTimePenalty", "CollisionRobotPenalty")}
"""The only two that the real simulator reads with their sign; a negative value of the others is 0."""
_NATURALS = {
    name: field for name, field in INTEGERS.items() if name != "CollisionLatency" and name not in _SIGNED
} | {"collisionLatency": "collision_latency"}
_REALS = REALS | {"LineSensorTrueProb": "line_sensor_true_probability"}

_WITHOUT_EFFECT = {
    "RequestsPerCycle": ("write NRequestsPerCycle", "NRequestsPerCycle"),
    "CollisionLatency": (
        "write collisionLatency, the only spelling that the real simulator reads",
        "collisionLatency",
    ),
    "GPSRequestable": ("the GPS cannot be requested", None),
    "GPSLatency": ("the GPS has no latency", None),
}
_PASSED_OVER = {"NBeacons", "ShowActions"}
"""Stand in many files and mean nothing: the simulator announces its own values."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterFile:
    """Parameters with what their file says beside.

    Attributes
    ----------
    parameters : Parameters
    source : str
        The file's name.
    findings : tuple of Finding
        Parts that are ignored or read as something else, in order of lines.
    lines : dict of str to int
        The line of each attribute.
    """

    __repr__ = short_repr

    parameters: Parameters
    source: str
    findings: tuple[Finding, ...]
    lines: dict[str, int]


def read_parameters(path: str | Path, defaults: Parameters | None = None) -> Parameters:
    """Read a parameter file.

    Parameters
    ----------
    path : str or Path
    defaults : Parameters or None
        Values of what the file does not mention; None = built-in ones.

    Raises
    ------
    UsageError
        If the file cannot be read.
    LabError
        If it does not hold parameters.
    """
    return read_parameters_with_warnings(path, defaults)[0]


def read_parameters_with_warnings(
    path: str | Path, defaults: Parameters | None = None
) -> tuple[Parameters, tuple[str, ...]]:
    """Read a parameter file, and say what was passed over or guessed.

    Parameters
    ----------
    path : str or Path
    defaults : Parameters or None
        Values of what the file does not mention; None = built-in ones.

    Returns
    -------
    parameters : Parameters
    warnings : tuple of str
        As in `parse_parameters_with_warnings`.

    Raises
    ------
    UsageError
        If the file cannot be read.
    LabError
        If it does not hold parameters.
    """
    return parse_parameters_with_warnings(read_file(path), str(path), defaults)


def parse_parameters(
    data: bytes, source: str = "parameters", defaults: Parameters | None = None
) -> Parameters:
    """Read parameters from the bytes of their file; see `parse_parameters_with_warnings`."""
    return parse_parameters_with_warnings(data, source, defaults)[0]


def parse_parameters_with_warnings(
    data: bytes, source: str = "parameters", defaults: Parameters | None = None
) -> tuple[Parameters, tuple[str, ...]]:
    """Read parameters from the bytes of their file.

    Parameters
    ----------
    data : bytes
        The XML document. Every ``Parameters`` element in it counts, one on top of the other, whatever the
        root.
    source : str
        The file's name, for messages.
    defaults : Parameters or None
        Values of what the file does not mention; None = built-in ones.

    Returns
    -------
    parameters : Parameters
    warnings : tuple of str
        Values and names that the real simulator takes for something else. One line each, with file and line.

    Raises
    ------
    LabError
        If the data are not XML, or a value is impossible: not finite, a noise below 0, a probability
        outside 0 to 1.
    """
    file = parse_parameter_file(data, source, defaults)
    return file.parameters, warnings_of(file.findings)


def parse_parameter_file(
    data: bytes, source: str = "parameters", defaults: Parameters | None = None
) -> ParameterFile:
    """Read parameters, and what is odd in their file; see `parse_parameters_with_warnings`."""
    if defaults is not None and not isinstance(defaults, Parameters):
        raise TypeError(f"defaults: {defaults!r:.60} is not a Parameters")
    elements = parse_elements(data, source, "a parameter")
    reader = Reader(source)
    parameters = Parameters() if defaults is None else defaults
    found = False
    for element in elements:
        if element.name == "Parameters":
            found = True
            parameters = replace(parameters, **_values(element, reader))
    if not found:
        meant = next((e for e in elements if nearest_name(e.name, ["Parameters"])), None)
        reader.warn(
            meant or elements[0],
            "no Parameters",
            f"there is no Parameters element{f', but {meant.name},' if meant else ''}",
            "nothing is set",
            advice="did you mean Parameters?" if meant else "give a parameter file",
            instead="Parameters" if meant else None,
        )
    reader.finish()
    findings = tuple(sorted(reader.findings, key=lambda finding: finding.line or 0))
    lines = {
        attribute: element.line_of(attribute)
        for element in elements
        if element.name == "Parameters"
        for attribute in element.attributes
    }
    return ParameterFile(parameters=parameters, source=source, findings=findings, lines=lines)


def _values(element: Element, reader: Reader) -> dict[str, Any]:
    # The defaults passed on here never show: only attributes that the element has are looked up.
    kinds: tuple[tuple[dict[str, str], Callable[[str], Any]], ...] = (
        (_NATURALS, lambda attribute: reader.natural(element, attribute, 0)),
        (_SIGNED, lambda attribute: reader.integer(element, attribute, 0)),
        (_REALS, lambda attribute: _checked_real(element, attribute, reader)),
        (SWITCHES, lambda attribute: reader.switch(element, attribute, False)),
        (FILE_NAMES, lambda attribute: element.attributes[attribute]),
    )
    values: dict[str, Any] = {}
    for attribute in element.attributes:
        for names, read in kinds:
            if attribute in names:
                values[names[attribute]] = read(attribute)
                if attribute == "CycleTime" and element.attributes[attribute].strip() == "0":
                    taken = "lets cycles follow at once, so that robots miss most of them"
                    reader.note(element, "no time", "CycleTime is 0", taken, attribute=attribute)
                break
        else:
            if attribute in _WITHOUT_EFFECT:
                _warn_without_effect(element, attribute, reader)
            elif attribute not in _PASSED_OVER:
                meant = nearest_name(attribute, [name for names, _ in kinds for name in names])
                reader.warn(
                    element,
                    "unknown attribute",
                    f'Parameters {attribute}="{element.attributes[attribute][:40]}" means nothing',
                    "is passed over" + (f", so that {meant} stays {_told(meant, kinds)}" if meant else ""),
                    attribute=attribute,
                    advice=f"did you mean {meant}?" if meant else "",
                    instead=meant,
                )
    return values


def _told(attribute: str, kinds: Sequence[tuple[dict[str, str], Any]]) -> str:
    """Return the default of a parameter, as it is written in files."""
    (field,) = [names[attribute] for names, _ in kinds if attribute in names]
    value = getattr(Parameters(), field)
    if isinstance(value, bool):
        return "On" if value else "Off"
    return "unsaid" if value is None else f"{value:g}"


def _warn_without_effect(element: Element, attribute: str, reader: Reader) -> None:
    value = element.attributes[attribute]
    if value not in ("0", "Off"):  # that is what happens anyway
        advice, instead = _WITHOUT_EFFECT[attribute]
        found = f'{attribute}="{value}" has no effect, as in the real simulator'
        reader.warn(element, "no effect", found, attribute=attribute, advice=advice, instead=instead)


def _checked_real(element: Element, attribute: str, reader: Reader) -> float:
    value = reader.real(element, attribute, 0.0)
    if attribute == "LineSensorTrueProb":
        if not 0.0 <= value <= 1.0:
            reader.refuse(element, attribute, f'{attribute}="{value:g}" is not a probability: write 0 to 1')
            return 0.0
    elif attribute.endswith("Noise") and value < 0.0:
        reader.refuse(element, attribute, f'{attribute}="{value:g}" is below 0: write a standard deviation')
        return 0.0
    return value
