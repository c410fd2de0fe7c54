"""Ways that tell a few hypotheses apart: against a plain Dijkstra, walked paths, and a lab made for it."""

from __future__ import annotations

import heapq
import math

import numpy as np
import pytest

from agent.drives import disambiguation as planner
from agent.drives.clearance import clearance
from ciberrato.localization.belief.estimate import PoseEstimate
from ciberrato.localization.tables.pose_tables import PoseTables, build_tables
from ciberrato.world.lab import Lab, Target, Wall

ANGLES = (0.0, 60.0, -60.0, 180.0)
NOTHING = np.zeros(8, np.bool_)


def box(x0: float, y0: float, x1: float, y1: float) -> Wall:
    return Wall(height=4.0, corners=((x0, y0), (x1, y0), (x1, y1), (x0, y1)))


def pose(x: float, y: float, heading: float, probability: float = 0.5) -> PoseEstimate:
    return PoseEstimate(x=x, y=y, heading=heading, probability=probability, cell=(int(y // 2), int(x // 2)))


@pytest.fixture(scope="module")
def lanes() -> PoseTables:
    """Two lanes, turned images of one another but for a block beside the left end of the upper one."""
    walls = (box(0.0, 1.95, 14.0, 2.05), box(2.5, 3.45, 3.0, 4.0))
    return build_tables(Lab(name="lanes", width=14.0, height=4.0, walls=walls), ANGLES, 2.0 / 9.0)


def test_the_way_leads_to_where_the_hypotheses_differ(lanes: PoseTables) -> None:
    for heading, turn in ((0.0, 0.0), (math.pi, math.pi)):
        way = planner.plan(lanes, [pose(5.0, 1.0, heading), pose(9.0, 3.0, heading + math.pi)], 0.1, NOTHING)
        assert way is not None
        assert abs(way.turn) == pytest.approx(turn)
        assert way.length > 1.5
        assert way.gain > 0.5


def test_a_wide_belief_expects_to_learn_less(lanes: PoseTables) -> None:
    images = [pose(5.0, 1.0, 0.0), pose(9.0, 3.0, math.pi)]
    sharp, blurred = (
        planner.plan(lanes, images, 0.1, NOTHING, (), wide) for wide in ((0.0, 0.0), (0.4, 0.2))
    )
    assert sharp is not None
    assert blurred is not None
    assert blurred.gain < 0.9 * sharp.gain
    assert sharp == planner.plan(lanes, images, 0.1, NOTHING, (), (0.05, 0.01))


def test_equal_hypotheses_are_not_told_apart(lanes: PoseTables) -> None:
    way = planner.plan(lanes, [pose(5.0, 1.0, 0.0), pose(5.0, 1.0, 0.0)], 0.1, NOTHING)
    assert way is not None
    assert way.gain == pytest.approx(0.0, abs=1e-9)


def test_a_barred_direction_is_not_the_first(lanes: PoseTables) -> None:
    barred = np.zeros(8, np.bool_)
    barred[0] = True
    way = planner.plan(lanes, [pose(5.0, 1.0, 0.0), pose(5.0, 3.0, 0.0)], 0.1, barred)
    assert way is not None
    assert abs(way.turn) > 0.1


def test_no_way_where_every_place_is_blocked_for_one(lanes: PoseTables) -> None:
    # One lane lies along, the other across: what is free for one is not for the other, but for a step.
    barred = np.ones(8, np.bool_)
    assert planner.plan(lanes, [pose(5.0, 1.0, 0.0), pose(5.0, 3.0, 0.0)], 0.1, barred) is None


def test_places_are_free_under_all_hypotheses(lanes: PoseTables) -> None:
    poses = np.array([(5.0, 1.0, 0.0), (11.9, 3.0, 0.3), (4.0, 1.1, math.pi)])
    free = planner._free(lanes, poses)
    ahead, left = planner._relative()
    assert 3 < free.sum() < 100
    for k in np.argwhere(free):
        forward, aside = ahead[tuple(k)], left[tuple(k)]
        if math.hypot(forward, aside) < planner._LEAVING:
            continue
        for x, y, heading in poses:
            there_x = x + forward * math.cos(heading) - aside * math.sin(heading)
            there_y = y + forward * math.sin(heading) + aside * math.cos(heading)
            assert clearance(lanes.lattice, np.array([there_x]), np.array([there_y]))[0] >= planner._CLEARANCE


def test_times_are_those_of_dijkstra() -> None:
    generator = np.random.default_rng(3)
    free = generator.random((planner._SIDE, planner._SIDE)) < 0.7
    middle = planner._RADIUS
    barred = np.array([False, True, False, False, False, False, False, True])
    times, _ = planner._quickest(free, barred)
    free[middle, middle] = False
    expected = np.full((8, planner._SIDE, planner._SIDE), np.inf)
    queue = []

    def arrive(cost: float, direction: int, row: int, column: int) -> None:
        dx, dy = planner._MOVES[direction]
        row, column = row + dy, column + dx
        cost += planner._LENGTHS[direction] / planner._SPEED
        inside = 0 <= row < planner._SIDE and 0 <= column < planner._SIDE
        if inside and free[row, column] and cost < min(expected[direction, row, column], planner._LONGEST):
            expected[direction, row, column] = cost
            heapq.heappush(queue, (cost, direction, row, column))

    for direction in np.flatnonzero(~barred):
        arrive(float(planner._TURN_COSTS[0, direction]), int(direction), middle, middle)
    while queue:
        cost, came, row, column = heapq.heappop(queue)
        for direction in range(8):
            arrive(cost + float(planner._TURN_COSTS[came, direction]), direction, row, column)
    assert np.isfinite(expected).sum() > 500
    reached = np.isfinite(expected)
    assert (np.isfinite(times.reshape(expected.shape)) == reached).all()
    assert times.reshape(expected.shape)[reached] == pytest.approx(expected[reached])


def test_evidence_is_the_sum_along_the_way(lanes: PoseTables) -> None:
    poses = np.array([(5.013, 1.007, 0.0), (5.024, 3.009, 0.0)])  # not on the edge between squares
    times, parents = planner._quickest(planner._free(lanes, poses), NOTHING)
    reached = np.flatnonzero((times < planner._LONGEST) & (parents >= 0))
    predict_readings = planner.PredictedReadings(lanes, 0.1)
    evidence = planner._evidence(predict_readings, poses, times, parents, reached)
    turning = planner._turning(predict_readings, poses)
    start = planner._RADIUS * planner._SIDE + planner._RADIUS
    for number in range(0, len(reached), max(len(reached) // 25, 1)):
        state, total = int(reached[number]), np.zeros((2, 2))
        while state != start:
            direction, node = divmod(state, planner._NODES)
            row, column = divmod(node, planner._SIDE)
            forward = (column - planner._RADIUS) * planner._SPACING
            aside = (row - planner._RADIUS) * planner._SPACING
            angle = np.full((2, 1), direction * math.pi / 4.0)
            readings = predict_readings(poses[:, :1] + forward, poses[:, 1:2] + aside, angle)
            total += planner._apart(readings)[0] * planner._LENGTHS[direction] / planner._SPEED
            if parents[state] == start:
                total += turning[direction]
            state = int(parents[state])
        assert evidence[number] == pytest.approx(total)


def test_where_readings_are_equal_the_way_leads_to_a_target() -> None:
    walls = (box(0.0, 1.95, 14.0, 2.05),)
    tables = build_tables(Lab(name="equal lanes", width=14.0, height=4.0, walls=walls), ANGLES, 2.0 / 9.0)
    turned = [pose(5.0, 1.0, 0.0), pose(9.0, 3.0, math.pi)]
    blind = planner.plan(tables, turned, 0.1, NOTHING)
    assert blind is not None
    assert blind.gain < 1e-6
    way = planner.plan(tables, turned, 0.1, NOTHING, (Target(x=9.0, y=1.0, radius=1.0),))
    assert way is not None
    assert way.turn == pytest.approx(0.0)
    assert 3.0 < way.length < 4.6  # the robot is inside from 0.38 units before the target's middle
    assert way.gain > 0.5
    # Ground evidence by hand: in the disc under one hypothesis alone, never with a target in both lanes.
    x, y = np.array([[9.0, 8.3], [5.0, 5.7]]), np.array([[1.0, 1.0], [3.0, 3.0]])
    one = planner._ground_apart(x, y, (Target(x=9.0, y=1.0, radius=1.0),))
    assert one[:, 0, 1].tolist() == one[:, 1, 0].tolist() == [planner._GROUND, 0.0]
    assert not one[:, 0, 0].any()
