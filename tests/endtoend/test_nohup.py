"""Programs that are started with ``nohup`` outlive their terminal; others end with it."""

import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest

LAB = '<Lab Name="small" Height="4" Width="6"/>'
PATIENCE = 300.0  # seconds; only a failure takes so long


@pytest.mark.parametrize("ignored", [True, False], ids=["nohup", "terminal"])
@pytest.mark.parametrize(
    ("command", "ready", "number", "status", "hung_up"),
    [
        ("simulator --port 0 --bind 127.0.0.1", "listening on tcp", signal.SIGTERM, 0, -signal.SIGHUP),
        ("viewer --simulator 127.0.0.1:{port} --http 0", "page: ", signal.SIGTERM, 0, -signal.SIGHUP),
        ("agent -h 127.0.0.1:{port}", "waiting for a simulator", signal.SIGTERM, 128 + 15, 128 + 1),
        (
            "evaluate --lab small_lab.xml --jobs 1 --resolution 0.5",
            "the filter's loops",
            signal.SIGINT,
            130,
            -signal.SIGHUP,
        ),
    ],
    ids=["simulator", "viewer", "agent", "evaluate"],
)
def test_a_terminal_that_closes(command, ready, number, status, hung_up, ignored, tmp_path):
    (tmp_path / "small_lab.xml").write_text(LAB)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        program, *words = command.format(port=silent.getsockname()[1]).split()
        trap = "trap '' HUP; " if ignored else ""
        path = str(Path(sys.executable).with_name(f"ciberrato-{program}"))
        with subprocess.Popen(
            ["sh", "-c", f'{trap}exec "$@"', "sh", path, *words],
            cwd=tmp_path,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        ) as process:
            watchdog = threading.Timer(PATIENCE, process.kill)
            watchdog.start()
            assert any(ready in line for line in process.stdout)
            process.send_signal(signal.SIGHUP)
            process.send_signal(number)
            said = process.stdout.read()
            watchdog.cancel()
            assert process.wait() == (status if ignored else hung_up), said
