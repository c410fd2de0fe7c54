"""An agent of the standard library alone, and what can be wrong with it."""

import textwrap
from pathlib import Path

GOOD = """
    import math, re, socket, sys, threading, time

    def robot(host, port, name="plain"):
        link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        link.settimeout(2.0)
        link.sendto(b'<Robot Id="1" Name="%s"/>' % name.encode(), (host, int(port)))  # registering
        reply, simulator = link.recvfrom(4096)
        if b'"Ok"' not in reply:
            sys.exit("refused")  # when refused
        sim_time = int(re.search(rb'SimTime="(\\d+)"', reply)[1])
        last, running, held = 0, False, False  # before the loop
        while True:
            try:
                data = link.recv(4096)
            except TimeoutError:
                break  # when silent
            now = int(re.search(rb'Time="(\\d+)"', data)[1])
            start, stop = b'Start="On"' in data, b'Stop="On"' in data
            held = held or (stop and running)
            running = start
            if now >= sim_time > 0:
                break  # when over
            if now > last + 1:
                pass  # when lost
            if now == last and running and now > 0:
                pass  # when doubled
            if now < last:
                pass  # when late
            last = now
            message = b'<Actions LeftMotor="0.1" RightMotor="0.08"/>'
            # before sending
            link.sendto(message, simulator)

    if __name__ == "__main__":
        robot(*sys.argv[1:3])
"""

# name: (the row that finds it, words of what happened, the line that is changed, what stands there instead)
FAULTS = {
    "registers twice": (
        "register",
        "it has registered 2 robots, not one",
        "last, running, held = 0, False, False  # before the loop",
        """last, running, held = 0, False, False
        other = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        other.sendto(b'<Robot Name="second"/>', (host, int(port)))""",
    ),
    "has a place of its own": (
        "register",
        "it asks for start position 77, which the simulator does not have",
        """link.sendto(b'<Robot Id="1" Name="%s"/>' % name.encode(), (host, int(port)))  # registering""",
        """link.sendto(b'<Robot Id="77" Name="x"/>', (host, int(port)))""",
    ),
    "registers as something else": (
        "register",
        "the registration cannot be understood: Mouse",
        """link.sendto(b'<Robot Id="1" Name="%s"/>' % name.encode(), (host, int(port)))  # registering""",
        """link.sendto(b'<Mouse Name="x"/>', (host, int(port)))""",
    ),
    "knows another port": (
        "register",
        "it ended before it had registered: exit status 1",
        """link.sendto(b'<Robot Id="1" Name="%s"/>' % name.encode(), (host, int(port)))  # registering""",
        """link.sendto(b'<Robot/>', (host, 9))""",
    ),
    "waits when refused": (
        "refused",
        "it was still running 5 s later",
        'sys.exit("refused")',
        "threading.Event().wait()",
    ),
    "falls silent": (
        "answers",
        "no answer to the Measures of time 50",
        "# before sending",
        "if now == 50: continue",
    ),
    "sends nan": (
        "answers",
        "a message after the Measures of time 40",
        "# before sending",
        """if now == 40: message = b'<Actions LeftMotor="nan"/>'""",
    ),
    "sends too much": (
        "answers",
        "after the Measures of time 40 has 1144 bytes; the simulator reads 1023",
        "# before sending",
        "if now == 40: message += b' ' * 1100",
    ),
    "crashes": (
        "answers",
        "no answer to the Measures of time 60 within 2 s; it ended: exit status 1",
        "# before sending",
        "if now == 60: raise ValueError('a mistake')",
    ),
    "is killed": (
        "answers",
        "it ended: signal SIGKILL",
        "# before sending",
        "if now == 60: import os; os.kill(os.getpid(), 9)",
    ),
    "sends by a clock": (
        "unasked",
        "it sent more than 4 messages in 0.5 s without Measures",
        "last, running, held = 0, False, False  # before the loop",
        """last, running, held = 0, False, False
        def drive():
            while True:
                link.sendto(b'<Actions LeftMotor="0.1"/>', simulator)
                time.sleep(0.01)
        threading.Thread(target=drive, daemon=True).start()""",
    ),
    "is impatient": (  # where it is looked for: elsewhere a busy machine is not to show it
        "unasked",
        "it was gone at time 31",
        "# before sending",
        "link.settimeout(0.01 if now == 30 else 2.0)",
    ),
    "leaves at Stop": ("stop-start", "it ended: exit status 0", "# before sending", "if held: break"),
    "stays after Stop": (
        "stop-start",
        "it answers after the pause, but its motors stay at 0 for 60 cycles",
        "# before sending",
        """if held: message = b'<Actions LeftMotor="0" RightMotor="0"/>'""",
    ),
    "counts on every Measures": (
        "lost",
        "it ended: exit status 1",
        "pass  # when lost",
        "raise ValueError('lost')",
    ),
    "divides by the time passed": (
        "doubled",
        "it ended: exit status 1",
        "pass  # when doubled",
        "1 / (now - last)",
    ),
    "takes the root of the time passed": (
        "late",
        "it ended: exit status 1",
        "pass  # when late",
        "math.sqrt(now - last)",
    ),
    "waits for the old time": (
        "restart",
        "no answer to the Measures of time 5",
        "pass  # when late",
        "continue",
    ),
    "waits for ever": ("silence", "it was still running 5 s later", "break  # when silent", "continue"),
    "fails at the end": (
        "end",
        "it ended by an error: exit status 1",
        "break  # when over",
        "raise ValueError('over')",
    ),
    "has a status at the end": (
        "end",
        "it ended by an error: exit status 3",
        "break  # when over",
        "sys.exit(3)",
    ),
}


def write(folder: Path, fault: str | None = None) -> Path:
    """Write the agent, with a fault if one is named."""
    text = textwrap.dedent(GOOD)
    if fault is not None:
        *_, line, instead = FAULTS[fault]
        assert text.count(line) == 1, line
        text = text.replace(line, instead.replace("\n    ", "\n"))
    path = folder / "agent.py"
    path.write_text(text)
    return path
