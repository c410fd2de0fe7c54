"""How much memory a process has held."""

from __future__ import annotations

from pathlib import Path


def memory_megabytes() -> float:
    """Return the most memory that this process has held so far.

    Returns
    -------
    float
        Megabytes; 0 where the system does not say.
    """
    try:
        # Not `resource`: what a process held before it became this program would count.
        lines = Path("/proc/self/status").read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return 0.0
    peak = next((line for line in lines if line.startswith("VmHWM:")), "VmHWM: 0 kB")
    return float(peak.split()[1]) / 1024.0
