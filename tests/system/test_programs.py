"""The programs on this system, and on Windows and macOS as far as Linux can pretend to be them.

What comes out elsewhere is compared with what comes out here, byte for byte.
"""

import json
import re
import urllib.request

import pytest

from tests.system.programs import System, program, until

TRANSPORTS = ("udp", "tcp")
OUTCOME = ("localization.out", "run.jsonl", "log.xml", "result.json")
COURSE = """
seeds = [1]
[[lab]]
name = "open"
set = { SimTime = 100 }
[[agent]]
name = "follower"
command = "python agent.py {host}:{port} {pos} {name}"
folder = "course/agents/follower"
"""
SLEEPER = "import subprocess, sys; subprocess.run([sys.executable, '-c', 'import time; time.sleep(600)'])"


def drive(system, folder, transport):
    """Let the agent drive in lockstep to the end; return what it left, by name of the file."""
    folder.mkdir()
    simulator = (
        *(program("simulator"), "--lab", "corridors", "--grid", "corridors", "--seed", "1", "--port", "0"),
        *("--bind", "127.0.0.1", "--transport", transport, "--autostart", "1", "--lockstep"),
        *("--reproducible", "--log", "log.xml", "--result", "result.json"),
    )
    with system.running(folder, *simulator) as simulation:
        port = until(simulation, rf"{transport} \S+:(\d+)")[1]
        system.run(
            folder,
            *(program("agent"), "-h", f"127.0.0.1:{port}", "-m", "corridors", "--transport", transport),
            *("--drive", "goto:3,7", "--exit-when-finished", "--lockstep", "--log", "run.jsonl"),
        )
        status, said = system.interrupt(simulation)
        assert status == 0, said
    return {name: (folder / name).read_bytes() for name in OUTCOME}


@pytest.fixture(scope="module")
def driven_here(tmp_path_factory):
    folder = tmp_path_factory.mktemp("here")
    system = System("here", folder)
    return {transport: drive(system, folder / transport, transport) for transport in TRANSPORTS}


@pytest.mark.slow
@pytest.mark.parametrize("transport", TRANSPORTS)
def test_a_run_in_lockstep_here(driven_here, transport):
    assert b"<" in driven_here[transport]["log.xml"]
    assert driven_here[transport]["localization.out"]


@pytest.mark.slow
@pytest.mark.parametrize("transport", TRANSPORTS)
def test_a_run_in_lockstep_elsewhere_is_the_same(elsewhere, driven_here, transport, tmp_path):
    driven = drive(elsewhere, tmp_path / "run", transport)
    assert elsewhere.saw(elsewhere.name)
    assert driven["localization.out"] == driven_here[transport]["localization.out"]
    assert without_clock(driven) == without_clock(driven_here[transport])
    if elsewhere.name == "windows":
        assert elsewhere.saw("exclusive")


def without_clock(driven):
    """What a run left, without what a clock says."""
    return {name: re.sub(rb'"(decision_ms|wall|cpu_ms)": ?[\d.]+', b"", data) for name, data in driven.items()}
