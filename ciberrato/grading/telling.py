"""Name of the program, and the printing of text that others have written."""

from ciberrato.plaintext import plain

PROGRAM = "ciberrato-grade"


def shown(name: str) -> str:
    """Return a name without what a terminal would obey."""
    return plain(name)
