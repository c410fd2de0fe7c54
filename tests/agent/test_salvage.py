"""Logs with torn lines, as a machine leaves them that goes down: all readers take --salvage."""

from pathlib import Path

import pytest

from agent.cli import main
from agent.views.logfollower import LogFollower
from ciberrato import find_lab
from ciberrato.errors import LabError
from ciberrato.files.run_log import RunWriter, read_run
from ciberrato.viewer.cli import main as viewer
from ciberrato.viewer.recording import load_recording
from tests.library.test_runlog import CYCLES, HEADER


@pytest.fixture
def torn(tmp_path: Path) -> Path:
    """A log of two steps, the cycle between them torn."""
    path = tmp_path / "run.jsonl"
    lab = find_lab("corridors")
    import dataclasses
    import hashlib

    header = dataclasses.replace(HEADER, lab_sha256=hashlib.sha256(lab.read_bytes()).hexdigest())
    with RunWriter(path, header) as writer:
        for cycle in CYCLES:
            writer.write(cycle)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:2], lines[2][:40], lines[3].replace('"step":1', '"step":2'), ""]))
    return path


def test_a_follower_reads_what_read_run_reads(torn: Path) -> None:
    with pytest.raises(LabError, match=":3: not a line of JSON"):
        LogFollower(torn).poll()
    told: list[str] = []
    follower = LogFollower(torn, salvage=told.append)
    assert follower.poll()
    others: list[str] = []
    assert follower.run == read_run(torn, salvage=others.append)
    assert told == others
    assert len(told) == 2


def test_the_viewer_shows_it(torn: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told: list[str] = []
    session = load_recording(torn, None, (0, 0), salvage=told.append)
    assert session.world.lab is not None
    assert len(told) == 2
    assert viewer(["--run", str(torn), "--http", "127.0.0.1:0"]) == 2
    assert "not a line of JSON" in capsys.readouterr().err


def test_the_agents_commands_show_it(torn: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = torn.parent / "truth.csv"
    truth.write_text("run,time,robot,x,y,direction\n0,0,1,3,3,0\n0,21,1,5,3,0\n")
    figure = torn.parent / "errors.png"
    draw = ["draw", "errors", "-o", str(figure), "--run", str(torn), "--truth", str(truth)]
    watch = ["watch", str(torn), "-m", "corridors", "--once"]
    for command in (draw, watch):
        assert main(command) == 2
        assert ":3: not a line of JSON" in capsys.readouterr().err
    assert not figure.exists()
    assert main([*watch, "--salvage"]) == 0
    assert "steps 1 to 1 are missing" in capsys.readouterr().err
    main([*draw, "--salvage"])
    assert "not a line of JSON" in (told := capsys.readouterr().err)
    assert "the line is left out" in told
