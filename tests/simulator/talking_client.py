"""A robot's client that answers some Measures with several motor commands, and some not at all.

Every command says which Measures it answers, and whether it is the last one to do so: the left motor is
Time / 100000, the right motor 0.001 times the number of commands that are left, this one included.

usage: talking_client.py KIND PORT CYCLES SEED SILENT DOZE
"""

import random
import re
import socket
import sys
import time

kind, port, cycles, seed, silent, doze = sys.argv[1], *(float(text) for text in sys.argv[2:])
rng = random.Random(int(seed))
address = ("127.0.0.1", int(port))
REGISTRATION = b'<Robot Id="1" Name="talker"/>\0'
udp = kind == "udp"
own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM if udp else socket.SOCK_STREAM)
own.settimeout(300.0)
pending = b""


def receive() -> bytes:
    """Wait for the next message."""
    global pending
    if udp:
        return own.recv(4096)
    while b"\0" not in pending:
        data = own.recv(4096)
        if not data:
            sys.exit()
        pending += data
    message, pending = pending.split(b"\0", 1)
    return message


if udp:
    own.sendto(REGISTRATION, address)
    _, address = own.recvfrom(4096)  # the Reply
    own.connect(address)
else:
    own.connect(address)  # without TCP_NODELAY, as the simplest client does
    own.send(REGISTRATION)
    receive()
while True:
    found = re.search(rb'Measures Time="(\d+)"', receive())
    assert found
    measured = int(found[1])
    commands = rng.randint(1, 5) if rng.random() < 0.3 else 1
    if measured > 3 and rng.random() < silent:
        commands = 0
    for left in range(commands, 0, -1):
        own.send(b'<Actions LeftMotor="%.5f" RightMotor="%.3f"/>\0' % (measured / 100_000, left / 1000))
        if doze and left > 1:
            time.sleep(doze)
    if measured >= cycles:
        break
