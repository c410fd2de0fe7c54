"""A way of scoring by its number, by its class, or by the name under which others have installed one."""

from __future__ import annotations

from collections.abc import Mapping

from ciberrato.plugins import guarded, load_part
from simulator_stub.scoring.base import Scoring

GROUP = "ciberrato.scoring"
_CALLED = ("__init__", "begin", "update", "may_return")


def find_scoring(scoring: int | str | type[Scoring], modes: Mapping[int, type[Scoring]]) -> type[Scoring]:
    """Find a way of scoring.

    Parameters
    ----------
    scoring : int, str or type
        Number of a mode, name of an entry point, ``module:Class``, or the class itself.
    modes : mapping of int to type
        Those with a number.

    Returns
    -------
    type
        Of one that is named, what its methods raise is a `UsageError` of one line.

    Raises
    ------
    UsageError
        If the one that is named cannot be loaded; see `ciberrato.plugins.load_part`.
    ValueError
        If it is neither.
    """
    if isinstance(scoring, str):
        label, kind = load_part(
            GROUP, scoring, fits=_is_scoring, wanted="a class derived from simulator_stub.scoring.Scoring"
        )
        return guarded(kind, label, _CALLED)
    if _is_scoring(scoring):
        return scoring  # type: ignore[return-value]
    if isinstance(scoring, int) and not isinstance(scoring, bool) and scoring in modes:
        return modes[scoring]
    numbers = ", ".join(str(number) for number in sorted(modes))
    raise ValueError(f"scoring: {scoring!r:.60} is not a mode ({numbers}), nor a class derived from Scoring")


def _is_scoring(value: object) -> bool:
    return isinstance(value, type) and issubclass(value, Scoring) and value is not Scoring
