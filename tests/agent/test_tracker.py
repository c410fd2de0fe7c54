"""The tracker: recorded runs of the published method, and streams made up to be awkward."""

import csv
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from agent.drives.right.tracker import CellTracker, Crossing
from ciberrato.protocol import Measures
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from tests.recordings import OWN

ANGLES = (0.0, 90.0, -90.0, 180.0)
NOISE_FREE = Parameters(motors_noise=0.0)


def crossings(recording: Any, change: Callable[[Measures], Measures] = lambda m: m) -> list[Crossing]:
    tracker = CellTracker(recording.parameters, ANGLES)
    found = [tracker.observe(change(measures), command) for measures, command in recording.stream()]
    return [crossing for crossing in found if crossing is not None]


@pytest.mark.parametrize(
    ("name", "times"),
    [
        ("noise_free_pos1", [0, 21, 41, 61, 81, 101, 121, 141, 161, 181, 203, 223]),
        ("noise_free_pos5", [0, 21, 41]),
    ],
)
def test_noise_free_recordings_cross_where_the_published_method_does(
    recording: Any, name: str, times: list[int]
) -> None:
    run = recording(name)
    found = crossings(run)
    assert [crossing.time for crossing in found] == times
    assert [crossing.index for crossing in found] == list(range(len(times)))
    first = next(run.stream())[0]
    assert found[0].readings == first.infrared


def test_noisy_recording_crosses_the_cells_truly_entered(recording: Any) -> None:
    """The original agent dreams up 23 cells after its robot sticks at x = 15.7; five were entered."""
    found = crossings(recording("default_noise_pos1"))
    rows = csv.DictReader((OWN / "seed_runs/default_noise_pos1/truth.csv").read_text().splitlines())
    truth = {int(row["time"]): float(row["x"]) for row in rows}
    assert [truth[crossing.time] for crossing in found] == pytest.approx([5, 7, 9, 11, 13, 15], abs=0.06)
    assert max(truth.values()) < 17.0


def test_without_the_collision_flag_noise_free_recordings_come_out_the_same(recording: Any) -> None:
    run = recording("noise_free_pos1")
    found = crossings(run, lambda measures: replace(measures, collision=None))
    assert [crossing.time for crossing in found][-1] == 223


def feed(
    tracker: CellTracker, times: list[int], command: tuple[float, float] = (0.1, 0.1), **values: Any
) -> list[Crossing]:
    values = {"compass": 0.0, "infrared": (0.6, 2.5, 2.5, 0.6), "collision": False, **values}
    found = [tracker.observe(Measures(time=time, start=True, **values), command) for time in times]
    return [crossing for crossing in found if crossing is not None]


def test_time_counts_not_messages() -> None:
    steady = feed(CellTracker(NOISE_FREE, ANGLES), list(range(50)))
    repeated = feed(CellTracker(NOISE_FREE, ANGLES), [time for time in range(50) for _ in range(3)])
    assert [c.time for c in steady] == [c.time for c in repeated] == [0, 21, 41]


def test_lost_messages_are_bridged() -> None:
    tracker = CellTracker(NOISE_FREE, ANGLES)
    found = feed(tracker, [0, 1, 2, 10, 11, 19, 22, 23, 39, 42])
    assert [crossing.time for crossing in found] == [0, 22, 42]
    assert found[1].pose.along == pytest.approx(2.1)


def test_a_collision_over_lost_messages_keeps_the_robot_in_place() -> None:
    tracker = CellTracker(NOISE_FREE, ANGLES)
    feed(tracker, [0, 1, 2])
    feed(tracker, [3, 9], collision=True)
    assert tracker.pose.along == pytest.approx(0.125)


def test_coming_to_rest_at_a_centre_is_a_crossing() -> None:
    tracker = CellTracker(NOISE_FREE, ANGLES)
    assert [c.time for c in feed(tracker, list(range(19)))] == [0]
    found = feed(tracker, list(range(19, 40)), (0.0, 0.0))
    assert len(found) == 1
    assert 1.75 < found[0].pose.along < 2.0
    assert tracker.rest > 5


def test_a_start_that_does_not_look_right_is_read_once_it_does() -> None:
    tracker = CellTracker(Parameters(), ANGLES)
    assert feed(tracker, [0] * 5, compass=90.0) == []
    assert tracker.pose.heading == pytest.approx(math.pi / 2)
    turned = [
        tracker.observe(
            Measures(time=t, start=True, compass=max(90.0 - 9.0 * t, 0.0), infrared=(0.6, 2.5, 2.5, 0.6)),
            (0.0785, -0.0785) if t <= 10 else (0.0, 0.0),
        )
        for t in range(1, 60)
    ]
    found = [crossing for crossing in turned if crossing is not None]
    assert len(found) == 1
    assert abs(math.degrees(found[0].pose.heading)) <= 1.0
    assert found[0].index == 0


def test_a_start_heading_off_the_right_angles_is_taken_from_the_compass() -> None:
    tracker = CellTracker(Parameters(), ANGLES)
    feed(tracker, [0] * 20, compass=37.0)
    assert math.degrees(tracker.pose.heading) == pytest.approx(37.0)


def test_a_heading_wrongly_taken_for_zero_is_noticed() -> None:
    """MotorsNoise 0, start heading 5 degrees, one message before it moves: 5 could well be 0 with noise."""
    tracker = CellTracker(NOISE_FREE, ANGLES)
    feed(tracker, list(range(60)), compass=5.0, infrared=(0.6, None, None, 0.6))
    assert math.degrees(tracker.pose.heading) == pytest.approx(5.0, abs=1.0)


def test_old_readings_belong_to_where_they_were_taken() -> None:
    late = replace(NOISE_FREE, obstacle_latency=4)
    tracker = CellTracker(late, ANGLES)
    # Four messages hold nothing measured yet.
    assert feed(tracker, [0] * 4, infrared=(0.0, 0.0, 0.0, 0.0)) == []
    found = feed(tracker, [0, *range(1, 60)])
    assert [crossing.time for crossing in found] == [0, 25, 45]
    assert found[1].pose.along == pytest.approx(2.0)
    assert tracker.pose.along > 5.7


def test_readings_on_request_are_gathered() -> None:
    tracker = CellTracker(replace(NOISE_FREE, obstacle_requestable=True), ANGLES)
    assert feed(tracker, [0], infrared=(None, None, None, None)) == []
    assert feed(tracker, [0], infrared=(0.6, 2.5, None, None)) == []
    (start,) = feed(tracker, [0], infrared=(None, None, 2.4, 0.7))
    assert start.readings == (0.6, 2.5, 2.4, 0.7)
    feed(tracker, list(range(1, 20)), infrared=(None, None, None, None))
    feed(tracker, [20], infrared=(0.8, None, None, None))
    (crossing,) = feed(tracker, [21], infrared=(None, 0.3, None, None))
    assert crossing.readings == (0.8, 0.3, None, None)


def test_readings_that_never_come_do_not_stop_it() -> None:
    tracker = CellTracker(replace(NOISE_FREE, obstacle_requestable=True), ANGLES)
    found = feed(tracker, [0] * 20, infrared=(None, None, None, None))
    assert [crossing.readings for crossing in found] == [(None,) * 4]


def test_without_a_compass_the_robot_is_taken_to_look_right() -> None:
    tracker = CellTracker(replace(NOISE_FREE, compass_sensor=False), ANGLES)
    found = feed(tracker, list(range(30)), compass=None)
    assert [crossing.time for crossing in found] == [0, 21]


@pytest.mark.parametrize("angles", [(0.0, 60.0, -60.0, 180.0), (360.0, 450.0, 270.0, -180.0)])
def test_sensors_at_other_angles_are_used_where_they_can_be(
    drive: Any, standard: Lab, angles: tuple[float, float, float, float]
) -> None:
    runs = drive(standard, [(5.0, 7.0, 0.0)] * 5, Parameters(), seed=4, angles=angles)
    assert [run.steps for run in runs] == [12] * 5
    assert all(run.collisions == 0 for run in runs)
