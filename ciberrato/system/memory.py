"""Memory that a process has held."""

from __future__ import annotations

import sys
from pathlib import Path


def memory_megabytes() -> float:
    """Return the most memory that this process has held so far.

    Returns
    -------
    float
        Megabytes; 0 where the system does not say.
    """
    try:
        # Not `resource`: what a process held before it became this program would count on Linux.
        lines = Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return _by_resource()
    peak = next((line for line in lines if line.startswith("VmHWM:")), "VmHWM: 0 kB")
    return float(peak.split()[1]) / 1024.0


def _by_resource() -> float:
    """Return the peak of getrusage(2), which macOS reports in bytes and others in KiB."""
    try:
        import resource
    except ImportError:
        return 0.0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10
