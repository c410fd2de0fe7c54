"""Puts an agent through what a network and a simulator can do to it, and reports where it fails."""

__all__ = [
    "check",
    "cli",
    "desk",
    "examiner",
    "report",
    "rows",
    "scripts",
]
