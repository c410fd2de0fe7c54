"""Measures that a robot answers, counted in the same manner at any pace."""

from __future__ import annotations


class Attendance:
    """Counts of one robot in the running cycles of a run, until it has finished or was removed.

    The protocol does not say which Measures a message answers: it counts for the newest ones that were sent
    before it came.

    Attributes
    ----------
    answered, unanswered : int
        Cycles with and without a message after their Measures.
    caught_up : int
        Messages too many in a cycle that follows unanswered ones, no more than those: answers that came a
        cycle late, or later.
    last_answer : int or None
        Time of the Measures that were answered last; None before the first answer.
    missed_in_a_row : int
        Cycles since then, or since the start.
    """

    __slots__ = ("answered", "caught_up", "last_answer", "missed_in_a_row", "unanswered")

    def __init__(self) -> None:
        self.answered = self.unanswered = self.caught_up = self.missed_in_a_row = 0
        self.last_answer: int | None = None

    def count(self, time: int, messages: int) -> None:
        """Count a cycle.

        Parameters
        ----------
        time : int
            Time of its Measures, in cycles.
        messages : int
            Number of messages after them, and before the next ones.
        """
        if not messages:
            self.unanswered += 1
            self.missed_in_a_row += 1
            return
        self.answered += 1
        self.caught_up += min(messages - 1, self.missed_in_a_row)
        self.missed_in_a_row = 0
        self.last_answer = time

    def document(self) -> dict[str, int | None]:
        """Return the counts for the result file.

        Returns
        -------
        dict
            ``answered``, ``unanswered``, ``caught_up`` and ``last_answer`` as above; ``silent_since``: time
            of the first Measures that nothing has answered since, None if the last ones were answered.
        """
        silent = None
        if self.missed_in_a_row:
            silent = 0 if self.last_answer is None else self.last_answer + 1
        return {
            "answered": self.answered,
            "unanswered": self.unanswered,
            "caught_up": self.caught_up,
            "last_answer": self.last_answer,
            "silent_since": silent,
        }
