"""Status messages become frames, frames a time line in bounded memory."""

import itertools

import pytest

import ciberrato.viewer.timeline
from ciberrato.protocol import Acceptance, Restart, RobotStatus
from ciberrato.viewer.timeline import Timeline
from ciberrato.viewer.world import Frame, World
from ciberrato.world.parameters import Parameters


def status(robot_id, time, **values):
    return RobotStatus(name=f"r{robot_id}", robot_id=robot_id, time=time, **({"state": "Running"} | values))


def feed(world, messages):
    return [frame for n, message in enumerate(messages) for frame in world.receive(message, 0.05 * n)]


def ids(frame):
    return [robot.robot_id for robot in frame.robots]


def test_a_frame_is_complete_with_the_last_robot_that_is_known():
    world = World()
    frames = feed(world, [status(robot, time) for time in (1, 2, 3) for robot in (1, 2, 5)])
    assert [(frame.time, ids(frame)) for frame in frames[-2:]] == [(2, [1, 2, 5]), (3, [1, 2, 5])]


def test_a_new_robot_between_others_joins_the_frame():
    world = World()
    feed(world, [status(1, 1), status(3, 1), status(1, 2), status(3, 2)])
    frames = feed(world, [status(1, 3), status(2, 3), status(3, 3)])
    assert [(frame.time, ids(frame)) for frame in frames] == [(3, [1, 2, 3])]


@pytest.mark.parametrize("lost", range(3))
def test_a_lost_datagram_delays_one_frame_only(lost):
    world = World()
    feed(world, [status(robot, time) for time in (0, 1) for robot in (1, 2, 3)])
    second = [status(robot, 2) for n, robot in enumerate((1, 2, 3)) if n != lost]
    frames = feed(world, second + [status(robot, 3) for robot in (1, 2, 3)])
    assert [frame.time for frame in frames] == [2, 3]
    assert all(ids(frame) == [1, 2, 3] for frame in frames)


def test_phases_follow_a_run_from_empty_to_finished():
    world = World()
    assert world.frame.phase == "empty"
    world.receive(Acceptance(parameters=Parameters(sim_time=4)), 0.0)
    run = [(0, "Stopped"), (1, "Running"), (2, "Running"), (2, "Stopped"), (3, "Running"), (4, "Running")]
    frames = feed(world, [status(1, time, state=state) for time, state in run])
    assert [frame.phase for frame in frames] == [
        "ready",
        "running",
        "running",
        "stopped",
        "running",
        "finished",
    ]
    world.receive(Restart(), 9.0)
    assert world.frame == Frame(0, "empty", ())


def test_the_rate_is_measured_in_cycles_a_second():
    world = World()
    for n in range(100):
        world.receive(status(1, n), 0.025 * n)
    assert world.rate(0.025 * 99) == pytest.approx(40.0)
    assert world.rate(60.0) == 0.0


def frame(time, **values):
    return Frame(time, "running", (status(1, time, **values),))


def test_a_window_is_thinned_evenly_and_keeps_its_last_frame():
    timeline = Timeline()
    for time in range(100):
        timeline.add(frame(time), str(time))
    assert timeline.window(10, 19, 512) == [str(time) for time in range(10, 20)]
    thinned = [int(text) for text in timeline.window(0, 99, 12)]
    assert len(thinned) == 12
    assert (thinned[0], thinned[-1]) == (0, 99)
    assert max(b - a for a, b in itertools.pairwise(thinned)) <= 10
    assert timeline.window(500, 600, 10) == ["99"]
    assert Timeline().window(0, 10, 5) == []


def test_frames_of_one_time_replace_one_another():
    timeline = Timeline()
    for text in "abc":
        timeline.add(frame(7), text)
    assert timeline.window(0, 9, 9) == ["c"]


def test_time_that_goes_back_begins_a_new_epoch():
    timeline = Timeline()
    timeline.add(frame(7), "a")
    timeline.add(frame(3), "b")
    assert (timeline.epoch, timeline.window(0, 9, 9)) == (1, ["b"])


def test_memory_is_bounded_and_the_recent_past_stays_whole(monkeypatch):
    monkeypatch.setattr(ciberrato.viewer.timeline, "MOST_FRAMES", 64)
    timeline = Timeline()
    for time in range(5000):
        timeline.add(frame(time), str(time))
    kept = [int(text) for text in timeline.window(0, 5000, 512)]
    assert len(kept) <= 64
    assert kept[-32:] == list(range(4968, 5000))
    assert kept[0] == 0


def test_long_frames_are_forgotten_by_their_bytes(monkeypatch):
    monkeypatch.setattr(ciberrato.viewer.timeline, "MOST_BYTES", 10_000)
    timeline = Timeline()
    for time in range(1000):
        timeline.add(frame(time), "x" * 500)
    assert len(timeline) <= 21


def test_marks_say_what_happened():
    timeline = Timeline()
    frames = [
        Frame(0, "ready", (status(1, 0, state="Stopped", visited_mask="00"),)),
        Frame(1, "running", (status(1, 1, visited_mask="00"),)),
        Frame(2, "running", (status(1, 2, visited_mask="00", collisions=1, collision=True),)),
        Frame(3, "running", (status(1, 3, visited_mask="01", collisions=1, collision=True),)),
        Frame(4, "stopped", (status(1, 4, visited_mask="01", collisions=1, state="Stopped"),)),
        Frame(5, "running", (status(1, 5, visited_mask="01", collisions=1, state="Returning"),)),
        Frame(6, "finished", (status(1, 6, visited_mask="01", collisions=1, state="Finished"),)),
    ]
    for one in frames:
        timeline.add(one, "")
    assert [(mark.time, mark.kind, mark.robot) for mark in timeline.marks] == [
        (0, "joined", 1),
        (1, "started", 0),
        (2, "collision", 1),
        (3, "target", 1),
        (4, "stopped", 0),
        (5, "started", 0),
        (5, "returning", 1),
        (6, "ended", 0),
        (6, "finished", 1),
    ]


def test_marks_are_bounded(monkeypatch):
    monkeypatch.setattr(ciberrato.viewer.timeline, "MOST_MARKS", 10)
    timeline = Timeline()
    for time in range(100):
        timeline.add(frame(time, collisions=time), "")
    assert len(timeline.marks) == 10
