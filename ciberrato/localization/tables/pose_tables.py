"""Tables of the pose filter: the readings of a robot's sensors in every state of a lattice.

The distance that a sensor takes depends on the robot's place and on the sensor's absolute direction only:
with directions in even steps, one table serves all sensors whose mounting angles are multiples of the
step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.sweep import tabulate_distances
from ciberrato.localization.belief import compiled
from ciberrato.localization.belief.lattice import Lattice, build_lattice
from ciberrato.localization.evidence.symmetry import Turn, find_turns
from ciberrato.localization.tables.reading_codes import encode
from ciberrato.reprs import short_repr
from ciberrato.world.lab import Lab

Codes = NDArray[np.uint8]
Progress = Callable[[float], None]

BINS = 72
"""Number of heading bins, 5 degrees each."""

FINE, COARSE = 0.1, 2.0 / 9.0
"""Units between nodes: while the belief is a list of few states; while it is not."""
_LARGEST = 50.0 * 50.0
"""Units squared of a lab with fine tables of all of it. The filter uses them only for a list of states, so a
cycle costs the same in any lab; but they and their room take up to 0.1 MB a square unit that is free. Larger
labs have `ciberrato.localization.tables.tiled`."""


def fine_resolution(lab: Lab) -> float:
    """Return the finest resolution of tables of all of a lab.

    Parameters
    ----------
    lab : Lab

    Returns
    -------
    float
        Units between nodes.
    """
    return FINE if lab.width * lab.height <= _LARGEST else COARSE


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseTables:
    """A lattice and the coded distances on it.

    Attributes
    ----------
    lattice : Lattice
    steps : int
        Directions a bin: 2 means every 2.5 degrees.
    codes : tuple of array of uint8, shape (2 * BINS * steps, squares)
        One table for every fraction of a step that occurs among the sensors, twice around the circle so that
        any run of directions is one slice. See `ciberrato.localization.tables.reading_codes`.
    sensors : tuple of (int, int)
        For each sensor its table and by how many steps its axis is ahead of the robot's heading.
    fractions : tuple of float
        Degrees by which the directions of each table are ahead of multiples of the step.
    whole : PoseTables or None
        Of a part of a lab (`ciberrato.localization.tables.tiled`): tables of all of it, on another lattice,
        whose frequencies and symmetries count. None: these are of all of it.
    """

    __repr__ = short_repr

    lattice: Lattice
    steps: int
    codes: tuple[Codes, ...]
    sensors: tuple[tuple[int, int], ...]
    fractions: tuple[float, ...] = ()
    whole: PoseTables | None = None
    _turns: list[list[Turn]] = field(default_factory=list)
    _shares: list[NDArray[np.float64]] = field(default_factory=list)

    @property
    def everywhere(self) -> PoseTables:
        """Tables of all of the lab: these, if they are."""
        return self.whole or self

    def symmetries(self, lab: Lab) -> list[Turn]:
        """Return the turns under which the lab looks the same; found once."""
        if self.whole is not None:
            return self.whole.symmetries(lab)
        if not self._turns:
            lattice = self.lattice
            walls = WallMap.from_lab(lab)
            self._turns.append(find_turns(lab, walls, lattice.representative, lattice.resolution))
        return self._turns[0]

    @property
    def known_turns(self) -> list[Turn] | None:
        """Symmetries that `symmetries` has found, if it has been called."""
        return self._turns[0] if self._turns else None

    @property
    def angles(self) -> tuple[float, ...]:
        """Mounting angles of the sensors in radians."""
        step = 360.0 / (BINS * self.steps)
        return tuple(math.radians(ahead * step + self.fractions[table]) for table, ahead in self.sensors)

    @property
    def code_shares(self) -> list[NDArray[np.float64]]:
        """Frequencies of the codes in each table; shape (256,) each."""
        if self.whole is not None:
            return self.whole.code_shares
        if not self._shares:
            self._shares.extend(_shares(codes[: len(codes) // 2]) for codes in self.codes)
        return self._shares

    def complete(self, lab: Lab) -> bool:
        """Compute everything that is kept with the tables and would else be computed at its first use.

        Returns
        -------
        bool
            Whether something was missing.
        """
        missing = not self._turns or not self._shares
        self.symmetries(lab)
        assert self.code_shares
        return missing

    def view(self, sensor: int, heading_offset: float) -> Codes:
        """Return the codes of a sensor for all bins, at the nearest direction that is tabulated.

        Parameters
        ----------
        sensor : int
        heading_offset : float
            Radians that the bins are ahead of multiples of 5 degrees.

        Returns
        -------
        array of uint8, shape (BINS, squares)
            A view, not a copy.
        """
        table, ahead = self.sensors[sensor]
        around = BINS * self.steps
        first = (round(heading_offset / (2.0 * math.pi) * around) + ahead) % around
        return self.codes[table][first : first + around : self.steps]


def _shares(codes: Codes) -> NDArray[np.float64]:
    # Row by row: counting turns what it counts into integers eight times as large.
    counts = np.zeros(256, np.int64)
    for row in codes:
        counts += np.bincount(row, minlength=256)
    return counts / codes.size


def sensor_layout(
    angles: Sequence[float], steps: int
) -> tuple[tuple[float, ...], tuple[tuple[int, int], ...]]:
    """Return which tables a set of sensors needs.

    Parameters
    ----------
    angles : sequence of float
        Mounting angles in degrees.
    steps : int
        Directions a bin.

    Returns
    -------
    fractions : tuple of float
        Degrees by which the directions of each table are ahead of multiples of the step.
    sensors : tuple of (int, int)
        As in `PoseTables`.
    """
    step = 360.0 / (BINS * steps)
    fractions: list[float] = []
    sensors = []
    for angle in angles:
        whole = math.floor(angle / step + 1e-6)
        fraction = round(angle - whole * step, 6)
        if fraction not in fractions:
            fractions.append(fraction)
        sensors.append((fractions.index(fraction), whole % (BINS * steps)))
    return tuple(fractions), tuple(sensors)


def build_tables(
    lab: Lab,
    angles: Sequence[float],
    resolution: float,
    *,
    steps: int = 2,
    progress: Progress | None = None,
) -> PoseTables:
    """Compute the tables of a lab.

    Parameters
    ----------
    lab : Lab
    angles : sequence of float
        Mounting angles of the sensors in degrees.
    resolution : float
        Units between the lattice's nodes.
    steps : int
        Directions a bin.
    progress : callable, optional
        Called with the fraction done, from 0 to 1.

    Returns
    -------
    PoseTables
    """
    lattice = build_lattice(lab, resolution)
    walls = WallMap.from_lab(lab)
    fractions, sensors = sensor_layout(angles, steps)
    codes = []
    for number, fraction in enumerate(fractions):

        def part(done: float, number: int = number) -> None:
            if progress is not None:
                progress((number + done) / len(fractions))

        coded = tabulate_distances(
            walls,
            lattice.representative,
            math.radians(fraction),
            BINS * steps,
            convert=encode,
            loops=compiled.kernels(),
            progress=part,
        )
        codes.append(np.concatenate([coded, coded]))
    return PoseTables(lattice=lattice, steps=steps, codes=tuple(codes), sensors=sensors, fractions=fractions)
