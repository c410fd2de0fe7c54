"""Many runs at once: how soon and how surely the agent localizes itself in many labs.

`read_results` returns the outcomes of a file as a table.
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from ciberrato.evaluation.results import read_results

__all__ = [
    "attempt",
    "cli",
    "cluster",
    "comparison",
    "episode",
    "figures",
    "judged",
    "labs",
    "options",
    "planning",
    "published",
    "read_results",
    "record",
    "replay",
    "report",
    "results",
    "runner",
    "settings",
    "starts",
    "task",
]


def __getattr__(name: str) -> object:
    """Load `read_results` at its first use: the command line sets numpy up before that."""
    if name != "read_results":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from ciberrato.evaluation.results import read_results

    return read_results
