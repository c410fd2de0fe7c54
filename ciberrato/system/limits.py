"""Limits of a process: file descriptors, memory, sizes of files."""

from __future__ import annotations

import math
import sys
from typing import Any


def _resource() -> Any:
    """Return the module that tells and sets limits; None on Windows, which has others of its own."""
    try:
        import resource
    except ImportError:
        return None
    return resource


def descriptors() -> int:
    """Return how many file descriptors this process may have; `sys.maxsize` if the system does not say."""
    resource = _resource()
    if resource is None:
        return sys.maxsize
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return sys.maxsize if soft == resource.RLIM_INFINITY else int(soft)


def allow_descriptors(least: int) -> int:
    """Ask for at least so many file descriptors if this process may have fewer.

    Returns
    -------
    int
        Number that it may have now.
    """
    resource = _resource()
    if resource is not None and descriptors() < least:
        _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        enough = least if hard == resource.RLIM_INFINITY else min(hard, least)
        resource.setrlimit(resource.RLIMIT_NOFILE, (enough, hard))
    return descriptors()


def allowed_memory() -> float:
    """Return the address space that a process may have, in MB of 2 ** 20 bytes; infinity without limit."""
    resource = _resource()
    if resource is None:
        return math.inf
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return math.inf if limit == resource.RLIM_INFINITY else float(limit / 2**20)


def file_size_limiter(size: int) -> dict[str, Any]:
    """Return the options of `subprocess.Popen` that hold files which a child writes to a size in bytes."""
    resource = _resource()
    if resource is None:
        return {}
    return {"preexec_fn": lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))}
