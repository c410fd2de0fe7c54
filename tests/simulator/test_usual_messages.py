"""The short path from readings to datagrams: to the byte what the long one sends."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ciberrato.files.lab import read_lab
from ciberrato.labs import find_lab
from ciberrato.protocol import Actions, Measures, RobotRegistration, encode
from ciberrato.protocol.measures_text import usual_measures
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

NUMBERS = st.floats() | st.integers(-10_000, 10_000).map(lambda tenths: tenths / 10.0)


@given(
    st.integers(0, 10**9),
    st.booleans(),
    NUMBERS,
    st.integers(-1, 99),
    st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS),
    st.integers(0, 127),
    st.tuples(*[st.booleans()] * 5),
)
def test_usual_datagrams_are_those_of_the_general_encoder(
    time: int,
    collision: bool,
    compass: float,
    ground: int,
    infrared: tuple[float, float, float, float],
    marks: int,
    switches: tuple[bool, ...],
) -> None:
    line = f"{marks:07b}"
    data = usual_measures(time, collision, compass, ground, infrared, line, switches)
    names = ("end_led", "returning_led", "visiting_led", "start", "stop")
    measures = Measures(
        time=time,
        collision=collision,
        compass=compass,
        ground=ground,
        infrared=infrared,
        line=line,
        **dict(zip(names, switches, strict=True)),
    )
    if any(math.isnan(value) for value in (compass, *infrared)):
        assert data is None
    else:
        assert data == encode(measures)


@pytest.mark.parametrize(
    ("usual", "changes"),
    [
        (True, {}),
        (True, {"obstacle_latency": 2, "compass_latency": 1, "collision_latency": 3}),
        (False, {"gps": True}),
        (False, {"score_sensor": True}),
        (False, {"compass_sensor": False}),
        (False, {"obstacle_requestable": True, "requests_per_cycle": 2}),
        (False, {"ground_requestable": True, "collision_requestable": True, "requests_per_cycle": 1}),
        (False, {"beacon_sensor": True}),
    ],
)
def test_a_cycle_is_sent_as_the_measures_of_a_twin_are_encoded(usual: bool, changes: dict[str, Any]) -> None:
    """Two robots that drive, speak, light LEDs, ask for sensors and end, some of it in the same cycle."""
    grid = StartGrid(positions=(GridPosition(x=3.0, y=3.0), GridPosition(x=7.0, y=3.0, direction_deg=90.0)))
    twins = [
        Simulation(read_lab(find_lab("maze")), grid, replace(Parameters(sim_time=60), **changes), seed=3)
        for _ in range(2)
    ]
    for twin in twins:
        for _ in range(2):
            twin.register(RobotRegistration())
        twin.launch()
    assert [twin._equipment[1].usual is not None for twin in twins] == [usual, usual]
    rng = np.random.default_rng(5)
    for cycle in range(70):
        actions = Actions(
            left_motor=float(rng.uniform(-0.2, 0.2)),
            right_motor=float(rng.uniform(0.0, 0.2)),
            say="hello" if rng.random() < 0.2 else None,
            visiting_led=bool(rng.random() < 0.3) or None,
            end_led=True if cycle == 50 else None,
            requests=("IRSensor1", "Ground", "Collision") if rng.random() < 0.5 else (),
        )
        for twin in twins:
            twin.begin_cycle()
            twin.act(1 + cycle % 2, actions)
            if cycle == 40:
                twin.stop()
            if cycle == 43:
                twin.start()
            if cycle == 60:
                twin.remove(2)
        messages = twins[1].advance_encoded()
        assert messages == {robot: encode(measures) for robot, measures in twins[0].advance().items()}
        for twin in twins:
            twin.end_cycle()
