"""A small agent that shows a viewer what it believes.

    python -m examples.overlay_agent -h HOST[:PORT] -m LAB

It drives to the right until a wall stops it, filters its IR readings at every cell that it enters, and sends
to the viewer: the belief, a ghost where it takes itself to be, and a note. Run a simulator and
``ciberrato-viewer`` beside it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ciberrato.bayes import update
from ciberrato.files.lab import read_lab
from ciberrato.infrared.model import cell_openings, cell_readings, reading_log_likelihood
from ciberrato.labs import find_lab
from ciberrato.net import UdpLink, parse_address
from ciberrato.net.overlay import OverlayClient
from ciberrato.overlay import OVERLAY_PORT, GridBelief, Line, OverlayMessage, PoseMark, Text
from ciberrato.physics.kinematics import filter_power
from ciberrato.protocol import (
    Acceptance,
    Actions,
    Measures,
    RobotRegistration,
    decode_simulator_message,
    encode,
)
from ciberrato.world.lab import CELL_SIZE, Lab

ANGLES = (0.0, 90.0, -90.0, 180.0)
CRUISE = 0.1
WALL_AHEAD = 1.6
"""Reading of the front sensor, 1/distance, at which the robot stops."""

POSE_SIGMA = 0.25
"""Standard deviation that driving a little beside the centre adds to the readings."""


class ColumnFilter:
    """Place in the lab, if every step leads one cell to the right.

    Parameters
    ----------
    lab : Lab
    sigma : float
        Standard deviation of a reading.
    """

    def __init__(self, lab: Lab, sigma: float) -> None:
        self._ideal = cell_readings(lab, ANGLES)
        self._east, _ = cell_openings(lab)
        self._sigma = sigma
        self.belief: NDArray[np.float64] = np.full((lab.rows, lab.columns), 1.0 / (lab.rows * lab.columns))

    def step_right(self) -> None:
        """Predict a step to the right: no wall lets the robot pass."""
        moved = np.zeros_like(self.belief)
        moved[:, 1:] = np.where(self._east, self.belief[:, :-1], 0.0)
        self.belief = moved

    def sense(self, readings: Sequence[float | None]) -> None:
        """Correct by the readings of the four sensors."""
        log_likelihood = np.zeros_like(self.belief)
        for sensor, reading in enumerate(readings):
            if reading is not None:
                log_likelihood += reading_log_likelihood(reading, self._ideal[..., sensor], self._sigma)
        self.belief = update(self.belief, log_likelihood, on_impossible="likelihood").posterior


def main(arguments: Sequence[str] | None = None) -> int:
    """Drive once through the lab."""
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("-h", "--host", default="127.0.0.1")
    parser.add_argument("-m", "--map", default="corridors")
    parser.add_argument("-p", "--pos", type=int, default=0)
    parser.add_argument("-r", "--robname", default="painter")
    parser.add_argument("--viewer", default=f"127.0.0.1:{OVERLAY_PORT}")
    options = parser.parse_args(arguments)
    lab = read_lab(find_lab(options.map))
    link = UdpLink(*parse_address(options.host))
    registration = RobotRegistration(
        name=options.robname, robot_id=options.pos, sensor_angles=tuple(enumerate(ANGLES))
    )
    link.register(encode(registration))
    reply = link.receive(5.0)
    accepted = decode_simulator_message(reply) if reply is not None else None
    if not isinstance(accepted, Acceptance):
        print("overlay_agent: no simulator took the robot", file=sys.stderr)
        return 2
    sigma = float(np.hypot(accepted.parameters.obstacle_noise, POSE_SIGMA))
    with link, OverlayClient(*parse_address(options.viewer, OVERLAY_PORT)) as viewer:
        _drive(link, viewer, ColumnFilter(lab, sigma), options.robname, options.pos)
    return 0


def _drive(link: UdpLink, viewer: OverlayClient, places: ColumnFilter, name: str, position: int) -> None:
    travelled = power = 0.0
    steps, last_time, done = -1, 0, False
    while (data := link.receive(3.0)) is not None:
        measures = decode_simulator_message(data)
        if not isinstance(measures, Measures):
            continue
        if not measures.start:
            continue
        for _ in range(measures.time - last_time):
            power = filter_power(0.0 if done else CRUISE, power)
            travelled += power
        last_time = measures.time
        entered = int(travelled / CELL_SIZE + 0.02)
        if entered > steps:
            if steps >= 0:
                places.step_right()
            steps = entered
            places.sense(measures.infrared)
            _show(viewer, places, name, position, measures.time, steps)
        front = measures.infrared[0] or 0.0
        done = done or front > WALL_AHEAD
        steer = 0.0 if done or measures.compass is None else -0.004 * measures.compass
        speed = 0.0 if done else CRUISE
        link.send(encode(Actions(left_motor=speed - steer, right_motor=speed + steer)))


def _show(
    viewer: OverlayClient, places: ColumnFilter, name: str, position: int, time: int, steps: int
) -> None:
    row, column = np.unravel_index(int(places.belief.argmax()), places.belief.shape)
    x, y = CELL_SIZE * (column + 0.5), CELL_SIZE * (row + 0.5)
    shapes = (
        PoseMark(id="here", x=x, y=y, direction=0.0, ttl=None),
        Line(id="way", points=((x - CELL_SIZE * steps, y), (x, y)), ttl=None),
        Text(id="note", x=x, y=y + 1.5, text=f"step {steps}", ttl=3.0),
    )
    viewer.send(
        OverlayMessage(
            source=name,
            robot=position or 1,
            time=time,
            angles=ANGLES,
            belief=GridBelief(cells=places.belief),
            shapes=shapes,
        )
    )


if __name__ == "__main__":
    sys.exit(main())
