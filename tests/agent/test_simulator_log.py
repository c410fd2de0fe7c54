"""Localizing from a simulator's log: ours, written beside the agent's own, and those of the real one."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from agent.cli import main
from agent.offline.simulator_log import is_simulator_log, run_from_simulator_log
from ciberrato.errors import LabError, UsageError
from ciberrato.files.beliefs import read_beliefs

DATA = Path(__file__).parents[1] / "data" / "golden" / "logs"
FACTORY = (0.0, 60.0, -60.0, 180.0)


@pytest.fixture(scope="module")
def real_log():
    return DATA / "log2_two_robots" / "sim.log.gz"


def test_a_log_of_the_real_simulator_is_read_for_each_robot(real_log):
    for robot in (None, 1, 2):
        run, lab = run_from_simulator_log(real_log, FACTORY, robot=robot)
        assert len(run.cycles) == 401
        assert run.header.robot_position == (robot or 1)
        assert (lab.width, lab.height) == (28, 14)
        assert [cycle.time for cycle in run.cycles] == list(range(401))
        # Robot 2 looks to the left all the time: the published method has no reading of it.
        assert bool(run.steps) is (robot != 2)


def test_readings_of_a_step_are_those_of_its_record(real_log):
    run, _ = run_from_simulator_log(real_log, FACTORY)
    by_time = {cycle.time: cycle.infrared for cycle in run.cycles}
    assert all(step.readings == by_time[step.time] for step in run.steps)


def test_localize_takes_the_lab_from_the_log(real_log, tmp_path, capsys):
    output, plain = tmp_path / "localization.out", tmp_path / "sim.log"
    plain.write_bytes(gzip.decompress(real_log.read_bytes()))
    words = ["localize", str(plain), "-o", str(output), "--angles", "0,60,-60,180", "--robot", "1"]
    assert main(words) == 0
    (run,) = read_beliefs(output)
    assert run.beliefs.shape[1:] == (7, 14)
    assert np.isfinite(run.beliefs).all()
    said = capsys.readouterr()
    assert "written:" in said.out
    # The other robot was in view, and this one did not drive to the right: that is told.
    assert "do not fit a robot that drives to the right alone" in said.err


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b'<Log Date="x">', True),
        (b"\xef\xbb\xbf <?xml version='1.0'?><Log/>", True),
        (gzip.compress(b"<Log>", mtime=0), True),
        (b'{"format":"ciberrato-run"}', False),
        (b"", False),
    ],
)
def test_the_two_kinds_of_log_are_told_apart(content, expected, tmp_path):
    path = tmp_path / "log"
    path.write_bytes(content)
    assert is_simulator_log(path) is expected


def test_what_is_wrong_is_said(real_log, tmp_path, capsys):
    with pytest.raises(UsageError, match="no robot 7; there is 1, 2"):
        run_from_simulator_log(real_log, FACTORY, robot=7)
    with pytest.raises(LabError, match="cannot read the log"):
        is_simulator_log(tmp_path / "none")
    words = ["localize", str(real_log), "-o", str(tmp_path / "x.out"), "--robot", "2"]
    assert main(words) == 2
    assert "never stood looking to the right" in capsys.readouterr().err
    cut = tmp_path / "cut.log"
    cut.write_bytes(b"<Log Date='x'><Parameters/>")
    assert main(["localize", str(cut), "-o", str(tmp_path / "x.out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "x.out").exists()
