"""Keeps away from walls. Usage: agent.py HOST:PORT POSITION NAME."""

import sys

from ciberrato import Robot

host, position, name = sys.argv[1:]
with Robot(name, host, position=int(position), angles=(0, 60, -60, 180)) as robot:
    for measures in robot:
        front, left, right, _ = (value or 0.0 for value in measures.infrared)
        robot.visiting_led(measures.ground is not None and measures.ground >= 0)  # on a target
        if front > 1.5:
            robot.drive(0.1, -0.1)
        elif left > 3.0:
            robot.drive(0.12, 0.08)
        elif right > 3.0:
            robot.drive(0.08, 0.12)
        else:
            robot.drive(0.12, 0.12)
