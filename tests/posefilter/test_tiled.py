"""Fine tables tile by tile: equal to those of all of the lab, bounded, and rationed."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from ciberrato.localization.filtering import stage
from ciberrato.localization.filtering.staged_filter import staged_filter
from ciberrato.localization.pose_filter import PoseFilter
from ciberrato.localization.tables import pose_tables
from ciberrato.localization.tables.pose_tables import COARSE, FINE, PoseTables, build_tables
from ciberrato.localization.tables.tiled import TiledTables
from ciberrato.world.lab import Beacon, Lab, Target, Wall
from ciberrato.world.parameters import Parameters
from tests.posefilter.conftest import ANGLES, box
from tests.posefilter.test_filter import Run

DEFAULT = Parameters(sim_time=0)
_LAB = Lab(
    name="long",
    width=20.0,
    height=6.0,
    walls=(
        box(1.9, 2.0, 2.1, 6.0),
        box(5.0, 3.4, 6.1, 4.2),
        box(8.0, 0.0, 8.2, 3.5),
        Wall(height=4.0, corners=((10.0, 3.0), (13.0, 4.5), (11.5, 5.0))),
        box(14.0, 1.5, 17.0, 1.7),
        box(16.0, 3.5, 16.3, 6.0),
    ),
    targets=(Target(x=18.5, y=4.5, radius=1.5),),
    beacons=(Beacon(x=18.5, y=4.5, height=5.0),),
)


@pytest.fixture(scope="module")
def coarse() -> PoseTables:
    return build_tables(_LAB, ANGLES, COARSE)


@pytest.fixture(scope="module")
def fine(coarse: PoseTables) -> PoseTables:
    """Return fine tables of all of the lab, with frequencies of codes from the coarse ones, as for tiles."""
    return dataclasses.replace(build_tables(_LAB, ANGLES, FINE), whole=coarse)


def every_tile(tiled: TiledTables, tables: PoseTables) -> frozenset[int]:
    belief = staged_filter(_LAB, tables, None, DEFAULT).belief
    belief.set_states(*np.divmod(np.arange(belief.lattice.size), belief.lattice.size))
    found = tiled.around(belief, 1.0)
    assert found is not None
    return found


def test_tiles_joined_are_the_tables_of_all_of_the_lab(coarse, fine):
    tiled = TiledTables(_LAB, coarse)
    tiles = every_tile(tiled, coarse)
    assert tiled.fetch(tiles, 1000)
    part = tiled.part(tiles)
    for name in ("x", "y", "representative", "clearance", "cell"):
        assert np.array_equal(getattr(part.lattice, name), getattr(fine.lattice, name))
    assert all(np.array_equal(*pair) for pair in zip(part.codes, fine.codes, strict=True))
    assert np.array_equal(part.lattice.move_table(2), fine.lattice.move_table(2))


def test_directions_between_the_steps_have_tables_of_their_own(small_lab):
    angles = (0.0, 61.0, -61.0, 180.0)
    tables = [build_tables(small_lab, angles, resolution) for resolution in (COARSE, FINE)]
    tiled = TiledTables(small_lab, tables[0])
    belief = staged_filter(small_lab, tables[0], None, DEFAULT).belief
    belief.set_states(*np.divmod(np.arange(belief.lattice.size), belief.lattice.size))
    tiles = tiled.around(belief, 1.0)
    assert tiles is not None
    assert tiled.fetch(tiles, 1000)
    assert len(tables[1].codes) == 3
    for joined, whole in zip(tiled.part(tiles).codes, tables[1].codes, strict=True):
        assert np.array_equal(joined, whole)


def states(pose_filter):
    belief = pose_filter.belief
    bins, squares, weights = belief.listed()
    return [bins, *belief.places(bins, squares), weights, belief.offset, belief.heading_offset]


@pytest.mark.parametrize(
    ("seed", "changes"),
    [
        (1, {}),
        (2, {"compass_sensor": False, "obstacle_noise": 0.4, "motors_noise": 5.0}),
        (3, {"gps": True, "beacon_sensor": True, "compass_latency": 3}),
    ],
)
def test_a_run_on_tiles_is_that_on_all_tables_to_the_last_bit(coarse, fine, seed, changes, monkeypatch):
    monkeypatch.setattr(stage, "TILES_A_MESSAGE", 1000)
    # The number of free fine squares is known of all tables only; it is used with a GPS.
    monkeypatch.setattr(type(fine.lattice), "everywhere", property(lambda lattice: fine.lattice.size))
    parameters = dataclasses.replace(DEFAULT, **changes)
    tiled = TiledTables(_LAB, coarse)
    here, there = (staged_filter(_LAB, coarse, tables, parameters) for tables in (fine, tiled))
    run = Run(_LAB, here, (3.0, 4.2, 77.0), parameters, seed)
    parts, on_fine = set(), 0
    for cycle in range(240):
        if cycle == 150:
            run.simulation.place(run.robot, 18.0, 2.6, 1.0)  # kidnapped
        if cycle % 50 in (20, 21, 22, 23, 24):  # messages that never come
            pose = run.simulation.poses()[0]
            left, right = run.command
            actions = {run.robot: stage_actions(left, right)}
            run.measures = run.simulation.step(actions)[run.robot]
            continue
        measures, command = run.measures, run.command
        pose = run.step()
        there.observe(measures, command)
        assert here.is_fine == there.is_fine
        on_fine += here.is_fine
        for one, other in zip(states(here), states(there), strict=True):
            assert np.array_equal(one, other)
        assert here.estimate() == there.estimate()
        assert here.restarts == there.restarts
        parts.add(there.fine._part)
    assert on_fine > 100
    assert math.isfinite(pose[0])
    assert len(parts) > 2


def stage_actions(left, right):
    from ciberrato.protocol import Actions

    return Actions(left_motor=left, right_motor=right)


def test_tiles_are_bounded_and_those_used_last_are_kept(coarse):
    tiled = TiledTables(_LAB, coarse, most=4, kept=6)
    for first in range(0, 30, 3):
        wanted = frozenset(range(first, first + 3))
        assert tiled.fetch(wanted, 3)
        assert tiled.missing(wanted) == 0
        assert len(tiled._tiles) <= 6
    assert tiled.missing(range(24, 30)) == 0
    assert tiled.fetch(frozenset({24}), 0)
    assert tiled.fetch(frozenset({3, 4}), 2)
    assert tiled.missing([24, 27, 28, 29, 3, 4]) == 0  # 25 and 26 had not been used for longest
    assert tiled.missing([25, 26]) == 2
    assert 0.0 < tiled.megabytes < 1.0


def test_a_message_computes_a_few_tiles_at_most_and_the_fine_stage_waits_for_them(coarse):
    tiled = TiledTables(_LAB, coarse)
    pose_filter = staged_filter(_LAB, coarse, tiled, DEFAULT)
    run = Run(_LAB, pose_filter, (18.0, 3.0, 90.0), DEFAULT, 5)
    computed, waited = 0, 0
    for _ in range(120):
        run.step()
        assert tiled.computed - computed <= stage.TILES_A_MESSAGE
        waited += not pose_filter.is_fine and tiled.computed > 0
        computed = tiled.computed
    assert pose_filter.is_fine
    assert waited > 0
    place, _ = run.errors(run.simulation.poses()[0])
    assert place < 0.5


def test_a_belief_in_too_many_places_stays_on_the_coarse_lattice_and_goes_back_to_it(coarse):
    tiled = TiledTables(_LAB, coarse, most=6)
    pose_filter = staged_filter(_LAB, coarse, tiled, DEFAULT)
    run = Run(_LAB, pose_filter, (18.0, 3.0, 90.0), DEFAULT, 5)
    for _ in range(150):
        run.step()
        assert len(tiled._tiles) <= max(6, tiled._kept)
    assert pose_filter.is_fine
    before = pose_filter.estimate()
    belief = pose_filter.belief
    # A hundredth of the belief in every other place of the part.
    far = np.arange(0, belief.lattice.size, 7)
    belief.bin = np.concatenate([belief.bin, np.zeros(len(far), np.int64)])
    belief.square = np.concatenate([belief.square, far])
    extra = np.full(len(far), 0.01 / len(far), np.float32)
    belief.weight = np.concatenate([belief.weight * np.float32(0.99), extra])
    run.step()
    after = pose_filter.estimate()
    assert not pose_filter.is_fine
    assert math.hypot(before.x - after.x, before.y - after.y) < 0.4
    for _ in range(60):
        run.step()
    assert pose_filter.is_fine


def test_the_filter_of_a_large_lab_has_tiles(small_lab, coarse_tables, monkeypatch, tmp_path):
    monkeypatch.setattr(pose_tables, "_LARGEST", 40.0)
    monkeypatch.setenv("CIBERRATO_CACHE", str(tmp_path))
    runs = []
    for _ in range(2):
        with PoseFilter(small_lab, DEFAULT, ANGLES, wait=True) as localizer:
            grid = staged_filter(small_lab, coarse_tables, None, DEFAULT)
            run = Run(small_lab, grid, (1.0, 4.2, 77.0))
            found = []
            for _ in range(60):
                measures, command = run.measures, run.command
                run.step()
                found.append(localizer.observe(measures, command))
            filter_of_tiles = localizer.live.filter
            assert filter_of_tiles is not None
            assert isinstance(filter_of_tiles.fine.tables, TiledTables)
            assert filter_of_tiles.is_fine
            assert filter_of_tiles.tables.lattice.resolution == FINE
            assert filter_of_tiles.tables.everywhere.lattice.resolution == COARSE
            runs.append(found)
    assert runs[0] == runs[1]
