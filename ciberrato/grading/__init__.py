"""Grades a course: every agent in every lab with every seed, in a sandbox, with a report of its own."""

__all__ = [
    "children",
    "cli",
    "comparison",
    "course",
    "expressions",
    "fields",
    "init",
    "launch",
    "leftovers",
    "outcome",
    "recording",
    "report",
    "repositories",
    "runner",
    "sandbox",
    "standing",
    "supervisor",
    "task",
    "workspace",
]
