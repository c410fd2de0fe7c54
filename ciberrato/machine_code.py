"""Whether loops may run in machine code, made by numba (the extra `fast`): an environment variable.

``CIBERRATO_COMPILED`` is ``auto`` (the default: if numba is there), ``on`` or ``off``.
"""

from __future__ import annotations

import importlib.util
import os

from ciberrato.errors import UsageError

CHOICES = ("auto", "on", "off")
VARIABLE = "CIBERRATO_COMPILED"


def choice() -> str:
    """Return the choice of the environment variable.

    Returns
    -------
    {"auto", "on", "off"}

    Raises
    ------
    UsageError
        If it is something else, or machine code is asked for and numba is not there.
    """
    chosen = os.environ.get(VARIABLE) or "auto"
    if chosen not in CHOICES:
        raise UsageError(f"{VARIABLE}: {chosen!r} is not {', '.join(CHOICES)}")
    if chosen == "on" and not available():
        raise UsageError(f"{VARIABLE}=on needs numba: pip install 'ciberrato[fast]'")
    return chosen


def available() -> bool:
    """Return whether numba is installed."""
    return importlib.util.find_spec("numba") is not None
