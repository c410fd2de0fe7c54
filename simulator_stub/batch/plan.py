"""Constants of a batch: the labs, the sensors, and the tables computed from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ciberrato.arrays import Floats
from ciberrato.infrared.face_tables import LabTables, tables_of
from ciberrato.physics.kinematics import ROBOT_RADIUS
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid
from simulator_stub.sensors.line import SIDEWAYS
from simulator_stub.world.world import World

SENSORS = 4
_SHARED = (
    *("gps", "beacon_sensor", "obstacle_latency", "compass_latency", "ground_latency"),
    *("collision_latency", "beacon_latency"),
)
"""Parameters that are the same in all worlds of a batch: they say which arrays there are."""


@dataclass(frozen=True, slots=True, eq=False)
class LabPlan:
    """One lab of a batch, in the units that the loops need.

    Attributes
    ----------
    world : World
        Without start grid; its parameters are not looked at.
    tables : LabTables
    targets : array, shape (targets, 3)
        x, y, and how far the centre of a robot may be from it; units.
    """

    world: World
    tables: LabTables
    targets: Floats

    @classmethod
    def build(cls, lab: Lab) -> LabPlan:
        """Build the derived values."""
        world = World.build(lab, StartGrid(), Parameters())
        targets = [(target.x, target.y, target.radius - ROBOT_RADIUS) for target in lab.targets]
        return cls(world, tables_of(world.walls), np.array(targets).reshape(-1, 3))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BatchPlan:
    """Labs and sensors of a batch.

    Attributes
    ----------
    labs : tuple of LabPlan
        Those that worlds may be in, each once.
    worlds : int
    angles : array, shape (4,)
        Mounting angles of the IR sensors in radians.
    line_sensor : bool
        Whether the robots have line sensors.
    shared : Parameters
        Those of the first world: which sensors there are, and how late their readings come.
    beacons : int
        Most beacons of a lab, if there are sensors for them; else 0.
    """

    labs: tuple[LabPlan, ...]
    worlds: int
    angles: Floats
    line_sensor: bool
    shared: Parameters
    beacons: int
    _numbers: dict[Lab, int] = field(default_factory=dict)

    @classmethod
    def build(
        cls,
        labs: Sequence[Lab],
        shared: Parameters,
        *,
        worlds: int,
        angles: Floats,
        line_sensor: bool,
    ) -> BatchPlan:
        """Build the derived values; a lab may be named any number of times."""
        distinct = list(dict.fromkeys(labs))
        return cls(
            labs=tuple(LabPlan.build(lab) for lab in distinct),
            worlds=worlds,
            angles=angles,
            line_sensor=line_sensor,
            shared=shared,
            beacons=max(len(lab.beacons) for lab in distinct) if shared.beacon_sensor else 0,
            _numbers={lab: number for number, lab in enumerate(distinct)},
        )

    def number_of(self, lab: Lab) -> int:
        """Return the number of a lab.

        Raises
        ------
        ValueError
            The batch does not know it.
        """
        if lab not in self._numbers:
            raise ValueError(f"the batch does not know the lab {lab.name!r}: name it in `labs_to_come`")
        return self._numbers[lab]

    def check(self, parameters: Parameters) -> None:
        """Refuse parameters that need other arrays than those of the first world.

        Raises
        ------
        ValueError
            They do.
        """
        for name in _SHARED:
            wanted, is_there = getattr(parameters, name), getattr(self.shared, name)
            if wanted != is_there:
                raise ValueError(f"{name} must be the same in all worlds of a batch: {wanted}, {is_there}")

    def uses(self) -> list[tuple[str, int, bool]]:
        """List what needs random numbers: its name, how many per cycle, whether they are normal."""
        listed = [("motors", 2, True), ("infrared", SENSORS, True), ("compass", 1, True)]
        if self.shared.gps:
            listed.append(("gps", 2, True))
        if self.beacons:
            listed.append(("beacons", self.beacons, True))
        if self.line_sensor:
            listed.append(("line", len(SIDEWAYS), False))
        return listed
