"""A plugin for pytest: agents in any language, tested in seeded simulators (docs/test-your-agent.md).

Only `ciberrato.testing.plugin` imports pytest; all others are imported when a test uses them.
"""

__all__ = [
    "beside",
    "failures",
    "options",
    "picture",
    "plugin",
    "runs",
    "simulators",
    "truth",
]
