from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ciberrato.files.lab import read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.labs import find_lab
from ciberrato.world.lab import Lab, Wall
from tests.recordings import OWN


@pytest.fixture(scope="session")
def golden() -> Path:
    """Recordings that come with the tests."""
    return OWN


@pytest.fixture(scope="session")
def shipped():
    """WallMap of a lab that ships, by name; each is built once."""
    built: dict[str, WallMap] = {}

    def get(name: str) -> WallMap:
        if name not in built:
            built[name] = WallMap.from_lab(read_lab(find_lab(name)))
        return built[name]

    return get


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20260429)


@pytest.fixture(scope="session")
def clutter() -> Lab:
    """A lab of 12 x 9 with slanted, overlapping and concave walls, one wall beyond the border, and a line."""
    generator = np.random.default_rng(11)
    walls = []
    for _ in range(9):
        corners = int(generator.integers(3, 7))
        angles = np.sort(generator.uniform(0.0, 2 * np.pi, corners))
        radii = generator.uniform(0.2, 1.2, corners)
        centre = generator.uniform((0.0, 0.0), (12.0, 9.0))
        points = centre + radii[:, np.newaxis] * np.column_stack((np.cos(angles), np.sin(angles)))
        walls.append(
            Wall(height=float(generator.uniform(0.5, 5.0)), corners=tuple(map(tuple, points.tolist())))
        )
    walls.append(Wall(height=2.0, corners=((11.0, 4.0), (14.0, 4.0), (14.0, 4.5), (11.0, 4.5))))
    walls.append(Wall(height=0.0, corners=((1.0, 1.0), (11.0, 1.0), (11.0, 8.0), (1.0, 8.0))))
    return Lab(name="clutter", width=12.0, height=9.0, walls=tuple(walls))
