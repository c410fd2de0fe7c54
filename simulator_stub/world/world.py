"""The world that robots are put into: what does not change while they drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial

from ciberrato.errors import UsageError
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import distances_at
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid
from simulator_stub.world.floor import Floor

Distances = Callable[[float, float, Sequence[float]], list[float]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class World:
    """A lab, its start grid and the rules; shared by all copies of a simulation.

    Attributes
    ----------
    lab : Lab
    grid : StartGrid
    parameters : Parameters
    walls : WallMap
        The obstacles of the lab, border included.
    floor : Floor
        Floor as line sensors see it.
    distances : callable
        Function of x, y and the axes of IR sensors in radians: the distances that they measure.
    compiled : bool
        Whether what can be is computed in machine code.
    """

    lab: Lab
    grid: StartGrid
    parameters: Parameters
    walls: WallMap
    floor: Floor
    distances: Distances
    compiled: bool = False
    _hiding: dict[float, WallMap] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def build(
        cls, lab: Lab, grid: StartGrid, parameters: Parameters | None, *, compiled: bool = False
    ) -> World:
        """Build the world from its parts and index the walls; TypeError names an argument of a wrong type."""
        parameters = Parameters() if parameters is None else parameters
        for name, value, kind in (
            ("lab", lab, Lab),
            ("grid", grid, StartGrid),
            ("parameters", parameters, Parameters),
        ):
            if not isinstance(value, kind):
                raise TypeError(f"{name}: {value!r:.60} is not a {kind.__name__}")
        if not isinstance(compiled, bool):
            raise TypeError(f"compiled: {compiled!r:.60} is neither True nor False")
        walls, floor = _index(lab)
        distances: Distances = partial(distances_at, walls)
        if compiled:
            try:
                from ciberrato.infrared.cone_compiled import compiled_distances
            except ImportError:
                raise UsageError("compiled=True needs numba: pip install 'ciberrato[fast]'") from None
            distances = compiled_distances(walls)
        return cls(
            lab=lab,
            grid=grid,
            parameters=parameters,
            walls=walls,
            floor=floor,
            distances=distances,
            compiled=compiled,
        )

    def walls_hiding(self, height: float) -> WallMap:
        """Return the walls that hide a beacon of some height: those at least as high, border included."""
        if height not in self._hiding:
            self._hiding[height] = WallMap.from_lab(self.lab, at_least=height)
        return self._hiding[height]

    def __deepcopy__(self, memo: dict[int, object]) -> World:
        return self


@lru_cache(maxsize=16)
def _index(lab: Lab) -> tuple[WallMap, Floor]:
    """Index the walls of a lab, once for all worlds in it: what the index finds out is kept as it is used."""
    return WallMap.from_lab(lab), Floor(lab)
