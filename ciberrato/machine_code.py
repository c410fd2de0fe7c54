"""Whether loops may run in machine code, made by numba (the extra `fast`): an environment variable.

``CIBERRATO_COMPILED`` is ``auto`` (the default: if numba is there), ``on`` or ``off``.
"""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable
from typing import Any

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


def kept(function: Callable[..., object]) -> Any:
    """Return a function that numba compiles at its first call, and whose machine code it keeps on the disk.

    numba numbers the files of a function's machine code, one for each types of arguments. Two processes that
    compile the first ones at the same time, for different types, would write one file, and what the index
    says of it may be wrong: the machine code would be run for other types. So each file gets a name that no
    other has; of two indexes written at the same time one is lost, and what it named is compiled once more.

    Parameters
    ----------
    function : callable
        Written for numba.

    Returns
    -------
    callable
    """
    import uuid

    import numba

    compiled = numba.njit(cache=True, error_model="numpy", nogil=True)(function)
    file = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
    if file is not None:
        beginning = file._index_name.removesuffix(".nbi")
        file._data_name = lambda number: f"{beginning}.{number}.{uuid.uuid4().hex[:12]}.nbc"
    return compiled
