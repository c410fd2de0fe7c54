"""Parameters that a sweep sets, on top of those of a file."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

from ciberrato.errors import LabError, UsageError
from ciberrato.files.parameters import parse_parameter_file
from ciberrato.world.parameters import Parameters


def with_settings(parameters: Parameters, settings: str) -> Parameters:
    """Return parameters with some set to other values: ``NAME=VALUE``, with commas between, as in a file.

    Raises
    ------
    UsageError
        If a name is unknown, or a value is read as something else.
    """
    if not settings:
        return parameters
    pairs = [setting.partition("=") for setting in settings.split(",")]
    attributes = " ".join(f"{name}={quoteattr(value)}" for name, _, value in pairs)
    try:
        file = parse_parameter_file(f"<Parameters {attributes}/>".encode(), f"--set {settings}", parameters)
    except LabError as error:
        raise UsageError(f"--set {settings}: {error.problem}") from None
    if file.findings:
        raise UsageError(f"--set {settings}: {file.findings[0].text}")
    return file.parameters


def sweep(sets: Sequence[str]) -> list[str]:
    """Combine the values of ``--set NAME=VALUE,VALUE...``: every one of each with every one of the others.

    Parameters
    ----------
    sets : sequence of str

    Returns
    -------
    list of str
        For `with_settings`; one that sets nothing if nothing is to be set.

    Raises
    ------
    UsageError
        If one is not of this form, or sets what another one sets; and as `with_settings`.
    """
    axes = []
    for text in sets:
        name, equals, values = text.partition("=")
        if not (name.isidentifier() and equals and values and all(values.split(","))):
            raise UsageError(f"argument --set: {text!r} is not NAME=VALUE,VALUE..., like MotorsNoise=0,1.5,5")
        axes.append([f"{name}={value}" for value in dict.fromkeys(values.split(","))])
    names = [axis[0].partition("=")[0] for axis in axes]
    if len(set(names)) < len(names):
        raise UsageError("argument --set: a parameter is set twice; write all its values behind one =")
    combined = [",".join(settings) for settings in itertools.product(*axes)]
    for settings in combined:
        with_settings(Parameters(), settings)
    return combined
