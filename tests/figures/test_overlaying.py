"""What a viewer is sent while a run goes on: received from a real socket, decoded by the protocol."""

import socket

import numpy as np

from agent.offline.expected_readings import compute_expected_readings
from agent.offline.localizer import localize
from agent.views.overlaying import belief_overlay, live_belief_overlay, pose_overlay, show_overlays
from ciberrato.files.lab import read_lab
from ciberrato.files.run_log import RunWriter
from ciberrato.files.run_records import Cycle, RecordedRun, RunHeader
from ciberrato.labs import find_lab
from ciberrato.net.overlay import OverlayClient
from ciberrato.overlay import decode_overlay
from ciberrato.world.parameters import Parameters

LAB = read_lab(find_lab("standard"))
ANGLES = (0.0, 90.0, -90.0, 180.0)
HEADER = RunHeader(
    lab_name="standard_lab.xml",
    lab_sha256="0" * 64,
    parameters=Parameters(motors_noise=0.0),
    sensor_angles=ANGLES,
    robot_name="tester",
    robot_position=2,
)


def run_of(cells):
    """A run with ideal readings in the given columns of row 3, and half a cell more."""
    truth = compute_expected_readings(LAB, ANGLES)
    cycles = []
    for step, column in enumerate(cells):
        readings = tuple(float(value) for value in truth.readings[3, column].round(1))
        cycles.append(
            Cycle(
                time=20 * step,
                infrared=readings,
                displacement=2.0 * step,
                lateral=0.0,
                heading=0.0,
                step=step,
                readings=readings,
            )
        )
    cycles.append(Cycle(time=20 * len(cells), displacement=2.0 * len(cells) - 1.0, lateral=0.0, heading=1.5))
    return RecordedRun(HEADER, tuple(cycles)), truth


def beliefs_of(run, truth):
    return localize([step.readings for step in run.steps], truth).beliefs


def test_the_belief_belongs_to_the_cycle_of_its_step():
    run, truth = run_of([2, 3, 4, 5])
    message = belief_overlay(run, beliefs_of(run, truth))
    np.testing.assert_array_equal(message.belief.cells, beliefs_of(run, truth)[-1])
    assert message.belief.extent == (0, 0, 28, 14)
    assert (message.source, message.robot, message.time, message.angles) == ("tester", 2, 60, ANGLES)


def test_the_ghost_is_on_its_way_from_the_believed_start():
    run, truth = run_of([2, 3, 4, 5])
    message = pose_overlay(run, beliefs_of(run, truth))
    (mark,) = message.shapes
    assert (mark.x, mark.y, mark.direction) == (12.0, 7.0, 1.5)  # from (5, 7), seven units on
    assert message.time == 80


def test_no_ghost_while_several_cells_are_equally_likely():
    run, truth = run_of([2])
    assert pose_overlay(run, beliefs_of(run, truth)).shapes == ()
    assert pose_overlay(run, None).shapes == ()


def test_the_live_estimate_is_shown_as_it_is_logged():
    run, _ = run_of([2])
    live = Cycle(time=99, estimate=(3.5, 4.5, 90.0, 0.875))
    (mark,) = pose_overlay(RecordedRun(HEADER, (*run.cycles, live)), None).shapes
    assert (mark.x, mark.y, mark.direction, mark.label) == (3.5, 4.5, 90.0, "p 0.88")


def test_a_live_belief_is_shown_with_all_that_it_may_be():
    modes = ((3.5, 4.5, 90.0, 0.5), (3.5, 12.5, 90.0, 0.49))
    cycle = Cycle(time=100, estimate=modes[0], cells=((2, 1, 0.5), (6, 1, 0.49)), modes=modes)
    run = RecordedRun(HEADER, (cycle,))
    message = live_belief_overlay(run, cycle, LAB)
    assert message.belief.cells.shape == (7, 14)
    assert (message.belief.cells[2, 1], message.belief.cells[6, 1]) == (0.5, 0.49)
    assert np.count_nonzero(message.belief.cells) == 2
    assert (message.time, message.robot) == (100, 2)
    marks = pose_overlay(run, None).shapes
    assert [(mark.x, mark.y, mark.direction, mark.label) for mark in marks] == [
        (3.5, 4.5, 90.0, "p 0.50"),
        (3.5, 12.5, 90.0, "p 0.49"),
    ]
    assert len({mark.id for mark in marks}) == 2


def test_a_log_is_sent_as_datagrams(tmp_path):
    run, _ = run_of([2, 3])
    path = tmp_path / "run.jsonl"
    with RunWriter(path, run.header) as writer:
        for cycle in run.cycles:
            writer.write(cycle)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(300)
        with OverlayClient(port=receiver.getsockname()[1]) as client:
            show_overlays(path, LAB, client, idle_limit=0.05)
        belief, pose = (decode_overlay(receiver.recv(1 << 16)) for _ in range(2))
    assert (belief.time, pose.time) == (20, 40)
    assert belief.belief.cells.shape == (7, 14)
    assert pose.belief is None


def test_a_drive_without_tables_shows_no_belief(tmp_path):
    """The readings of another drive than the one to the right are no readings of cells on the way right."""
    import io

    from agent.views.watching import watch

    readings = (0.5, 1.9, 2.1, 0.8)
    cycles = [Cycle(time=0, start=True, infrared=readings, phase="explore", step=0, readings=readings)]
    cycles += [Cycle(time=time, start=True, infrared=readings, phase="explore") for time in range(1, 20)]
    path = tmp_path / "run.jsonl"
    with RunWriter(path, HEADER) as writer:
        for cycle in cycles:
            writer.write(cycle)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(300)
        with OverlayClient(port=receiver.getsockname()[1]) as client:
            show_overlays(path, LAB, client, idle_limit=0.05)
        told = decode_overlay(receiver.recv(1 << 16))
        receiver.settimeout(0.0)
        assert told.belief is None
        assert told.shapes == ()
    out = io.StringIO()
    watch(path, LAB, out=out, once=True, colour=False)
    assert "no pose in the log yet" in out.getvalue()
    assert "most likely" not in out.getvalue()
    found = Cycle(time=20, estimate=(3.5, 4.5, 90.0, 0.97), cells=((2, 1, 0.97),), phase="explore")
    with RunWriter(path, HEADER) as writer:
        for cycle in (*cycles, found):
            writer.write(cycle)
    out = io.StringIO()
    watch(path, LAB, out=out, once=True, colour=False)
    assert "belief of the live filter at cycle 20: cell (3, 5), p 0.970" in out.getvalue()
    assert "cell (3, 5)  x 3.50" in out.getvalue()
