"""Maps drawn with characters: what the mapping and planning references have in common."""

from __future__ import annotations

BLANK = " "
START = "I"


class TextMap:
    """A rectangle of characters with a place in its middle that offsets count from.

    Parameters
    ----------
    columns, rows : int
        Odd numbers. What is drawn outside is left out.
    """

    def __init__(self, columns: int, rows: int) -> None:
        self._centre = (columns // 2, rows // 2)
        self._lines = [[BLANK] * columns for _ in range(rows)]

    def draw(self, dx: int, dy: int, character: str) -> None:
        """Draw a character at an offset from the middle; y goes up."""
        column, row = self._centre[0] + dx, self._centre[1] - dy
        if 0 <= row < len(self._lines) and 0 <= column < len(self._lines[row]):
            self._lines[row][column] = character

    def __str__(self) -> str:
        return "".join("".join(line) + "\n" for line in self._lines)
