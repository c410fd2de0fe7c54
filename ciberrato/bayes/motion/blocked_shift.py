r"""Moving from cell to cell of a grid, where walls may be in the way.

.. math:: p(x' | n, x) = \sum_k p(k | n)\, [\,x' = \text{the cell } k \text{ steps from } x]

A step is possible where the two cells have an opening between them. Where they have none the mass stays (the
robot stands at the wall) or is lost (the step is known to have been made, so it was not made from there).
This is grid localization (Probabilistic Robotics, table 8.1) with a map-dependent motion model (section 5.5).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import BoolArray, FloatArray
from ciberrato.bayes.motion.inputs import check_belief, whole_number
from ciberrato.reprs import short_repr

Direction = Literal["east", "west", "north", "south"]
BlockedPolicy = Literal["stay", "lose"]

_ALL = slice(None)
# By array axis: all cells but the first, all but the last, the first, the last.
_SLICES = (
    ((slice(1, None), _ALL), (slice(None, -1), _ALL), (slice(0, 1), _ALL), (slice(-1, None), _ALL)),
    ((_ALL, slice(1, None)), (_ALL, slice(None, -1)), (_ALL, slice(0, 1)), (_ALL, slice(-1, None))),
)
# (array axis, step along it); row 0 is the southernmost.
_STEPS: dict[str, tuple[int, int]] = {"east": (1, 1), "west": (1, -1), "north": (0, 1), "south": (0, -1)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Openings:
    """Openings of a grid of rooms: no wall between neighbours.

    Attributes
    ----------
    east : BoolArray, shape (rows, columns - 1) or (rows, columns)
        [r, c]: open between (r, c) and (r, c + 1). The longer form has the way from the last column round to
        the first.
    north : BoolArray, shape (rows - 1, columns) or (rows, columns)
        [r, c]: open between (r, c) and (r + 1, c), row 0 being the southernmost. The longer form goes round.
    """

    __repr__ = short_repr

    east: BoolArray
    north: BoolArray
    _ahead: dict[Direction, BoolArray] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("east", "north"):
            # A private read-only copy: the object is frozen, so its arrays are.
            values = np.array(getattr(self, name), dtype=bool)
            if values.ndim != 2:
                raise ValueError(f"{name} openings need two dimensions, not {values.ndim}")
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        rows, columns = self.shape
        if self.east.shape[1] not in (columns - 1, columns) or self.north.shape[0] not in (rows - 1, rows):
            raise ValueError(f"east openings {self.east.shape} do not fit north openings {self.north.shape}")
        ahead = {direction: self._look(direction) for direction in get_args(Direction)}
        for values in ahead.values():
            values.setflags(write=False)
        object.__setattr__(self, "_ahead", ahead)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the grid."""
        return int(self.east.shape[0]), int(self.north.shape[1])

    @classmethod
    def free(cls, rows: int, columns: int, *, periodic: bool = False) -> Openings:
        """Create a grid without inner walls, with an outer wall or, where `periodic`, none at all."""
        return cls(
            east=np.ones((rows, columns if periodic else columns - 1), dtype=bool),
            north=np.ones((rows if periodic else rows - 1, columns), dtype=bool),
        )

    def ahead(self, direction: Direction) -> BoolArray:
        """Return where a step in a direction is possible, shape (rows, columns), read-only."""
        return self._ahead[direction]

    def _look(self, direction: Direction) -> BoolArray:
        axis, step = _STEPS[direction]
        gaps = self.east if axis == 1 else self.north
        size = self.shape[axis]
        if gaps.shape[axis] == size - 1:
            last = [(0, 0), (0, 0)]
            last[axis] = (0, 1)
            gaps = np.pad(gaps, last)
        # Going back is possible from the cell after the gap.
        return gaps if step > 0 else np.roll(gaps, 1, axis=axis)


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockedShift:
    """Whole steps on a grid with walls.

    Attributes
    ----------
    openings : Openings
        Openings through which steps are possible.
    blocked : {"stay", "lose"}
        Treatment of mass that a wall stops.
    arrival : mapping of int to float
        Of a commanded n steps, the probability that n + key are made (0 if that is below 0): {0: 1.0} is
        exact, {-1: 0.1, 0: 0.8, 1: 0.1} slips and overshoots. Must sum to 1.
    """

    __repr__ = short_repr

    openings: Openings
    blocked: BlockedPolicy = "stay"
    arrival: Mapping[int, float] = field(default_factory=lambda: {0: 1.0})

    def __post_init__(self) -> None:
        if self.blocked not in ("stay", "lose"):
            raise ValueError(f"blocked mass can stay or be lost, not {self.blocked!r}")
        slips = {whole_number(k, "a slip"): p for k, p in self.arrival.items()}
        object.__setattr__(self, "arrival", slips)
        if not all(p >= 0.0 for p in slips.values()) or not abs(sum(slips.values()) - 1.0) <= 1e-9:
            raise ValueError(f"arrival probabilities must be 0 or more and sum to 1: {dict(self.arrival)}")

    def predict(self, belief: ArrayLike, control: Sequence[Any] | Direction) -> FloatArray:
        """Move a belief.

        Parameters
        ----------
        belief : array_like, shape (rows, columns)
            Row 0 is the southernmost.
        control : (direction, steps) or direction
            "east", "west", "north" or "south" and the number of steps commanded, 0 or more; 1 if left out.

        Returns
        -------
        FloatArray, shape (rows, columns)
            Its sum is smaller than the belief's where mass was lost.

        Raises
        ------
        ValueError
            If the shape, the direction or the number of steps is wrong.
        """
        command = (control, 1) if isinstance(control, str) else tuple(control)
        if len(command) != 2:
            raise ValueError(f"a command is a direction, or a direction and steps, not {control!r}")
        direction, steps = command[0], whole_number(command[1], "a number of steps")
        belief = check_belief(belief)
        if belief.shape != self.openings.shape:
            raise ValueError(f"belief has shape {belief.shape}, the grid {self.openings.shape}")
        if direction not in _STEPS:
            raise ValueError(f"unknown direction {direction!r}; choose one of {', '.join(_STEPS)}")
        if steps < 0:
            raise ValueError(f"a number of steps is 0 or more, not {steps}")
        size = self.openings.east.shape[0] if _STEPS[direction][0] == 0 else self.openings.north.shape[1]
        chance: dict[int, float] = {}
        for slip, probability in self.arrival.items():
            made = max(0, steps + slip)
            # After as many steps as there are cells what is stopped has stopped, and the rest goes round.
            if made > size:
                made = size + (made - size) % size
            chance[made] = chance.get(made, 0.0) + probability
        result = np.zeros_like(belief)
        moving = belief
        for made in range(max(chance) + 1):
            if made:
                moving = self._step(moving, direction)
            if made in chance:
                result += chance[made] * moving
        return result

    def _step(self, belief: FloatArray, direction: Direction) -> FloatArray:
        axis, step = _STEPS[direction]
        going = belief * self.openings.ahead(direction)
        result = belief - going if self.blocked == "stay" else np.zeros_like(belief)
        front, back, first, last = _SLICES[axis]
        if step > 0:
            result[front] += going[back]
            result[first] += going[last]  # round about; nothing where the outer wall is closed
        else:
            result[back] += going[front]
            result[last] += going[first]
        return np.asarray(result)
