"""One line of the conformance table."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Finding:
    """What one check found.

    Attributes
    ----------
    check : str
        ``room: what``.
    cases : int
        How many things were compared; 0 where there was nothing to compare.
    difference : float or None
        The greatest difference, in the unit of what is compared; None where it makes no sense.
    passed : bool
    note : str
        What the numbers mean, which exceptions there are and why, or where the first fault is.
    """

    check: str
    cases: int
    difference: float | None
    passed: bool
    note: str
