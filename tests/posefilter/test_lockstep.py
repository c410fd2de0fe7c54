"""Real processes in lockstep: the same seed, the same run, to the last byte of what is written."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys

import pytest

from ciberrato.files.run_log import read_run

LAB = (
    '<Lab Name="small" Height="6" Width="8"><Wall Height="4">'
    '<Corner X="1.9" Y="2"/><Corner X="2.1" Y="2"/><Corner X="2.1" Y="6"/>'
    '<Corner X="1.9" Y="6"/></Wall></Lab>'
)
PARAMETERS = '<Parameters SimTime="90" CycleTime="50" MotorsNoise="1.5" ObstacleNoise="0.1"/>'


def run_once(folder, cache, options, *, compiled="auto"):
    """Run simulator and agent to the end; give the log, the beliefs, and what the agent said."""
    folder.mkdir()
    lab, parameters = folder.parent / "small_lab.xml", folder.parent / "params.xml"
    lab.write_text(LAB)
    parameters.write_text(PARAMETERS)
    world = ["--lab", str(lab), "--grid", "3,3,0", "--param", str(parameters), "--seed", "3"]
    simulator = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "simulator_stub",
            *world,
            "--port",
            "0",
            "--autostart",
            "1",
            "--lockstep",
            "--answer-limit",
            "300",
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert simulator.stdout is not None
        simulator.stdout.readline()
        port = re.search(r":(\d+)$", simulator.stdout.readline())
        assert port is not None
        agent = subprocess.run(
            [
                sys.executable,
                "-m",
                "agent",
                "-h",
                f"127.0.0.1:{port[1]}",
                "-m",
                str(lab),
                "--lockstep",
                *options,
            ],
            cwd=folder,
            env=os.environ | {"CIBERRATO_CACHE": str(cache), "CIBERRATO_COMPILED": compiled},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
    finally:
        simulator.send_signal(signal.SIGTERM)
        simulator.wait()
        simulator.stdout.close()
    assert agent.returncode == 0, agent.stderr
    return (folder / "run.jsonl").read_bytes(), (folder / "localization.out").read_bytes(), agent.stderr


@pytest.mark.slow
@pytest.mark.parametrize("policy", [["--drive", "active"], ["--drive", "explore", "--smooth"], ["--online"]])
def test_a_seed_gives_one_run(tmp_path, policy):
    cache = tmp_path / "cache"
    options = [*policy, "--angles", "0,60,-60,180"] if policy[0] == "--drive" else policy
    # The first has to compute its tables, the others find them; the last does without machine code.
    first, second, third = (
        run_once(tmp_path / name, cache, options, compiled=compiled)
        for name, compiled in (("first", "auto"), ("second", "auto"), ("third", "off"))
    )
    assert first[:2] == second[:2] == third[:2]
    assert "(numpy)" in third[2]
    cycles = read_run(tmp_path / "first" / "run.jsonl").cycles
    assert cycles[-1].time >= 89
    assert all(cycle.estimate is not None for cycle in cycles)
    assert cycles[-1].entropy < cycles[0].entropy - 0.5
    assert "cycles without Measures" not in first[2]
    assert len({cycle.command for cycle in cycles}) > 1
