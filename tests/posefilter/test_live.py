from __future__ import annotations

import itertools
import math
import os
import re
import signal
import subprocess
import sys
import types

import pytest

from agent.run.live_controller import LiveController
from ciberrato.files.run_log import RunHeader, RunWriter, read_run
from ciberrato.localization.live.live_filter import LiveFilter
from ciberrato.localization.pose_filter import PoseFilter
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.world.lab import Lab, Wall
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

ANGLES = (0.0, 60.0, -60.0, 180.0)
PARAMETERS = Parameters(sim_time=0)


def simulation(lab, start=(1.0, 4.2, 77.0)):
    grid = StartGrid(positions=(GridPosition(x=start[0], y=start[1], direction_deg=start[2]),))
    world = Simulation(lab, grid, PARAMETERS, 1)
    robot = world.register(RobotRegistration(name="g", sensor_angles=tuple(enumerate(ANGLES))))
    return world, robot, world.launch()[robot]


def tables_from(coarse=None, fine=None):
    return types.SimpleNamespace(coarse=coarse, fine=fine, error=None, wait=lambda timeout: True)


def test_what_does_not_fit_into_a_cycle_waits_and_nothing_is_lost(small_lab, coarse_tables, fine_tables):
    worker = tables_from()
    ticks = itertools.count()
    live = LiveFilter(small_lab, PARAMETERS, worker, budget=2.5, clock=lambda: float(next(ticks)))
    world, robot, measures = simulation(small_lab)
    command = None
    for cycle in range(60):
        live.observe(measures, command)
        if cycle < 20:
            assert live.estimate() is None
        if cycle == 20:
            worker.coarse, worker.fine = coarse_tables, fine_tables
        if cycle == 30:
            assert live.lag == 31 - 2 * 10  # two messages fit into a cycle
        command = (0.05, 0.09)
        measures = world.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
    assert live.lag == 0
    assert live.finish().last_step is not None
    assert len(live.history) == 60


def test_an_estimate_that_is_behind_is_carried_on_by_dead_reckoning(small_lab, coarse_tables, fine_tables):
    worker = tables_from(coarse_tables, fine_tables)
    stopped = [False]
    ticks = itertools.count()
    live = LiveFilter(
        small_lab, PARAMETERS, worker, budget=1e6, clock=lambda: next(ticks) + 1e9 * stopped[0] * next(ticks)
    )
    world, robot, measures = simulation(small_lab)
    command = None
    for cycle in range(130):
        stopped[0] = cycle >= 120
        live.observe(measures, command)
        command = (-0.05, 0.05) if cycle % 40 < 30 else (0.08, 0.08)
        pose = world.poses()[0]
        measures = world.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
    found = live.estimate()
    assert live.lag >= 9
    assert found is not None
    assert math.hypot(found.x - pose[0], found.y - pose[1]) < 0.2
    assert abs(math.remainder(found.heading - pose[2], 2 * math.pi)) < math.radians(8.0)


def test_the_controller_logs_what_the_filter_knows(small_lab, coarse_tables, fine_tables, tmp_path):
    from agent.drives import make_drive

    localizer = PoseFilter(
        small_lab, PARAMETERS, ANGLES, tables=tables_from(coarse_tables, fine_tables), budget=1e6
    )
    header = RunHeader(lab_name="small", lab_sha256="", parameters=PARAMETERS, sensor_angles=ANGLES)
    controller = LiveController(
        header, localizer, make_drive("active", small_lab, PARAMETERS, ANGLES), exit_when_finished=True
    )
    world, robot, measures = simulation(small_lab)
    cycles = []
    while controller.ended is None and len(cycles) < 200:
        cycle, actions = controller.observe(measures)
        cycles.append(cycle)
        if actions is not None:
            pose = world.poses()[0]
            measures = world.step({robot: actions})[robot]
    assert controller.ended == "localized"
    x, y, heading, probability = cycles[-1].estimate
    assert probability > 0.95
    assert math.hypot(x - pose[0], y - pose[1]) < 0.3
    assert abs(math.remainder(heading - math.degrees(pose[2]), 360.0)) < 8.0
    assert cycles[0].entropy > cycles[-1].entropy + 4.0
    assert {cycle.phase for cycle in cycles} == {"active"}
    logged = [cycle for cycle in cycles if cycle.cells is not None]
    assert logged[0].time == 0
    assert 2 <= len(logged) <= len(cycles) / 5 + 1
    assert all(0.97 < sum(share for _, _, share in cycle.cells) < 1.01 for cycle in logged)
    assert max(logged[-1].cells, key=lambda cell: cell[2])[:2] == (pose[1] // 2, pose[0] // 2)
    several = [cycle for cycle in cycles if cycle.modes is not None]
    assert all(len(cycle.modes) > 1 for cycle in several)
    writer = RunWriter(tmp_path / "run.jsonl", header)
    with writer:
        for cycle in cycles:
            writer.write(cycle)
    assert read_run(tmp_path / "run.jsonl").cycles == tuple(cycles)


def test_rooms_that_look_alike_are_both_in_the_log():
    from ciberrato.localization.tables.pose_tables import build_tables

    def beam(y):
        return Wall(height=4.0, corners=((0.0, y), (6.0, y), (6.0, y + 0.2), (0.0, y + 0.2)))

    posts = tuple(
        Wall(height=4.0, corners=((2.9, y), (3.1, y), (3.1, y + 2.0), (2.9, y + 2.0))) for y in (2.0, 6.0)
    )
    lab = Lab(width=6.0, height=12.0, walls=(beam(1.9), beam(5.9), beam(9.9), *posts))
    tables = tables_from(build_tables(lab, ANGLES, 2.0 / 9.0))
    localizer = PoseFilter(lab, PARAMETERS, ANGLES, tables=tables, budget=1e6)
    header = RunHeader(lab_name="alike", lab_sha256="", parameters=PARAMETERS, sensor_angles=ANGLES)
    controller = LiveController(header, localizer, None)
    world, robot, measures = simulation(lab, (1.2, 3.0, 70.0))
    cycles = []
    for cycle in range(80):
        entry, _ = controller.observe(measures)
        cycles.append(entry)
        command = (-0.05, 0.05) if cycle % 40 < 25 else (0.06, 0.06)
        measures = world.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
    modes = [entry.modes for entry in cycles if entry.modes][-1]
    # The lower and the upper room are equal, a way of 4 units apart.
    lower = sorted(mode for mode in modes if 2.0 < mode[1] < 6.0)
    upper = sorted((x, round(y - 4.0, 2), turn, share) for x, y, turn, share in modes if 6.0 < y < 10.0)
    assert lower == upper
    assert len(lower) >= 1
    cells = {(row, column): share for row, column, share in [e.cells for e in cycles if e.cells][-1]}
    for column in range(3):
        assert cells.get((1, column), 0.0) == cells.get((3, column), 0.0)


@pytest.mark.slow
def test_the_agent_drives_to_a_place_from_it_knows_not_where(tmp_path):
    lab = tmp_path / "small_lab.xml"
    lab.write_text(
        '<Lab Name="small" Height="6" Width="8"><Wall Height="4">'
        '<Corner X="1.9" Y="2"/><Corner X="2.1" Y="2"/><Corner X="2.1" Y="6"/>'
        '<Corner X="1.9" Y="6"/></Wall></Lab>'
    )
    environment = os.environ | {"CIBERRATO_CACHE": str(tmp_path / "cache")}
    command = [sys.executable, "-m", "simulator_stub", "--lab", str(lab), "--grid", "1,4.2,77", "--port", "0"]
    simulator = subprocess.Popen(
        [*command, "--autostart", "1", "--seed", "3", "--lockstep", "--answer-limit", "inf"],
        stdout=subprocess.PIPE,
        text=True,
    )
    options = [
        "--angles",
        "0,60,-60,180",
        "--drive",
        "goto:7,5",
        "--exit-when-finished",
        "--smooth",
        "--lockstep",
    ]
    try:
        assert simulator.stdout is not None
        simulator.stdout.readline()
        port = re.search(r":(\d+)$", simulator.stdout.readline())
        assert port is not None
        agent = subprocess.run(
            [sys.executable, "-m", "agent", "-h", f"127.0.0.1:{port[1]}", "-m", str(lab), *options],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
    finally:
        simulator.send_signal(signal.SIGTERM)
        simulator.wait()
        simulator.stdout.close()
    assert agent.returncode == 0, agent.stderr
    assert "the pose is known" in agent.stderr
    last = read_run(tmp_path / "run.jsonl").cycles[-1]
    assert last.leds[0]
    assert last.estimate is not None
    assert math.hypot(last.estimate[0] - 7.0, last.estimate[1] - 5.0) < 0.3
    from ciberrato.files.beliefs import read_beliefs

    blocks = read_beliefs(tmp_path / "localization.out")[0].beliefs
    assert blocks.shape[1:] == (3, 4)
    assert blocks[1][2, 0] > 0.8  # the start cell, known from the whole run
    assert blocks[-1].argmax() == 2 * 4 + 3


def relayed_controller(small_lab, worker, clock):
    from agent.drives import make_drive

    localizer = PoseFilter(small_lab, PARAMETERS, ANGLES, tables=worker, clock=clock)
    header = RunHeader(lab_name="small", lab_sha256="", parameters=PARAMETERS, sensor_angles=ANGLES)
    controller = LiveController(header, localizer, make_drive("explore", small_lab, PARAMETERS, ANGLES))
    controller.exchange.is_relayed = True
    return localizer.live, controller


def test_where_another_process_answers_nothing_is_decided_for_what_is_past(
    small_lab, coarse_tables, fine_tables
):
    seconds = PARAMETERS.cycle_time / 1000.0
    late = [0.0]
    ticks = itertools.count()
    # Each look at the clock finds it so much later.
    live, controller = relayed_controller(
        small_lab, tables_from(coarse_tables, fine_tables), lambda: late[0] * next(ticks)
    )
    world, robot, measures = simulation(small_lab)
    decided, lags, estimated = [], [], []
    for cycle in range(60):
        # From 20 on a cycle's time is over after one message, of which four come at once.
        late[0] = 3.0 * seconds if cycle >= 20 else 0.0
        newest = cycle < 20 or cycle % 4 == 3
        controller.exchange.news([(measures, 100.0 + seconds * cycle)])
        entry, actions = controller.observe(measures, newest=newest, arrived=100.0 + seconds * cycle)
        decided.append(actions is not None)
        lags.append(live.lag)
        estimated.append(entry.estimate is not None)
        measures = world.step({robot: Actions(left_motor=0.05, right_motor=0.05)})[robot]
    assert lags[:20] == [0] * 20
    assert sum(decided[4:20]) == 16
    assert all(estimated[:20])
    # Three more wait after every four; what is decided then would be of where the robot was.
    assert lags[23::4] == [3 * number for number in range(1, 11)]
    assert not any(decided[20:])
    assert not any(estimated[20:])
    assert len(live.history) == 60
    assert controller.exchange.unanswered == 0  # which the other process counts
    late[0] = 0.0
    controller.observe(measures, arrived=103.0)
    assert live.lag == 0


def test_before_the_tables_come_the_other_process_drives(small_lab):
    seconds = PARAMETERS.cycle_time / 1000.0
    _, controller = relayed_controller(small_lab, tables_from(), lambda: 0.0)
    world, robot, measures = simulation(small_lab)
    decided = []
    for cycle in range(10):
        controller.exchange.news([(measures, 100.0 + seconds * cycle)])
        decided.append(controller.observe(measures, arrived=100.0 + seconds * cycle)[1] is not None)
        measures = world.step({robot: Actions()})[robot]
    # Until the messages show that the simulator keeps real time it may be waiting for this one.
    assert decided == [True] * 3 + [False] * 7
