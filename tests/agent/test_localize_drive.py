"""``localize`` with the log of a drive that is not the one to the right: the pose filter weighs it."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from agent.cli import main
from agent.drives.by_sensors import SensorDrive
from ciberrato.files.beliefs import read_beliefs
from ciberrato.files.lab import read_lab
from ciberrato.files.run_log import RunWriter
from ciberrato.files.run_records import Cycle, RunHeader
from ciberrato.protocol import Actions, RobotRegistration
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.simulation import Simulation

ANGLES = (0.0, 60.0, -60.0, 180.0)
LAB = (
    '<Lab Name="small" Height="6" Width="8"><Wall Height="4">'
    '<Corner X="1.9" Y="2"/><Corner X="2.1" Y="2"/>'
    '<Corner X="2.1" Y="6"/><Corner X="1.9" Y="6"/></Wall></Lab>'
)


def test_the_log_of_another_drive_is_weighed_by_the_pose_filter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("CIBERRATO_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    lab = tmp_path / "small_lab.xml"
    lab.write_text(LAB)
    parameters = Parameters(sim_time=0)
    grid = StartGrid(positions=(GridPosition(x=1.0, y=4.2, direction_deg=77.0),))
    simulation = Simulation(read_lab(lab), grid, parameters, seed=3)
    robot = simulation.register(RobotRegistration(name="l", sensor_angles=tuple(enumerate(ANGLES))))
    assert robot is not None
    drive, measures = SensorDrive(ANGLES, 0.1), simulation.launch()[robot]
    digest = hashlib.sha256(lab.read_bytes()).hexdigest()
    header = RunHeader(
        lab_name=lab.name, lab_sha256=digest, parameters=parameters, sensor_angles=ANGLES, precision=6
    )
    with RunWriter(tmp_path / "run.jsonl", header) as writer:
        for number in range(120):
            command = drive.decide(measures).command
            step = {0: 0, 119: 1}.get(number)
            readings = None if step is None else measures.infrared
            writer.write(
                Cycle(
                    time=measures.time,
                    start=True,
                    collision=measures.collision,
                    compass=measures.compass,
                    ground=measures.ground,
                    infrared=measures.infrared,
                    command=command,
                    answered=True,
                    phase="explore",
                    step=step,
                    readings=readings,
                )
            )
            x, y, _ = simulation.poses()[0]
            measures = simulation.step({robot: Actions(left_motor=command[0], right_motor=command[1])})[robot]
    assert main(["localize", "run.jsonl", "-m", "small_lab.xml"]) == 0
    assert "most likely cell" in capsys.readouterr().out
    (run,) = read_beliefs(tmp_path / "localization.out")
    assert run.beliefs.shape == (3, 3, 4)
    assert run.beliefs[-1][int(y // 2), int(x // 2)] > 0.9
    assert main(["localize", "run.jsonl", "-m", "small_lab.xml", "--preset", "seed"]) == 2
    assert "was not driven to the right" in capsys.readouterr().err
