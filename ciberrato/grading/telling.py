"""What the program calls itself, and how it prints what others have written."""

PROGRAM = "ciberrato-grade"


def shown(name: str) -> str:
    """Return a name without the control characters of a terminal."""
    return "".join(sign if sign.isprintable() else "?" for sign in name)
