"""One line of the conformance table."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Finding:
    """Result of one check.

    Attributes
    ----------
    check : str
        ``room: what``.
    cases : int
        Number of things compared; 0 where there was nothing to compare.
    difference : float or None
        The greatest difference, in the unit of what is compared; None where it makes no sense.
    passed : bool
    note : str
        Meaning of the numbers, the exceptions and their reasons, or the place of the first fault.
    """

    check: str
    cases: int
    difference: float | None
    passed: bool
    note: str
