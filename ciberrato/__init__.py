"""CiberRato: labs, the wire protocol, physics and sensors of its world, and localization in it.

The names below are the ones most programs need; each is loaded when it is first used. Everything else is in
the packages: `ciberrato.bayes` (Markov localization for any map), `ciberrato.localization` (the full-pose
filter for CiberRato labs), `ciberrato.protocol` and `ciberrato.net` (messages and links),
`ciberrato.infrared`, `ciberrato.geometry` and `ciberrato.physics` (the model of the robot),
`ciberrato.files` (documents), `ciberrato.viewer` and `ciberrato.evaluation` (applications).

Exceptions
----------
All derive from `CiberratoError`: `UsageError` (a command line or an argument), `LabError` (the contents of a
file), `ProtocolError` (the bytes of a peer).
"""

from __future__ import annotations

from ciberrato.version import __version__

TYPE_CHECKING = False
if TYPE_CHECKING:
    from ciberrato.client import Robot
    from ciberrato.errors import CiberratoError, LabError, ProtocolError, UsageError
    from ciberrato.files.lab import read_lab
    from ciberrato.files.parameters import read_parameters
    from ciberrato.files.start_grid import read_grid
    from ciberrato.labs import find_grid, find_lab, find_parameters
    from ciberrato.localization.pose_filter import PoseFilter
    from ciberrato.world.lab import Lab
    from ciberrato.world.parameters import Parameters
    from ciberrato.world.start_grid import StartGrid

_HOMES = {
    "CiberratoError": "ciberrato.errors",
    "Lab": "ciberrato.world.lab",
    "LabError": "ciberrato.errors",
    "Parameters": "ciberrato.world.parameters",
    "PoseFilter": "ciberrato.localization.pose_filter",
    "ProtocolError": "ciberrato.errors",
    "Robot": "ciberrato.client",
    "StartGrid": "ciberrato.world.start_grid",
    "UsageError": "ciberrato.errors",
    "find_grid": "ciberrato.labs",
    "find_lab": "ciberrato.labs",
    "find_parameters": "ciberrato.labs",
    "read_grid": "ciberrato.files.start_grid",
    "read_lab": "ciberrato.files.lab",
    "read_parameters": "ciberrato.files.parameters",
}

__all__ = [
    "CiberratoError",
    "Lab",
    "LabError",
    "Parameters",
    "PoseFilter",
    "ProtocolError",
    "Robot",
    "StartGrid",
    "UsageError",
    "__version__",
    "find_grid",
    "find_lab",
    "find_parameters",
    "read_grid",
    "read_lab",
    "read_parameters",
]


def __getattr__(name: str) -> object:
    """Load a name at its first use (PEP 562)."""
    from ciberrato.lazy_names import load

    return load(globals(), _HOMES, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
