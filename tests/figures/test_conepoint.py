"""The point that a figure shows is the one that the sensor's distance belongs to."""

import math

import numpy as np
import pytest

from ciberrato.files.lab import read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import nearest_in_cone, sensor_distances
from ciberrato.labs import find_lab
from ciberrato.plot.conepoint import nearest_point, sensor_point


@pytest.mark.parametrize("lab_name", ["standard", "rooms", "diagonals"])
@pytest.mark.parametrize("every_point", [False, True])
def test_its_distance_is_that_of_the_sensor_model(lab_name, every_point):
    walls = WallMap.from_lab(read_lab(find_lab(lab_name)))
    generator = np.random.default_rng(3)
    poses = generator.uniform((0.6, 0.6, -math.pi), (27.4, 13.4, math.pi), (60, 3))
    model = nearest_in_cone if every_point else sensor_distances
    for (x, y, direction), expected in zip(poses, model(walls, *poses.T), strict=True):
        point = nearest_point(walls, x, y, direction, every_point=every_point)
        assert point is not None
        assert math.dist(point, sensor_point(x, y, direction)) == pytest.approx(expected, abs=1e-6)
