from __future__ import annotations

import pytest

from ciberrato.localization.tables.pose_tables import PoseTables, build_tables
from ciberrato.world.lab import Lab, Wall

ANGLES = (0.0, 60.0, -60.0, 180.0)


def box(x0: float, y0: float, x1: float, y1: float) -> Wall:
    return Wall(height=4.0, corners=((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


@pytest.fixture(scope="session")
def small_lab() -> Lab:
    """Return 8 x 6 units, no symmetry: an upright wall, a block, a short lying wall."""
    return Lab(
        name="small",
        width=8.0,
        height=6.0,
        walls=(box(1.9, 2.0, 2.1, 6.0), box(5.0, 3.4, 6.1, 4.2), box(3.9, 1.9, 6.0, 2.1)),
    )


@pytest.fixture(scope="session")
def coarse_tables(small_lab: Lab) -> PoseTables:
    return build_tables(small_lab, ANGLES, 2.0 / 9.0)


@pytest.fixture(scope="session")
def fine_tables(small_lab: Lab) -> PoseTables:
    return build_tables(small_lab, ANGLES, 0.1)
