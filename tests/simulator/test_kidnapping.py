from __future__ import annotations

import math

import pytest

from ciberrato.files.lab import default_lab
from ciberrato.files.start_grid import default_grid
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.world.parameters import Parameters
from simulator_stub.service.kidnapping import Kidnapper, Kidnapping, parse_kidnapping
from simulator_stub.simulation import Simulation


def test_a_kidnapping_is_read_from_text():
    assert parse_kidnapping("120:5,7.5,-90") == Kidnapping(120, 5.0, 7.5, -90.0)


@pytest.mark.parametrize("text", ["", "5", "5:1,2", "x:1,2,3", "5:1,2,nan", "-5:1,2,3", "5:1,2,3,4"])
def test_other_text_is_refused(text):
    with pytest.raises(ValueError, match="CYCLE:X,Y,DIR"):
        parse_kidnapping(text)


def test_the_robot_is_elsewhere_from_that_cycle_on_and_drives_on_from_there():
    simulation = Simulation(default_lab(), default_grid(), Parameters(motors_noise=0.0))
    robot = simulation.register(RobotRegistration(name="victim"))
    assert robot is not None
    simulation.launch()
    kidnapper = Kidnapper([Kidnapping(5, 5.0, 7.0, 90.0)])
    poses = []
    for _ in range(6):
        simulation.begin_cycle()
        simulation.act(robot, Actions(left_motor=0.1, right_motor=0.1))
        kidnapper.before_move(simulation)
        simulation.advance()
        simulation.end_cycle()
        poses.append(tuple(simulation.poses()[0]))
    assert poses[3][:2] == (pytest.approx(9.0 + 0.05 + 0.075 + 0.0875 + 0.09375), 3.0)
    assert poses[4] == pytest.approx((5.0, 7.0 + 0.096875, math.pi / 2))
    assert poses[5] == pytest.approx((5.0, 7.0 + 0.096875 + 0.0984375, math.pi / 2))
