"""The public class, called as a stranger's client would: messages and commands in, estimates out."""

from __future__ import annotations

import dataclasses
import math
import subprocess
import threading
import types

import numpy as np
import pytest

from ciberrato import PoseFilter
from ciberrato.errors import UsageError
from ciberrato.files.run_log import RunWriter, read_run
from ciberrato.files.run_records import Cycle, RunHeader
from ciberrato.localization import Estimate, PoseEstimate
from ciberrato.localization.belief.estimate import CERTAIN
from ciberrato.protocol import Actions, BeaconReading, Measures, RobotRegistration
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

ANGLES = (0.0, 60.0, -60.0, 180.0)
PARAMETERS = Parameters(sim_time=0)


class Client:
    """A robot in a simulation, driven past walls by its readings alone."""

    def __init__(self, lab, start=(1.0, 4.2, 77.0), parameters=PARAMETERS, seed=1):
        grid = StartGrid(positions=(GridPosition(x=start[0], y=start[1], direction_deg=start[2]),))
        self.world = Simulation(lab, grid, parameters, seed)
        self.robot = self.world.register(RobotRegistration(name="x", sensor_angles=tuple(enumerate(ANGLES))))
        self.measures = self.world.launch()[self.robot]
        self.command = None
        self._left = True

    def drive(self):
        """Decide on a command, and let a cycle pass."""
        ahead, left, right, _ = (reading or 0.0 for reading in self.measures.infrared)
        if max(ahead, left, right) < 2.0:
            self.command, self._left = (0.1, 0.1), right > left
        else:
            self.command = (-0.05, 0.05) if self._left else (0.05, -0.05)
        actions = Actions(left_motor=self.command[0], right_motor=self.command[1])
        self.measures = self.world.step({self.robot: actions})[self.robot]

    def errors(self, estimate: Estimate) -> tuple[float, float]:
        """Units and degrees by which an estimate is off."""
        x, y, heading = self.world.poses()[0]
        turn = math.remainder(estimate.heading - heading, 2.0 * math.pi)
        return math.hypot(estimate.x - x, estimate.y - y), abs(math.degrees(turn))


@pytest.fixture
def tables(coarse_tables, fine_tables):
    """Stand in for a worker that has its tables."""

    def ready(timeout=None):
        return True

    return types.SimpleNamespace(
        coarse=coarse_tables, fine=fine_tables, error=None, wait=ready, wait_for_loops=ready
    )


@pytest.fixture
def localizer(small_lab, tables):
    return PoseFilter(small_lab, PARAMETERS, ANGLES, tables=tables, wait=True)


def run(client, localizer, cycles):
    """Drive for some cycles; return the estimates of all messages."""
    found = []
    for _ in range(cycles):
        found.append(localizer.observe(client.measures, client.command))
        client.drive()
    found.append(localizer.observe(client.measures, client.command))
    return found


def is_right(client, estimate):
    place, turn = client.errors(estimate)
    return estimate.certain and place < 0.2 and turn < 6.0


def test_a_client_finds_its_robot_and_nothing_is_left_running(small_lab, tmp_path, monkeypatch):
    monkeypatch.setenv("CIBERRATO_CACHE", str(tmp_path))
    started = []

    class Noted(subprocess.Popen):
        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            started.append(self)

    monkeypatch.setattr(subprocess, "Popen", Noted)
    before = set(threading.enumerate())
    client = Client(small_lab)
    with PoseFilter(small_lab, PARAMETERS, ANGLES, budget=math.inf) as localizer:
        assert localizer.wait()
        found = run(client, localizer, 120)
    assert is_right(client, found[-1])
    assert found[-1].time == 120
    assert found[-1].entropy < found[0].entropy - 2.0
    assert len(started) >= 1  # a process for both lattices
    assert all(process.returncode is not None for process in started)
    assert set(threading.enumerate()) == before
    # What is known stays, and a filter that needs no tables any more takes messages.
    client.drive()
    assert is_right(client, localizer.observe(client.measures, client.command))


def test_leaving_at_once_ends_what_had_begun(small_lab, tmp_path, monkeypatch):
    monkeypatch.setenv("CIBERRATO_CACHE", str(tmp_path))
    before = set(threading.enumerate())
    with pytest.raises(KeyboardInterrupt), PoseFilter(small_lab, PARAMETERS, ANGLES) as localizer:
        raise KeyboardInterrupt
    assert set(threading.enumerate()) == before
    localizer.close()
    with pytest.raises(ValueError, match="is closed"):
        localizer.wait()


def test_no_block_is_needed_for_a_recorded_run(small_lab, tables, tmp_path):
    """The log of a run gives the estimates that were made while it was driven, to the last bit."""
    client = Client(small_lab)
    live = PoseFilter(small_lab, PARAMETERS, ANGLES, tables=tables, budget=math.inf)
    header = RunHeader(lab_name="small", lab_sha256="", parameters=PARAMETERS, sensor_angles=ANGLES)
    found = []
    with RunWriter(tmp_path / "run.jsonl", header) as writer:
        for _ in range(90):
            found.append(live.observe(client.measures, client.command))
            seen = client.measures
            client.drive()
            writer.write(
                Cycle(
                    time=seen.time,
                    start=seen.start,
                    collision=seen.collision,
                    compass=seen.compass,
                    ground=seen.ground,
                    infrared=seen.infrared,
                    command=client.command,
                )
            )
    recorded = read_run(tmp_path / "run.jsonl")
    again = PoseFilter(
        small_lab, recorded.header.parameters, recorded.header.sensor_angles, tables=tables, wait=True
    )
    assert [again.observe(*message) for message in recorded.inputs] == found
    assert found[-1].certain
    again.reset()
    assert [again.observe(*message) for message in recorded.inputs] == found


def test_a_robot_that_is_carried_away_is_found_again(small_lab, localizer):
    client = Client(small_lab)
    assert is_right(client, run(client, localizer, 90)[-1])
    client.world.place(client.robot, 7.0, 1.0, math.pi)
    found = run(client, localizer, 200)
    assert any(not estimate.certain for estimate in found)
    assert is_right(client, found[-1])
    assert localizer.live.filter.restarts


def test_it_may_begin_in_the_middle_of_a_run(small_lab, localizer):
    client = Client(small_lab)
    for _ in range(70):
        client.drive()
    found = run(client, localizer, 90)
    assert found[0].time == 70
    assert not found[0].certain
    assert is_right(client, found[-1])


def test_messages_and_sensors_may_be_missing(small_lab, tables):
    """Every third message comes, the compass never, and one IR reading of four lacks in turn."""
    parameters = dataclasses.replace(PARAMETERS, compass_sensor=False)
    localizer = PoseFilter(small_lab, parameters, ANGLES, tables=tables, wait=True)
    client = Client(small_lab, parameters=parameters)
    command = None
    for cycle in range(241):
        if cycle % 3 == 0:
            lacks = cycle // 3 % 4
            infrared = tuple(None if k == lacks else r for k, r in enumerate(client.measures.infrared))
            found = localizer.observe(dataclasses.replace(client.measures, infrared=infrared), command)
            held = is_right(client, found)
            client.drive()
            command = client.command
        else:  # the command sent last stays in force
            actions = Actions(left_motor=command[0], right_motor=command[1])
            client.measures = client.world.step({client.robot: actions})[client.robot]
    assert found.time == 240
    assert held


def test_until_there_are_tables_it_says_that_it_knows_nothing(small_lab, coarse_tables, fine_tables):
    worker = types.SimpleNamespace(coarse=None, fine=None, error=None)
    localizer = PoseFilter(small_lab, PARAMETERS, ANGLES, tables=worker, budget=math.inf)
    client = Client(small_lab)
    assert localizer.estimate().time is None
    found = run(client, localizer, 50)
    assert all(math.isnan(estimate.x + estimate.heading + estimate.entropy) for estimate in found)
    assert not any(estimate.certain or estimate.probability or estimate.modes for estimate in found)
    assert [estimate.behind for estimate in found] == list(range(1, 52))
    worker.coarse, worker.fine = coarse_tables, fine_tables
    client.drive()
    found = run(client, localizer, 40)
    assert {estimate.behind for estimate in found} == {0}  # nothing was lost
    assert is_right(client, found[-1])


def test_what_an_estimate_says(small_lab, localizer):
    client = Client(small_lab)
    for estimate in run(client, localizer, 40):
        assert all(isinstance(mode, PoseEstimate) for mode in estimate.modes)
        shares = [mode.probability for mode in estimate.modes]
        assert shares == sorted(shares, reverse=True)
        assert sum(shares) <= 1.0 + 1e-6
        assert estimate.certain == (estimate.probability > CERTAIN)
        assert abs(estimate.heading) <= math.pi
    _, _, weights = localizer.live.filter.belief.listed()
    weights = weights[weights > 0.0] / weights.sum()
    assert estimate.entropy == pytest.approx(-(weights * np.log2(weights)).sum(), abs=1e-3)


def test_where_readings_come_late_all_poses_are_those_of_now(small_lab, tables):
    parameters = dataclasses.replace(PARAMETERS, obstacle_latency=4, compass_latency=4)
    localizer = PoseFilter(small_lab, parameters, ANGLES, tables=tables, wait=True)
    client = Client(small_lab, parameters=parameters)
    found = run(client, localizer, 150)
    sure = [estimate for estimate in found[100:] if estimate.certain]
    assert len(sure) > 40
    # In four cycles the robot drives up to 0.4 units.
    away = [math.hypot(one.x - one.modes[0].x, one.y - one.modes[0].y) for one in sure]
    assert max(away) < 0.2


def test_a_message_that_comes_late_changes_nothing(small_lab, localizer):
    client = Client(small_lab)
    run(client, localizer, 20)
    found = localizer.observe(client.measures, client.command)
    assert localizer.observe(Measures(time=17, infrared=(9.0, 9.0, 9.0, 9.0)), (0.0, 0.0)) == found
    assert localizer.observe(Measures(time=0), None) == found
    assert localizer.stale == 2
    run(client, localizer, 5)
    assert localizer.stale == 2


def test_a_new_simulation_is_told_by_several_messages_whose_times_follow_one_another(small_lab, localizer):
    client = Client(small_lab)
    run(client, localizer, 80)
    for time in (0, 25, 3, 1, 2):  # spoilt digits and late ones do not follow one another
        localizer.observe(Measures(time=time), None)
    with pytest.raises(ValueError, match="time 3 after 80: the simulation has begun again"):
        localizer.observe(Measures(time=3), None)
    assert localizer.stale == 5
    localizer.reset()
    assert localizer.observe(Measures(time=4), None).time == 4
    assert localizer.stale == 0


@pytest.mark.parametrize(
    ("options", "error", "says"),
    [
        ({"angles": (0.0, 60.0, -60.0)}, ValueError, "four IR sensors"),
        ({"angles": (0.0, 60.0, math.nan, 180.0)}, ValueError, "four IR sensors"),
        ({"budget": 0.0}, ValueError, "no time for any message"),
        ({"start": "5.5,3.8,0"}, UsageError, "from a wall"),
        ({"start": "nowhere"}, UsageError, "nowhere"),
    ],
)
def test_what_it_cannot_begin_with(small_lab, options, error, says):
    with pytest.raises(error, match=says):
        PoseFilter(small_lab, PARAMETERS, **options)


@pytest.mark.parametrize("command", [(math.nan, 0.0), (0.1,), (0.0, math.inf)])
def test_a_command_that_is_none_is_refused(localizer, command):
    with pytest.raises(ValueError, match="not the command of two motors"):
        localizer.observe(Measures(time=0), command)


def test_closed_before_its_tables_it_takes_nothing(small_lab):
    localizer = PoseFilter(small_lab, PARAMETERS, ANGLES)
    localizer.close()
    with pytest.raises(ValueError, match="closed before its tables"):
        localizer.observe(Measures(time=0))


@pytest.mark.parametrize(
    "wrong",
    [
        {"infrared": (math.nan, 1.0, 1.0, 1.0)},
        {"compass": math.inf},
        {"gps": (1.0, math.nan)},
        {"beacons": (BeaconReading(beacon=0, bearing=math.nan),)},
    ],
)
def test_readings_that_are_no_numbers_are_refused_and_change_nothing(small_lab, tables, wrong):
    with (
        PoseFilter(small_lab, PARAMETERS, ANGLES, tables=tables, wait=True) as localizer,
        PoseFilter(small_lab, PARAMETERS, ANGLES, tables=tables, wait=True) as other,
    ):
        good = [
            Measures(time=time, start=True, infrared=(1.0, 1.0, 1.0, 1.0), compass=0.0) for time in (1, 2)
        ]
        localizer.observe(good[0])
        with pytest.raises(ValueError, match="readings are finite"):
            localizer.observe(dataclasses.replace(good[1], **wrong), (0.1, 0.1))
        other.observe(good[0])
        assert localizer.observe(good[1], (0.1, 0.1)) == other.observe(good[1], (0.1, 0.1))


@pytest.mark.parametrize("command", [5, "ab", (None, None), (0.1,), (math.nan, 0.0)])
def test_what_is_no_command_is_refused(small_lab, tables, command):
    localizer = PoseFilter(small_lab, PARAMETERS, ANGLES, tables=tables, wait=True)
    with pytest.raises(ValueError, match="command of two motors"):
        localizer.observe(Measures(time=1), command)
    with pytest.raises(ValueError, match="is not a Lab"):
        PoseFilter("maze", PARAMETERS)


def test_after_a_gap_in_which_all_is_lost_it_begins_anew_at_once(small_lab, tables):
    client = Client(small_lab)
    lost, fresh = (PoseFilter(small_lab, PARAMETERS, ANGLES, tables=tables, wait=True) for _ in range(2))
    assert run(client, lost, 250)[-1].certain
    later = dataclasses.replace(client.measures, time=10**9)
    estimate = lost.observe(later, client.command)
    assert not estimate.certain
    assert estimate == fresh.observe(later, client.command)
    client.world.time, client.measures = 10**9, later
    assert is_right(client, run(client, lost, 250)[-1])
