"""Many runs at once: how soon and how surely the agent localizes itself in many labs."""

__all__ = [
    "attempt",
    "cli",
    "cluster",
    "comparison",
    "episode",
    "figures",
    "labs",
    "published",
    "record",
    "replay",
    "report",
    "runner",
    "starts",
    "task",
]
