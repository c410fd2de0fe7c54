"""Agents that the tests grade: good ones, and such as do harm."""

import textwrap
from pathlib import Path

ROBOT = """
    import sys
    from ciberrato import Robot
    with Robot(sys.argv[3], f"{sys.argv[1]}:{sys.argv[2]}") as robot:
        for measures in robot:
            front, left, right, back = measures.infrared
            robot.drive(0.1, -0.1 if front > 1.2 else 0.1)
"""
LINK = """
    import sys
    from ciberrato.croblink import *
    robot = CRobLinkAngs("link", 1, [0, 60, -60, 180], f"{sys.argv[1]}:{sys.argv[2]}")
    while True:
        robot.readSensors()
        if robot.measures.endLed:
            sys.exit(0)
        robot.driveMotors(-0.1 if robot.measures.irSensor[0] > 1.2 else 0.1, 0.1)
"""
BROKEN = """
    import os, sys, time
    from ciberrato import Robot
    kept = []
    with Robot("broken", f"{sys.argv[1]}:{sys.argv[2]}") as robot:
        for measures in robot:
            robot.drive(0.1, 0.1)
            while measures.time == 20:
                DO
"""
CRASHING = BROKEN.replace("DO", "raise ValueError('<b>a mistake</b>')")
HANGING = BROKEN.replace("DO", "os.fork() or (os.setsid(), time.sleep(1000)); time.sleep(1000)")
FLOODING = BROKEN.replace("DO", "print('x' * 10000)")
EATING = BROKEN.replace("DO", "kept.append(b'1' * 1000000)")
BREEDING = BROKEN.replace("DO", "os.fork() or time.sleep(1000)")
FIXED_PORT_IN_C = r"""
    #include <arpa/inet.h>
    #include <string.h>
    int main(int argc, char **argv) {
        struct sockaddr_in to = {0}, from;
        char data[4096];
        int s = socket(AF_INET, SOCK_DGRAM, 0);
        to.sin_family = AF_INET;
        to.sin_port = htons(6000);
        inet_pton(AF_INET, argv[1], &to.sin_addr);
        const char *hello = "<Robot Name=\"c\"/>", *go = "<Actions LeftMotor=\"0.1\" RightMotor=\"0.1\"/>";
        sendto(s, hello, strlen(hello) + 1, 0, (struct sockaddr *)&to, sizeof to);
        for (;;) {
            socklen_t n = sizeof from;
            ssize_t got = recvfrom(s, data, sizeof data - 1, 0, (struct sockaddr *)&from, &n);
            if (got < 0) return 1;
            data[got] = 0;
            if (strstr(data, "<Measures")) sendto(s, go, strlen(go) + 1, 0, (struct sockaddr *)&from, n);
        }
    }
"""


def write(folder: Path, name: str, program: str, file: str = "agent.py") -> None:
    """Put an agent's program into a folder of its own."""
    place = folder / "agents" / name
    place.mkdir(parents=True, exist_ok=True)
    (place / file).write_text(textwrap.dedent(program))


def table(name: str, command: str = "python agent.py {host} {port} {name}", **more: str) -> str:
    """Write an agent's part of a course."""
    lines = ["[[agent]]", f"name = '{name}'", f"command = '{command}'", f"folder = 'agents/{name}'"]
    return "\n".join([*lines, *(f"{key} = '{value}'" for key, value in more.items())]) + "\n"
