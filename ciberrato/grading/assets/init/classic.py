"""Turns where there is a wall, in the style of croblink. Usage: agent.py -h HOST -p POSITION -r NAME."""

import sys

from ciberrato.croblink import CRobLinkAngs

options = dict(zip(sys.argv[1::2], sys.argv[2::2], strict=True))
robot = CRobLinkAngs(options["-r"], int(options["-p"]), [0, 60, -60, 180], options["-h"])
while True:
    robot.readSensors()
    if robot.measures.endLed:
        sys.exit(0)
    if robot.measures.irSensor[0] > 1.5:
        robot.driveMotors(-0.1, 0.1)
    else:
        robot.driveMotors(0.1, 0.1)
