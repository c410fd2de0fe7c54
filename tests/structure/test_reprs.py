"""Whatever is public is shown on one line of less than 200 characters, however large it is."""

import dataclasses
import importlib
import inspect
import pkgutil

import numpy as np
import pytest

import ciberrato
from ciberrato import PoseFilter, Robot, find_lab, read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.world.lab import Beacon, Lab, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

LARGE = (
    np.zeros((300, 300)),
    tuple(("a name that takes some room", 1.0 / 3.0, number) for number in range(1000)),
    {f"key {number}": [number] * 50 for number in range(1000)},
    "a text of several lines\n" * 100,
    [[np.zeros(50)] * 3] * 3,
    None,
)


def modules():
    for found in pkgutil.walk_packages(ciberrato.__path__, "ciberrato."):
        if not {"maps", "assets", "__main__"} & set(found.name.split(".")):
            try:
                yield importlib.import_module(found.name)
            except ImportError:
                assert "compiled" in found.name or "kernels" in found.name  # numba is not installed


def records():
    """Every record of the library: dataclasses and named tuples."""
    return {
        f"{value.__module__}.{name}": value
        for module in modules()
        for name, value in vars(module).items()
        if inspect.isclass(value) and value.__module__ == module.__name__ and not name.startswith("_")
        if dataclasses.is_dataclass(value) or (issubclass(value, tuple) and hasattr(value, "_fields"))
    }


def filled(kind, content):
    """An instance with the same content in all fields, whatever may really be in them."""
    if issubclass(kind, tuple):
        return tuple.__new__(kind, [content] * len(kind._fields))
    made = object.__new__(kind)
    for field in dataclasses.fields(kind):
        object.__setattr__(made, field.name, content)
    return made


def is_short(shown):
    return len(shown) < 200 and "\n" not in shown


@pytest.mark.parametrize("name", sorted(records()))
def test_a_record_is_short_whatever_is_in_it(name):
    kind = records()[name]
    own = ("world.lab.Lab", "start_grid.StartGrid", "parameters.Parameters", "runs.AgentRun", "truth.Truth")
    if name.endswith(own):
        return  # they say what is in them: below
    for content in LARGE:
        assert is_short(repr(filled(kind, content))), repr(filled(kind, content))[:300]


def test_things_as_they_are_used_are_short_and_say_what_they_are():
    lab = read_lab(find_lab("maze"))
    crowded = Lab(
        name="x" * 1000,
        walls=[Wall(corners=((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))] * 5000,
        beacons=[Beacon()] * 9,
    )
    grid = StartGrid(
        positions=[GridPosition(x=1.0 / 3.0, y=number, direction_deg=90.0) for number in range(100)]
    )
    odd = Parameters(
        compass_noise=1.0 / 3.0,
        motors_noise=0.1,
        gps=True,
        lab_file="l" * 500,
        grid_file="g" * 500,
        sim_time=1,
    )
    driven = Robot(simulation=Simulation(lab, grid))
    for one in (
        driven,
        lab,
        crowded,
        grid,
        odd,
        WallMap.from_lab(lab),
        PoseFilter(lab, Parameters()),
        lab.walls[0],
    ):
        assert is_short(repr(one)), repr(one)[:300]
    assert repr(lab).startswith("<Lab ")
    assert "5000 walls, 9 beacons" in repr(crowded)
    assert (
        repr(grid) == "<StartGrid of 100: (0.333333, 0, 90°), (0.333333, 1, 90°), (0.333333, 2, 90°), "
        "(0.333333, 3, 90°), ...>"
    )
    assert repr(Parameters()) == "Parameters()"
    assert repr(Parameters(gps=True)) == "Parameters(gps=True)"
    assert "6 in all" in repr(odd)
