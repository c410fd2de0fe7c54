"""What the program calls itself, and how it prints what others have written."""

from ciberrato.plaintext import plain

PROGRAM = "ciberrato-grade"


def shown(name: str) -> str:
    """Return a name without what a terminal would obey."""
    return plain(name)
