"""Types of options: each function reads one kind of value, or explains the fault."""

from __future__ import annotations

import argparse
import math
from typing import Any

from agent.drives.registry import parse_drive

ANYWHERE = "anywhere"
"""The default of ``--start``."""
_LONGEST_NAME = 200  # the real simulator dies of names much longer


def drive(text: str) -> tuple[str, Any]:
    """Read a driving policy.

    Parameters
    ----------
    text : str

    Returns
    -------
    tuple of str and object
        The policy, and its argument (None if it takes none): the goal of goto, (x, y) in units.
    """
    try:
        return parse_drive(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def start(text: str) -> str:
    """Check what is said of the start.

    Parameters
    ----------
    text : str

    Returns
    -------
    str
        The same; see `ciberrato.localization.evidence.start_prior.parse_start`.
    """
    if text == ANYWHERE:  # the default; reading others takes time that the registration should not wait for
        return text
    from ciberrato.errors import UsageError
    from ciberrato.localization.evidence.start_prior import parse_start

    try:
        parse_start(text)
    except UsageError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return text


def number(text: str) -> float:
    """Read a number; nan if it is none.

    Parameters
    ----------
    text : str

    Returns
    -------
    float
    """
    try:
        return float(text)
    except ValueError:
        return math.nan


def count(text: str) -> int:
    """Read a whole number, 0 or more.

    Parameters
    ----------
    text : str

    Returns
    -------
    int
    """
    if not (text.isascii() and text.isdigit() and len(text) < 19):
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number, 0 or more")
    return int(text)


def precision(text: str) -> int:
    """Read a number of decimals.

    Parameters
    ----------
    text : str

    Returns
    -------
    int
    """
    if not (text.isascii() and text.isdigit() and 2 <= int(text) <= 17):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of decimals from 2 to 17")
    return int(text)


def cruise(text: str) -> float:
    """Read a motor command.

    Parameters
    ----------
    text : str

    Returns
    -------
    float
    """
    value = number(text)
    if not 0.0 < value <= 0.15:
        raise argparse.ArgumentTypeError(f"{text!r} is not a motor command greater than 0, up to 0.15")
    return value


def seconds(text: str) -> float:
    """Read a time.

    Parameters
    ----------
    text : str

    Returns
    -------
    float
    """
    value = number(text)
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of seconds greater than 0")
    return value


def angles(text: str) -> tuple[float, float, float, float]:
    """Read the mounting angles of the four sensors.

    Parameters
    ----------
    text : str

    Returns
    -------
    tuple of four float
        Degrees.
    """
    values = [number(part) for part in text.split(",")]
    if len(values) != 4 or not all(math.isfinite(value) for value in values):
        raise argparse.ArgumentTypeError(f"{text!r} is not four angles in degrees, like 0,90,-90,180")
    return values[0], values[1], values[2], values[3]


def name(text: str) -> str:
    """Read a robot's name.

    Parameters
    ----------
    text : str

    Returns
    -------
    str
    """
    if len(text.encode(errors="replace")) > _LONGEST_NAME or not text.isprintable():
        raise argparse.ArgumentTypeError(f"a name has at most {_LONGEST_NAME} printable characters")
    return text
