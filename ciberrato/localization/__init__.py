"""The full-pose filter: where a robot is in a CiberRato lab, and where it looks, from any start.

One class does it, `PoseFilter`; everything else here is behind it: the belief on its lattice (`belief`), what
sensors say of it (`evidence`), tables of expected readings (`tables`), particles (`refinement`), the filter
and its parts (`filtering`), the queue in front of it (`live`).
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from ciberrato.localization.belief.estimate import PoseEstimate
    from ciberrato.localization.evidence.start_prior import StartPrior
    from ciberrato.localization.pose_filter import Estimate, PoseFilter
    from ciberrato.localization.records import FilterSettings

_HOMES = {
    "Estimate": "ciberrato.localization.pose_filter",
    "FilterSettings": "ciberrato.localization.records",
    "PoseEstimate": "ciberrato.localization.belief.estimate",
    "PoseFilter": "ciberrato.localization.pose_filter",
    "StartPrior": "ciberrato.localization.evidence.start_prior",
}

__all__ = ["Estimate", "FilterSettings", "PoseEstimate", "PoseFilter", "StartPrior"]


def __getattr__(name: str) -> object:
    """Load a name at its first use (PEP 562): modules inside are imported without the others."""
    from ciberrato.lazy_names import load

    return load(globals(), _HOMES, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
