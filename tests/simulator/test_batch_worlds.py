"""Worlds of a batch that differ, begin anew and are scored: each as a single simulation, to the last bit."""

from __future__ import annotations

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

from ciberrato.errors import UsageError
from ciberrato.files.lab import read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.labs import find_lab
from ciberrato.protocol import Actions, Measures, RobotRegistration
from ciberrato.world.lab import Beacon, Lab, Target, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.batch import BatchReadings, BatchSimulation, arrays, scalar
from simulator_stub.batch import compiled as batch_compiled
from simulator_stub.batch.simulation import FEW
from simulator_stub.simulation import Simulation

KERNELS = [
    pytest.param({"compiled": False}, id="numpy"),
    pytest.param({"compiled": True, "threads": 1}, id="numba"),
    pytest.param({"compiled": True, "threads": 3}, id="threads"),
]
SIZES = [
    *(pytest.param(*one.values, 6, id=f"{one.id}-6") for one in KERNELS),
    pytest.param({"compiled": False}, FEW + 8, id="arrays"),
]
"""Numpy alone steps few worlds one by one, and many as arrays."""
NOISY = Parameters(sim_time=0, gps=True, beacon_sensor=True)
ROOM = Lab(
    name="room",
    width=12.0,
    height=10.0,
    beacons=(Beacon(x=6.0, y=5.0, height=3.0), Beacon(x=0.0, y=0.0, height=4.0)),
    targets=(Target(x=9.0, y=7.0, radius=2.5), Target(x=9.5, y=7.5, radius=1.5)),
    walls=(Wall(height=2.0, corners=((4.0, 4.0), (5.0, 4.0), (5.0, 7.0), (4.0, 7.0))),),
)


@pytest.fixture(autouse=True)
def _small_shares(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch_compiled, "LEAST_SHARE", 2)


class Twins:
    """A batch, and single simulations of the same worlds."""

    def __init__(self, labs, starts, rules, seeds, scoring, **options) -> None:
        self.scoring = scoring
        self.labs, self.starts, self.rules = list(labs), [tuple(s) for s in starts], list(rules)
        self.batch = BatchSimulation(
            labs, starts, rules, seeds=seeds, scoring=scoring, labs_to_come=[ROOM], **options
        )
        self.single = [self._simulation(world, seed) for world, seed in enumerate(seeds)]
        self.told = [simulation.launch()[1] for simulation in self.single]

    def _simulation(self, world: int, seed: int) -> Simulation:
        x, y, direction = (float(number) for number in self.starts[world])
        grid = StartGrid(positions=(GridPosition(x=x, y=y, direction_deg=direction),))
        simulation = Simulation(self.labs[world], grid, self.rules[world], seed, self.scoring or 0)
        simulation.register(RobotRegistration())
        return simulation

    def reset(self, worlds, seeds=None, **changes) -> None:
        self.batch.reset(worlds, seeds=seeds, **changes)
        for place, world in enumerate(worlds):
            for name, kept in (("labs", self.labs), ("starts", self.starts), ("parameters", self.rules)):
                if name in changes:
                    kept[world] = changes[name][place]
            if seeds is None:
                self.single[world].reset()
                self.single[world].register(RobotRegistration())
            else:
                self.single[world] = self._simulation(world, seeds[place])
            self.told[world] = self.single[world].launch()[1]

    def step(self, commands, leds) -> None:
        self.batch.step(commands, leds)
        for world, simulation in enumerate(self.single):
            end, returning, visiting = (None,) * 3 if leds is None else (bool(led) for led in leds[world])
            actions = Actions(
                left_motor=float(commands[world, 0]),
                right_motor=float(commands[world, 1]),
                end_led=end,
                returning_led=returning,
                visiting_led=visiting,
            )
            self.told[world] = simulation.step({1: actions})[1]

    def check(self, note: object = "") -> None:
        readings, poses = self.batch.readings, self.batch.poses()
        for world, simulation in enumerate(self.single):
            assert of_batch(readings, world) == of_measures(self.told[world]), (note, world)
            assert poses[world].tolist() == simulation.poses()[0].tolist(), (note, world)
            assert readings.over[world] == (0 < self.rules[world].sim_time <= simulation.time)
            robot = simulation.robots[0]
            assert self.batch.collisions[world] == robot.collisions
            scores = self.batch.scores
            if scores is not None:
                assert readings.score[world] == robot.score, (note, world)
                assert scores.arrival_time[world] == robot.arrival_time, (note, world)
                assert scores.returning_time[world] == robot.returning_time
                state = "Returning" if scores.returning[world] else "Running"
                state = "Finished" if scores.finished[world] else state
                assert state == robot.state.value, (note, world)


def of_batch(readings: BatchReadings, world: int) -> tuple[object, ...]:
    bearings = None
    if readings.beacons is not None:
        bearings = [None if math.isnan(angle) else angle for angle in readings.beacons[world].tolist()]
    return (
        int(readings.time[world]),
        tuple(readings.infrared[world].tolist()),
        float(readings.compass[world]),
        int(readings.ground[world]),
        bool(readings.collision[world]),
        None if readings.gps is None else tuple(readings.gps[world].tolist()),
        bearings,
    )


def of_measures(measures: Measures) -> tuple[object, ...]:
    bearings = [beacon.bearing for beacon in measures.beacons] or None
    if bearings is not None:
        bearings += [None] * (2 - len(bearings))
    return (
        measures.time,
        measures.infrared,
        measures.compass,
        measures.ground,
        measures.collision,
        measures.gps,
        bearings,
    )


def free_starts(labs, rng: np.random.Generator) -> list[tuple[float, float, float]]:
    starts = []
    for lab in labs:
        walls = WallMap.from_lab(lab)
        while True:
            x, y = rng.uniform(0.5, lab.width - 0.5), rng.uniform(0.5, lab.height - 0.5)
            if walls.distance(x, y) >= 0.5:
                break
        starts.append((x, y, rng.uniform(-180.0, 180.0)))
    return starts


def labs_named(*names: str) -> list[Lab]:
    return [read_lab(find_lab(name)) for name in names]


def rules_of(worlds: int, rng: np.random.Generator, **changes: object) -> list[Parameters]:
    """Parameters of which some have noise and some have none, and that end at different times."""
    return [
        replace(
            NOISY,
            motors_noise=float(rng.choice([0.0, 1.5])),
            obstacle_noise=float(rng.choice([0.0, 0.1])),
            compass_noise=float(rng.choice([0.0, 2.0])),
            beacon_noise=float(rng.choice([0.0, 2.0])),
            gps_linear_noise=float(rng.choice([0.0, 0.5])),
            beacon_aperture=float(rng.choice([1.0, math.pi])),
            sim_time=int(rng.choice([0, 40, 55])),
            collision_wall_penalty=int(rng.choice([2, 7])),
            **changes,
        )
        for _ in range(worlds)
    ]


@pytest.mark.parametrize(("options", "worlds"), SIZES)
@pytest.mark.parametrize("scoring", [None, 0, 1])
def test_worlds_that_differ_and_begin_anew(options: dict, worlds: int, scoring: int | None) -> None:
    rng = np.random.default_rng([worlds, 3])
    labs = [*labs_named("maze", "rooms", "lines"), ROOM] * worlds
    labs = labs[:worlds]
    twins = Twins(
        labs, free_starts(labs, rng), rules_of(worlds, rng), list(range(worlds)), scoring, **options
    )
    if not options["compiled"]:
        assert twins.batch._kernels is (scalar if worlds < FEW else arrays)
    twins.check("start")
    for cycle in range(90):
        commands = rng.choice([-0.1, 0.05, 0.1, 0.15, 0.2], size=(worlds, 2))
        leds = None
        if scoring is not None and cycle % 3:
            leds = rng.random((worlds, 3)) < (0.01, 0.02, 0.2)
        twins.step(commands, leds)
        twins.check(cycle)
        if cycle % 7 == 6:
            some = rng.choice(worlds, size=3, replace=False).tolist()
            if cycle % 2:
                twins.reset(some)
            else:
                labs = [ROOM, labs_named("maze")[0], ROOM]
                starts = free_starts(labs, rng)
                twins.reset(
                    some,
                    [cycle, cycle + 1, 0],
                    labs=labs,
                    starts=np.array(starts),
                    parameters=rules_of(3, rng),
                )
            twins.check(("reset", cycle))


@pytest.mark.parametrize(("options", "worlds"), SIZES)
def test_latencies_begin_anew_too(options: dict, worlds: int) -> None:
    rng = np.random.default_rng(5)
    late = {
        "obstacle_latency": 2,
        "compass_latency": 3,
        "collision_latency": 1,
        "ground_latency": 4,
        "beacon_latency": 2,
    }
    labs = [ROOM] * worlds
    seeds = range(5, 5 + worlds)
    twins = Twins(labs, free_starts(labs, rng), rules_of(worlds, rng, **late), seeds, None, **options)
    for cycle in range(60):
        twins.step(rng.choice([0.05, 0.1, 0.15], size=(worlds, 2)), None)
        twins.check(cycle)
        if cycle % 5 == 4:
            twins.reset([cycle % worlds, (cycle + 1) % worlds])
            twins.check(("reset", cycle))


@pytest.mark.parametrize(("options", "worlds"), SIZES)
@pytest.mark.parametrize("sim_time", [0, 130])
def test_the_way_home_in_mode_0(options: dict, sim_time: int, worlds: int) -> None:
    """A robot visits both targets, signals, drives back, and ends its run at several times."""
    quiet = replace(NOISY, motors_noise=0.0, sim_time=sim_time)
    twins = Twins([ROOM] * worlds, [(6.5, 7.0, 0.0)] * worlds, [quiet] * worlds, range(worlds), 0, **options)
    for cycle in range(150):
        speed = 0.1 if cycle < 25 else (0.0 if cycle < 40 else -0.05)
        leds = np.zeros((worlds, 3), bool)
        leds[:, 2] = cycle in (12, 14, 27, 30)
        leds[:, 1] = cycle in (33, 45)
        leds[1, 1] = cycle == 10  # too early
        leds[2, 0] = cycle == 60
        leds[3, 0] = cycle == 33
        leds[4, 1] |= cycle in (37, 38)
        # The second target lies inside the first, of which the sensor is told last and scores first.
        commands = np.full((worlds, 2), speed)
        twins.step(commands, leds if cycle % 2 or leds.any() else None)
        twins.check(cycle)
    assert twins.batch.scores is not None
    assert twins.batch.scores.finished[[1, 2]].all()


def test_a_full_visit_returns_and_counts() -> None:
    lab = Lab(name="one", width=12.0, height=10.0, targets=(Target(x=9.0, y=5.0, radius=2.0),))
    rules = replace(NOISY, gps=False, beacon_sensor=False, motors_noise=0.0, sim_time=120)
    twins = Twins([lab] * 3, [(3.0, 5.0, 0.0)] * 3, [rules] * 3, [1, 2, 3], 0)
    for cycle in range(125):
        leds = np.zeros((3, 3), bool)
        leds[:, 2] = cycle == 50
        leds[:, 1] = cycle in (52, 60)
        leds[1, 0] = cycle == 118
        leds[2, 0] = cycle == 52
        twins.step(np.full((3, 2), 0.12 if cycle < 52 else -0.1), leds)
        twins.check(cycle)
    scores = twins.batch.scores
    assert scores is not None
    assert scores.returning.tolist() == [True, True, False]
    assert scores.finished.tolist() == [False, True, True]
    assert scores.score[1] < scores.score[0]


def test_a_snapshot_outlives_a_reset() -> None:
    rng = np.random.default_rng(9)
    labs = [ROOM] * 5
    starts = free_starts(labs, rng)

    def batch() -> BatchSimulation:
        return BatchSimulation(labs, starts, replace(NOISY, sim_time=200), seeds=range(5), scoring=1)

    def drive(one: BatchSimulation, cycles: int) -> list[list[float]]:
        return [
            [*one.step(np.full((5, 2), 0.1)).infrared.ravel(), *one.poses().ravel(), *one.readings.score]
            for _ in range(cycles)
        ]

    one, other = batch(), batch()
    drive(one, 70)
    moment = one.snapshot()
    future = drive(one, 150)
    one.restore(moment)
    drive(one, 3)
    one.reset([1, 3], seeds=[50, 51])
    changed = drive(one, 150)
    one.restore(moment)
    assert drive(one, 150) == future
    drive(other, 73)
    other.reset([1, 3], seeds=[50, 51])
    assert drive(other, 150) == changed


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"worlds": [0, 0]}, "different numbers"),
        ({"worlds": [5]}, "different numbers"),
        ({"worlds": [True, False]}, "a mask of worlds must have the shape"),
        ({"worlds": [1], "seeds": [1, 2]}, "there must be 1 seeds"),
        ({"worlds": [1], "starts": [(math.nan, 0.0, 0.0)]}, "starts must be finite"),
        ({"labs": [ROOM]}, "labs: 1 for 3 worlds"),
        ({"labs": Lab(name="elsewhere")}, "does not know the lab 'elsewhere'"),
        ({"parameters": replace(NOISY, obstacle_latency=3)}, "obstacle_latency must be the same"),
    ],
)
def test_what_cannot_be_reset_changes_nothing(change: dict, message: str) -> None:
    batch = BatchSimulation(ROOM, [(2.0, 2.0, 0.0)] * 3, NOISY, seeds=[1, 2, 3])
    batch.step(np.full((3, 2), 0.1))
    before = batch.poses()
    with pytest.raises(ValueError, match=message):
        batch.reset(**change)
    assert np.array_equal(batch.poses(), before)
    assert batch.time.tolist() == [1, 1, 1]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seeds": 3}, "seeds: 3 are not seeds, one for each world"),
        ({"seeds": ["a", 1]}, "seed: 'a' is neither a whole number"),
        ({"seeds": [-1, 1]}, "seed: -1 is below 0"),
        ({"starts": None}, "starts must have the shape"),
        ({"starts": [("a", 1, 1), (1, 1, 1)]}, "starts: .* are not numbers"),
        ({"starts": [(1e300, 1, 1), (1, 1, 1)]}, "starts must be finite, and within 1e"),
        ({"lab": "maze"}, "labs: 'maze' is no Lab"),
        ({"lab": [ROOM, "maze"]}, "labs: 'maze' is no Lab"),
        ({"labs_to_come": ["maze"]}, "labs_to_come: 'maze' is no Lab"),
        ({"parameters": [NOISY, 2]}, "parameters: 2 is no Parameters"),
        ({"parameters": 0}, "parameters: 0 is no Parameters"),
        ({"sensor_angles": (1.0, 2.0)}, "sensor_angles: .* are not 4 angles"),
        ({"sensor_angles": "abc"}, "sensor_angles: 'abc' are not numbers"),
        ({"scoring": [0]}, r"modes 0 and 1 only, not of \[0\]"),
        ({"compiled": "yes"}, "compiled: 'yes' is neither True nor False"),
        ({"compiled": True, "threads": 0}, "threads: 0 is below 1"),
        ({"compiled": True, "threads": "2"}, "threads: '2' is not a whole number"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_what_a_batch_cannot_be_made_of_is_named(change: dict, message: str) -> None:
    given = {"lab": ROOM, "starts": [(2.0, 2.0, 0.0)] * 2, "parameters": NOISY, "seeds": [1, 2], **change}
    with pytest.raises((TypeError, ValueError), match=message) as caught:
        BatchSimulation(given.pop("lab"), given.pop("starts"), given.pop("parameters"), **given)
    assert "\n" not in str(caught.value)


def test_what_a_batch_cannot_be_told_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    batch, other = (
        BatchSimulation(ROOM, [(2.0, 2.0, 0.0)] * worlds, seeds=range(worlds)) for worlds in (2, 3)
    )
    for commands in ("ahead", [["a", "b"]] * 2):
        with pytest.raises(TypeError, match=r"commands: .* are not numbers"):
            batch.step(commands)
    for worlds in (1.5, "x"):
        with pytest.raises(TypeError, match="is neither a mask nor whole numbers"):
            batch.reset(worlds)
    for snapshot in (None, other.snapshot()):
        with pytest.raises(ValueError, match="no snapshot of this batch"):
            batch.restore(snapshot)
    monkeypatch.setitem(sys.modules, "simulator_stub.batch.compiled", None)
    with pytest.raises(UsageError, match=r"compiled=True needs numba: pip install 'ciberrato\[fast\]'"):
        BatchSimulation(ROOM, [(2.0, 2.0, 0.0)], seeds=[1], compiled=True)


def test_other_things_are_refused() -> None:
    with pytest.raises(ValueError, match="modes 0 and 1 only, not of 4"):
        BatchSimulation(ROOM, [(2.0, 2.0, 0.0)], seeds=[1], scoring=4)
    batch = BatchSimulation(ROOM, [(2.0, 2.0, 0.0)], seeds=[1])
    with pytest.raises(ValueError, match="LEDs have no meaning without scores"):
        batch.step(None, [[False, False, True]])
    with pytest.raises(ValueError, match="leds must have the shape"):
        BatchSimulation(ROOM, [(2.0, 2.0, 0.0)], seeds=[1], scoring=0).step(None, [False] * 3)
