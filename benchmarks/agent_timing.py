"""Times of the agent to register, to end, and to find its window: real processes on loopback."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from agent.offline.expected_readings import compute_expected_readings
from benchmarks.measure import Row, best_time
from ciberrato.files.lab import read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import cell_readings, ideal_reading, round_reading, sensor_distances
from ciberrato.labs import find_lab
from ciberrato.physics.kinematics import advance, clamp_power, filter_power
from ciberrato.protocol import Acceptance, Measures, decode_actions, encode
from ciberrato.world.parameters import Parameters

REPEATS = 7
STARTS = 20
ANGLES = (0.0, 90.0, -90.0, 180.0)
HOLDING_FOR = 12  # steps on the row y = 7 of the standard lab


def rows() -> Iterator[Row]:
    """Yield what is measured."""
    yield from start_rows()
    yield from end_rows()
    yield from table_rows()


def start_rows() -> Iterator[Row]:
    """Process start to the first registration datagram, beside what Python itself and numpy take.

    In turns, as what else the machine does changes from second to second. All modules are compiled before:
    with ``PYTHONDONTWRITEBYTECODE`` set, ours would be compiled at every start, and not numpy's.
    """
    group = "process start: agent to first registration datagram, simulator to listening"
    works: dict[str, Callable[[], tuple[float, float]]] = {
        "python -c pass": lambda: to_exit(["-c", "pass"]),
        "python -c 'import numpy'": lambda: to_exit(["-c", "import numpy"]),
        "agent": to_registration,
        "agent, until its handlers are in place": to_handlers,
        "simulator": to_listening,
    }
    taken: dict[str, list[tuple[float, float]]] = {who: [] for who in works}
    with compiled_modules():
        for number in range(STARTS + 1):
            for who, work in works.items():
                once = work()
                if number:  # the first one compiles
                    taken[who].append(once)
    least = {who: min(wall for wall, _ in times) for who, times in taken.items()}
    for who, times in taken.items():
        wall, processor = np.median(times, axis=0)
        note = f"median {1e3 * wall:.0f} ms; processor time {1e3 * processor:.0f} ms"
        yield Row(
            group=group,
            who=who,
            seconds=least[who],
            reference=who == "python -c 'import numpy'",
            ours=not who.startswith("python"),
            target=least["python -c 'import numpy'"] if who == "agent" else None,
            note=note,
        )


@contextlib.contextmanager
def compiled_modules() -> Iterator[None]:
    """Set a folder of their own for the compiled modules of the programs that are started."""
    names = ("PYTHONDONTWRITEBYTECODE", "PYTHONPYCACHEPREFIX")
    before = {name: os.environ.pop(name, None) for name in names}
    with tempfile.TemporaryDirectory() as folder:
        os.environ["PYTHONPYCACHEPREFIX"] = folder
        try:
            yield
        finally:
            for name, value in before.items():
                os.environ.pop(name, None)
                if value is not None:
                    os.environ[name] = value


def end_rows() -> Iterator[Row]:
    """Measure SIGINT to the renamed file, and to the end of the process, after twelve steps."""
    group = f"agent: SIGINT to file, {HOLDING_FOR} steps"
    times = np.array([to_file() for _ in range(REPEATS)])
    yield Row(group=group, who="file in place", seconds=float(times[:, 0].min()), ours=True, reference=True)
    yield Row(group=group, who="process ended", seconds=float(times[:, 1].min()), ours=True)


def table_rows() -> Iterator[Row]:
    """Measure the expected readings of the standard lab: 392 readings, and those at 27 pose errors."""
    group = "agent: expected readings of the standard lab"
    lab = read_lab(find_lab("standard"))
    readings = best_time(lambda: cell_readings(lab, ANGLES))
    plain = best_time(lambda: compute_expected_readings(lab, ANGLES))
    spread = best_time(lambda: compute_expected_readings(lab, ANGLES, Parameters()))
    yield Row(group=group, who="392 readings", seconds=readings, ours=True, reference=True, target=0.002)
    yield Row(group=group, who="and openings, free cells", seconds=plain, ours=True)
    yield Row(group=group, who="and 27 x 392 at pose errors", seconds=spread, ours=True, target=0.060)


def ended(process: subprocess.Popen[bytes], start: float) -> tuple[float, float]:
    """Return the seconds since the start and the processor time of a process, which ends or is ended now."""
    taken = time.perf_counter() - start
    _, _, used = os.wait4(process.pid, 0)
    process.returncode = 0
    return taken, used.ru_utime + used.ru_stime


def to_exit(arguments: Sequence[str]) -> tuple[float, float]:
    start = time.perf_counter()
    process = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.DEVNULL)
    os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
    return ended(process, start)


def to_registration() -> tuple[float, float]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as main, tempfile.TemporaryDirectory() as folder:
        main.bind(("127.0.0.1", 0))
        main.settimeout(30.0)
        start = time.perf_counter()
        process = start_agent(main.getsockname()[1], Path(folder))
        main.recv(2000)
        process.kill()
        return ended(process, start)


def to_listening() -> tuple[float, float]:
    command = [sys.executable, "-m", "simulator_stub", "--bind", "127.0.0.1", "--port", "0", "--quiet"]
    start = time.perf_counter()
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        while b"listening" not in process.stdout.readline():
            pass
        process.kill()
        return ended(process, start)


def to_handlers() -> tuple[float, float]:
    code = (
        "import agent.run.signals as s, os; i = s.Interrupts(); i.install(); os.write(1, b'.'); os._exit(0)"
    )
    return to_exit(["-c", code])


def start_agent(port: int, folder: Path) -> subprocess.Popen[bytes]:
    files = ["--log", str(folder / "run.jsonl"), "-o", str(folder / "localization.out")]
    command = [sys.executable, "-m", "agent", "-h", f"127.0.0.1:{port}", "--quiet", "--silence", "30", *files]
    return subprocess.Popen(command, stderr=subprocess.DEVNULL)


def to_file() -> tuple[float, float]:
    """Drive from (5, 7) to the wall, send SIGINT, and time the file and the end of the process."""
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder) / "localization.out"
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as main:
            main.bind(("127.0.0.1", 0))
            main.settimeout(30.0)
            process = start_agent(main.getsockname()[1], Path(folder))
            serve(main)
        watch = os.pidfd_open(process.pid)
        start = time.perf_counter()
        os.kill(process.pid, signal.SIGINT)
        while not output.exists():
            time.sleep(0.0002)
        in_place = time.perf_counter() - start
        select.select((watch,), (), ())
        ended = time.perf_counter() - start
        os.close(watch)
        assert process.wait() == 0
        assert output.read_text().count("\n\n") == HOLDING_FOR + 1
    return in_place, ended


def serve(main: socket.socket) -> None:
    """Simulate one robot without motor noise, until it has stood before the wall for some cycles."""
    walls = WallMap.from_lab(read_lab(find_lab("standard")))
    generator = np.random.default_rng(1)
    x, y, heading, left, right = 5.0, 7.0, 0.0, 0.0, 0.0
    _, client = main.recvfrom(2000)
    main.sendto(encode(Acceptance(parameters=Parameters(sim_time=0))), client)
    standing = -1
    time_now = 0
    while standing < 20:
        directions = heading + np.radians(ANGLES)
        ideal = ideal_reading(sensor_distances(walls, x, y, directions))
        front, on_left, on_right, back = round_reading(ideal + 0.1 * generator.standard_normal(4)).tolist()
        message = Measures(
            time=time_now, start=True, collision=False, compass=0.0, infrared=(front, on_left, on_right, back)
        )
        main.sendto(encode(message), client)
        actions = decode_actions(main.recv(2000))
        command = actions.left_motor or 0.0, actions.right_motor or 0.0
        right = filter_power(clamp_power(command[1]), right)
        left = filter_power(clamp_power(command[0]), left)
        x, y, heading = advance(x, y, heading, left, right)
        time_now += 1
        standing = standing + 1 if x > 26.99 and command == (0.0, 0.0) else 0
