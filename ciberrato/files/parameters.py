"""Parameter files: XML to `Parameters`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from ciberrato.files.xml import Element, Reader, parse_elements, read_file
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
    "RequestsPerCycle": "write NRequestsPerCycle",
    "CollisionLatency": "write collisionLatency, the only spelling that the real simulator reads",
    "GPSRequestable": "the GPS cannot be requested",
    "GPSLatency": "the GPS has no latency",
}
_PASSED_OVER = {"NBeacons", "ShowActions"}
"""Stand in many files and mean nothing: the simulator announces its own values."""


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
    return parse_parameters(read_file(path), str(path), defaults)


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
    elements = parse_elements(data, source, "a parameter")
    reader = Reader(source)
    parameters = Parameters() if defaults is None else defaults
    found = False
    for element in elements:
        if element.name == "Parameters":
            found = True
            parameters = replace(parameters, **_values(element, reader))
    if not found:
        reader.warn(elements[0], "there is no Parameters element, so nothing is set; give a parameter file")
    return parameters, tuple(reader.warnings)


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
                break
        else:
            if attribute in _WITHOUT_EFFECT:
                _warn_without_effect(element, attribute, reader)
            elif attribute not in _PASSED_OVER:
                reader.warn(element, f"there is no parameter {attribute}; it is passed over")
    return values


def _warn_without_effect(element: Element, attribute: str, reader: Reader) -> None:
    value = element.attributes[attribute]
    if value not in ("0", "Off"):  # that is what happens anyway
        advice = _WITHOUT_EFFECT[attribute]
        reader.warn(element, f'{attribute}="{value}" has no effect, as in the real simulator: {advice}')


def _checked_real(element: Element, attribute: str, reader: Reader) -> float:
    value = reader.real(element, attribute, 0.0)
    if attribute == "LineSensorTrueProb":
        if not 0.0 <= value <= 1.0:
            raise reader.error(element, f'{attribute}="{value:g}" is not a probability: write 0 to 1')
    elif attribute.endswith("Noise") and value < 0.0:
        raise reader.error(element, f'{attribute}="{value:g}" is below 0: write a standard deviation')
    return value
