"""The command line: mistakes are one line and status 2; what is printed when things end oddly."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from agent.cli import main
from ciberrato.files.run_log import RunWriter
from ciberrato.files.run_records import RunHeader
from ciberrato.world.parameters import Parameters

REPOSITORY = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def fails(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("ciberrato-agent: ")
    assert captured.err.count("\n") == 1
    return captured.err


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--no-such-option"], "unrecognized arguments: --no-such-option (see ciberrato-agent --help)"),
        (["run.jsonl"], "there is no subcommand 'run.jsonl'; there are localize, inspect, draw, compare"),
        (["inspekt", "x.out"], "did you mean 'inspect'?"),
        (["lokalize"], "did you mean 'localize'?"),
        (["-h"], "argument -h/--host: expected one argument"),
        (["-h", "a:b:c"], "address 'a:b:c': more than one colon"),
        (["-h", "host:99999"], "port '99999' is not a number from 1 to 65535"),
        (["-h", "no.such.host.invalid"], "host 'no.such.host.invalid' cannot be found"),
        (["-p", "-1"], "argument -p/--pos: '-1' is not a whole number"),
        (["-p", "one"], "argument -p/--pos: 'one' is not a whole number"),
        (["-r", "x" * 300], "argument -r/--robname: a name has at most 200"),
        (["-m", "nowhere"], "'nowhere' is neither a file nor a lab that ships; these ship: corridors"),
        (["-m", "standart"], "did you mean 'standard'?"),
        (["-m", "coridors"], "did you mean 'corridors'?"),
        (["-h", ":"], "address ':': the host is missing"),
        (["-m", "."], ".: is a directory"),
        (["--transport", "smoke"], "argument --transport: invalid choice: 'smoke'"),
        (["--preset", "best"], "argument --preset: invalid choice: 'best'"),
        (["--distance", "far"], "argument --distance: invalid choice: 'far'"),
        (["--angles", "0,90"], "'0,90' is not four angles"),
        (["--angles", "0,90,x,180"], "'0,90,x,180' is not four angles"),
        (["--angles", "0,90,inf,180"], "'0,90,inf,180' is not four angles"),
        (["--online", "--start", "here"], "'here' is not anywhere, centres, centres:DEGREES, X,Y or X,Y,DEG"),
        (["--online", "--start", "1,2,3,4"], "argument --start: '1,2,3,4' is not anywhere"),
        (["--online", "--start", "40,2"], "start 40,2: outside the lab, which is 28 by 14 units"),
        (["--online", "--start", "1.9,3"], "start 1.9,3: less than a robot's radius from a wall"),
        (["--drive", "goto:99,99"], "goto:99,99: outside the lab, which is 28 by 14 units"),
        (["--drive", "goto:2,3"], "goto:2,3: less than a robot's radius from a wall"),
        (["--drive", "exlpore"], "did you mean 'explore'?"),
        (["--cruise", "0"], "'0' is not a motor command"),
        (["--cruise", "0.16"], "'0.16' is not a motor command"),
        (["--cruise", "nan"], "'nan' is not a motor command"),
        (["--precision", "1"], "'1' is not a number of decimals from 2 to 17"),
        (["--silence", "0"], "'0' is not a number of seconds"),
        (["--give-up-after", "inf"], "'inf' is not a number of seconds"),
        (["-o", "nowhere/localization.out"], "there is no directory nowhere"),
        (["--log", "nowhere/run.jsonl"], "there is no directory nowhere"),
        (["-o", "."], ".: is a directory; give a file"),
        (["-o", "x", "--log", "./x"], "--log and --output both name x"),
        (["localize"], "the following arguments are required: RUN"),
        (["localize", "none.jsonl", "-m", "maze"], "none.jsonl: cannot read the log: No such file"),
        (["inspect"], "the following arguments are required: FILE"),
        (["inspect", "none.out"], "none.out"),
    ],
)
def test_mistakes_are_one_line(
    arguments: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert complaint in fails(arguments, capsys)


@pytest.mark.parametrize(
    ("contents", "complaint"),
    [
        (b"", "lab.xml"),
        (b"<Lab>", "lab.xml:1"),
        (b'<Lab Width="28" Height="1"/>', "lab.xml:1: Lab Height"),
    ],
)
def test_broken_labs_are_refused_before_the_robot_registers(
    contents: bytes, complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("lab.xml").write_bytes(contents)
    assert complaint in fails(["-m", "lab.xml", "-h", "127.0.0.1:9"], capsys)


@pytest.mark.parametrize("command", [[], ["localize", "run.jsonl"]])
def test_labs_with_mistakes_are_told_and_refused_if_asked(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "odd.xml").write_text('<Lab Width="8"\n Heigth="4"><Beacon X="9" Y="1"/></Lab>')
    RunWriter(Path("run.jsonl"), HEADER).close()
    assert main([*command, "-m", "odd.xml", "--strict"]) == 2
    told = [line.removeprefix("ciberrato-agent: ") for line in capsys.readouterr().err.splitlines()]
    assert told == [
        'odd.xml:2: Lab Heigth="4" means nothing and is passed over, so that Height is 16; '
        "did you mean Height?",
        "odd.xml:2: beacon 0 at (9, 1) is outside the lab and no robot sees it",
        "--strict: 2 warnings about the files; correct them, or leave it out",
    ]


def test_a_file_that_cannot_be_written_is_told_before_the_run(capsys: pytest.CaptureFixture[str]) -> None:
    if os.geteuid() == 0:
        pytest.skip("nothing is forbidden to root")
    Path("closed").mkdir(mode=0o500)
    assert "permission denied" in fails(["-o", "closed/localization.out"], capsys)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ["--exit-at-wall", "--drive", "explore"],
            "--exit-at-wall is for --drive right only: explore drives",
        ),
        (["--exit-at-wall", "--drive", "goto:5,7"], "--exit-at-wall is for --drive right only: goto drives"),
        (["--exit-when-finished"], "--exit-when-finished is for --drive active and goto: right has"),
    ],
    ids=lambda value: " ".join(value[:3]) if isinstance(value, list) else None,
)
def test_an_option_without_effect_is_refused(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert message in fails(["-h", "127.0.0.1:9", "--give-up-after", "0.05", *words], capsys)
    assert list(Path().iterdir()) == []


def test_inspecting_a_log_says_what_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    RunWriter(Path("run.jsonl"), HEADER).close()
    message = fails(["inspect", "run.jsonl"], capsys)
    assert "run.jsonl: this is the log of a run, not a belief file like localization.out: " in message
    assert "ciberrato-agent localize run.jsonl -m LAB" in message


def test_nobody_answers(capsys: pytest.CaptureFixture[str]) -> None:
    message = fails(["-h", "127.0.0.1:9", "--give-up-after", "0.05"], capsys)
    assert message == "ciberrato-agent: no simulator has answered at 127.0.0.1:9 in 0.05 s\n"
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize("words", [[], ["localize"], ["inspect"]])
def test_help_names_every_option(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main([*words, "--help"])
    assert caught.value.code == 0
    text = capsys.readouterr().out
    assert "--help" in text
    assert len(max(text.splitlines(), key=len)) <= 110
    for option in {"": ["-h", "-p", "-r", "-m"], "localize": ["-m", "-o"], "inspect": ["--png"]}[
        " ".join(words)
    ]:
        assert option in text


HEADER = RunHeader(
    lab_name="maze_lab.xml",
    lab_sha256="0" * 64,
    parameters=Parameters(),
    sensor_angles=(0.0, 90.0, -90.0, 180.0),
)


def test_a_log_without_steps_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    RunWriter(Path("run.jsonl"), HEADER).close()
    assert main(["localize", "run.jsonl", "-m", "maze", "--force"]) == 2
    errors = capsys.readouterr().err
    assert "recorded with maze_lab.xml, whose contents differ" in errors
    assert "no step was recorded" in errors
    assert not Path("localization.out").exists()


@pytest.fixture
def recorded(fake_simulator: Callable[..., Any], capsys: pytest.CaptureFixture[str]) -> None:
    """A run.jsonl and its localization.out, of three cells."""
    simulator = fake_simulator(Parameters(sim_time=0), (23.0, 7.0, 0.0))
    assert main(["-h", f"127.0.0.1:{simulator.port}", "--exit-at-wall", "--seed", "5"]) == 0
    capsys.readouterr()


@pytest.mark.usefixtures("recorded")
def test_localize_repeats_what_the_run_wrote(capsys: pytest.CaptureFixture[str]) -> None:
    lines = Path("run.jsonl").read_text().splitlines()
    assert json.loads(lines[0])["seed"] == 5
    assert sum('"step"' in line for line in lines) == 3
    assert main(["localize", "run.jsonl", "-m", "standard", "-o", "again.out"]) == 0
    assert Path("again.out").read_bytes() == Path("localization.out").read_bytes()
    assert "most likely cell" in capsys.readouterr().out


def test_a_log_that_names_no_lab_needs_one_and_takes_any(capsys: pytest.CaptureFixture[str]) -> None:
    RunWriter(Path("run.jsonl"), replace(HEADER, lab_name="")).close()
    assert "run.jsonl does not say in which lab it was recorded" in fails(["localize", "run.jsonl"], capsys)
    told = fails(["localize", "run.jsonl", "-m", "maze"], capsys)
    assert "no step was recorded" in told
    assert "differ" not in told


@pytest.mark.usefixtures("recorded")
def test_localize_finds_the_lab_by_what_it_holds(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["localize", "run.jsonl", "-o", "again.out"]) == 0
    assert Path("again.out").read_bytes() == Path("localization.out").read_bytes()
    lines = Path("run.jsonl").read_text().splitlines()
    header = json.loads(lines[0]) | {"lab_sha256": "0" * 64}
    Path("other.jsonl").write_text("\n".join([json.dumps(header), *lines[1:]]) + "\n")
    capsys.readouterr()
    assert "-m LAB is needed: other.jsonl names its lab (standard_lab.xml)" in fails(
        ["localize", "other.jsonl"], capsys
    )


@pytest.mark.usefixtures("recorded")
def test_localize_refuses_another_lab(capsys: pytest.CaptureFixture[str]) -> None:
    told = fails(["localize", "run.jsonl", "-m", "maze", "-o", "other.out"], capsys)
    assert "was recorded with standard_lab.xml, whose contents differ" in told
    assert "give the lab of that run, or --force" in told
    assert not Path("other.out").exists()
    assert main(["localize", "run.jsonl", "-m", "maze", "-o", "other.out", "--force"]) == 0
    assert "whose contents differ" in capsys.readouterr().err
    assert Path("other.out").exists()


@pytest.mark.usefixtures("recorded")
def test_all_tables_of_a_belief_file_agree(capsys: pytest.CaptureFixture[str]) -> None:
    """What localize prints is what inspect reads in the file, rounding and all."""
    assert main(["localize", "run.jsonl", "-o", "again.out", "--precision", "2"]) == 0
    table = capsys.readouterr().out.splitlines()[:-1]
    assert main(["inspect", "again.out"]) == 0
    assert capsys.readouterr().out.splitlines()[1 : 1 + len(table)] == table


@pytest.mark.usefixtures("recorded")
def test_localize_takes_other_settings(capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--preset", "seed", "--precision", "5", "--quiet"]
    assert main(["localize", "run.jsonl", "-m", "standard", "-o", "other.out", *options]) == 0
    assert capsys.readouterr().out == ""
    first = Path("other.out").read_text().split()[0]
    assert first == "0.01020"


@pytest.mark.usefixtures("recorded")
def test_inspect_shows_the_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["inspect", "localization.out", "-m", "standard"]) == 0
    assert "entropy" in capsys.readouterr().out


@pytest.mark.usefixtures("recorded")
def test_a_reader_that_has_seen_enough_does_no_harm() -> None:
    command = [sys.executable, "-m", "agent", "inspect", str(Path("localization.out").resolve())]
    reading, writing = os.pipe()
    os.close(reading)
    result = subprocess.run(command, cwd=REPOSITORY, stdout=writing, stderr=subprocess.PIPE, check=False)
    os.close(writing)
    assert result.returncode == 0
    assert result.stderr == b""


def test_signals_are_given_back_to_whoever_had_them() -> None:
    import signal

    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
    assert main(["inspect", "none.out"]) == 2
    assert main(["-h", "127.0.0.1:9", "--give-up-after", "0.01"]) == 2
    after = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)]
    assert after == before


def test_the_command_line_offers_what_the_log_knows() -> None:
    from typing import get_args

    from agent.commands.parser import DISTANCES, PRESETS
    from ciberrato.files.run_records import DistanceModel, Preset

    assert set(PRESETS) == set(get_args(Preset))
    assert set(DISTANCES) == set(get_args(DistanceModel))
