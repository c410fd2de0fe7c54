"""The date of a log: now, or one that makes two runs with one seed the same bytes."""

from __future__ import annotations

import os
import time

from ciberrato.errors import UsageError

_FIRST = 946_684_800
"""1 January 2000, 00:00 UTC, in seconds since 1970: the date of seed 0."""

_SPAN = 1_000_000_000
_MOST = 253_402_300_799
"""The last second of the year 9999, the last that has four digits."""


def log_date(seed: int | None) -> str:
    """Choose the date that a log is to have.

    Parameters
    ----------
    seed : int or None
        The date follows from it; None = now, by the system's clock.

    Returns
    -------
    str
        As ``Sun Nov 22 00:44:29 2026``. If the environment variable SOURCE_DATE_EPOCH is set it is that date
        in UTC, seed or not (https://reproducible-builds.org/specs/source-date-epoch/).

    Raises
    ------
    UsageError
        If SOURCE_DATE_EPOCH is no number of seconds since 1970.
    """
    text = os.environ.get("SOURCE_DATE_EPOCH", "")
    if text:
        if not (text.isascii() and text.isdigit() and len(text) < 20 and int(text) <= _MOST):
            raise UsageError(
                f"SOURCE_DATE_EPOCH={text}: not a number of seconds since 1970; set one, or unset it"
            )
        return time.asctime(time.gmtime(int(text)))
    if seed is not None:
        return time.asctime(time.gmtime(_FIRST + seed % _SPAN))
    return time.ctime()
