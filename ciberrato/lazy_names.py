"""Names of a package that are loaded at their first use (PEP 562)."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any


def load(package: dict[str, Any], homes: Mapping[str, str], name: str) -> object:
    """Load a name from its home, and keep it in the package.

    Parameters
    ----------
    package : dict
        The package's ``globals()``.
    homes : mapping of str to str
        Names, and the modules that define them.
    name : str

    Returns
    -------
    object

    Raises
    ------
    AttributeError
        If the package has no such name.
    """
    if name not in homes:
        raise AttributeError(f"module {package['__name__']!r} has no attribute {name!r}")
    package[name] = getattr(importlib.import_module(homes[name]), name)
    return package[name]
