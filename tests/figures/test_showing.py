"""The subcommands that show, on a run that was really driven."""

import dataclasses
import gzip
import io
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from agent.cli import main
from agent.offline.expected_readings import compute_expected_readings
from agent.offline.localizer import localize
from agent.views.logfollower import LogFollower
from agent.views.watching import screen, watch
from benchmarks.accuracy import ANGLES, drive
from ciberrato.errors import LabError
from ciberrato.files.beliefs import write_beliefs
from ciberrato.files.lab import read_lab
from ciberrato.files.run_log import RunWriter
from ciberrato.files.run_records import Cycle, RunHeader
from ciberrato.labs import find_lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A folder with log, truth and belief file of a drive of five cells in `standard`."""
    folder = tmp_path_factory.mktemp("run")
    lab, parameters = read_lab(find_lab("standard")), Parameters()
    driven = drive(lab, GridPosition(x=19.0, y=7.0), parameters, 5)
    header = RunHeader(
        lab_name="standard_lab.xml",
        lab_sha256="0" * 64,
        parameters=parameters,
        sensor_angles=ANGLES,
        robot_name="tester",
    )
    truth = ["time,robot,x,y,dir_deg,state"]
    with RunWriter(folder / "run.jsonl", header) as writer:
        for crossing, (row, column) in zip(driven.crossings, driven.cells, strict=True):
            writer.write(
                Cycle(
                    time=crossing.time,
                    start=True,
                    infrared=crossing.readings,
                    command=(0.1, 0.1),
                    answered=True,
                    displacement=2.0 * crossing.index,
                    phase="driving",
                    step=crossing.index,
                    readings=crossing.readings,
                )
            )
            truth.append(f"{crossing.time},1,{2 * column + 1},{2 * row + 1},0,Running")
    (folder / "truth.csv").write_text("\n".join(truth) + "\n")
    readings = [crossing.readings for crossing in driven.crossings]
    write_beliefs(
        folder / "localization.out",
        localize(readings, compute_expected_readings(lab, ANGLES, parameters)).beliefs,
    )
    return folder


def test_each_drawing_is_made(run, tmp_path, capsys):
    words = {
        "walls": [],
        "cones": ["--cell", "5,7", "--distance", "cone"],
        "table": [],
        "beliefs": ["--beliefs", "localization.out", "--run", "run.jsonl", "--truth", "truth.csv"],
        "curves": ["--beliefs", "localization.out", "--run", "run.jsonl", "--truth", "truth.csv"],
        "errors": ["--run", "run.jsonl", "--truth", "truth.csv"],
    }
    for what, more in words.items():
        output = tmp_path / f"{what}.png"
        more = [str(run / word) if (run / word).is_file() else word for word in more]
        assert main(["draw", what, "-o", str(output), *more]) == 0
        assert output.read_bytes().startswith(b"\x89PNG")
        assert capsys.readouterr().out == f"figure: {output}\n"


def test_compare_says_where_and_draws(run, tmp_path, capsys):
    changed = tmp_path / "other.out"
    changed.write_text((run / "localization.out").read_text())
    figure = tmp_path / "compare.svg"
    words = ["compare", str(run / "localization.out"), str(changed), "--png", str(figure), "-m", "standard"]
    assert main(words) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[1] for line in lines[1:-1]] == ["0.000"] * (len(lines) - 2)
    assert figure.stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["gif", "html"])
def test_an_animation_has_a_frame_for_each_reading(run, tmp_path, capsys, kind):
    output = tmp_path / f"run.{kind}"
    words = ["animate", str(run / "run.jsonl"), "-m", "standard", "-o", str(output), "--every", "50"]
    words += ["--truth", str(run / "truth.csv")] if kind == "gif" else []
    assert main(words) == 0
    frames = int(re.search(r"(\d+) frames", capsys.readouterr().out)[1])
    if kind == "gif":
        from PIL import Image

        with Image.open(output) as picture:
            assert 5 <= picture.n_frames <= frames
    else:
        text = output.read_text()
        assert text.count("data:image/png;base64") == frames
        assert 'src="http' not in text


def test_mp4_without_ffmpeg_is_refused_in_one_line(run, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    words = ["animate", str(run / "run.jsonl"), "-m", "standard", "-o", str(tmp_path / "a.mp4")]
    assert main(words) == 2
    assert "mp4 needs the program ffmpeg" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["draw", "nothing", "-o", "x.png"], "invalid choice: 'nothing'"),
        (["draw", "beliefs", "-o", "x.png"], "draw beliefs needs --beliefs FILE"),
        (["draw", "cones", "-o", "x.png", "--cell", "99,1"], "(99, 1) is outside"),
        (["draw", "cones", "-o", "x.png", "--cell", "here"], "'here' is not a point"),
        (["draw", "cones", "-o", "x.png", "--angles", "1,2,3"], "is not four angles"),
        (["draw", "walls", "-o", "x.png", "-m", "atlantis"], "atlantis"),
        (["animate", "none.jsonl", "-m", "standard", "-o", "x.txt"], ".gif, .mp4, .html"),
        (["animate", "none.jsonl", "-m", "standard", "-o", "x.gif"], "none.jsonl"),
        (["compare", "a.out", "b.out"], "a.out"),
    ],
)
def test_what_cannot_be_shown_is_said_in_one_line(words, problem, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    error = capsys.readouterr().err
    assert problem in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_log_is_followed_line_by_line(run, tmp_path):
    lines = (run / "run.jsonl").read_bytes().splitlines(keepends=True)
    path = tmp_path / "growing.jsonl"
    follower = LogFollower(path)
    assert follower.poll() is False
    with path.open("wb", buffering=0) as stream:
        stream.write(lines[0] + lines[1][:20])
        assert follower.poll() is True
        assert follower.header.robot_name == "tester"
        assert follower.cycles == []
        stream.write(lines[1][20:])
        assert follower.poll() is True
        assert len(follower.cycles) == 1
        assert follower.poll() is False
    path.write_bytes(lines[0])  # another run begins
    follower.poll()
    assert follower.cycles == []


@pytest.mark.parametrize("lab_name", ["standard", "wide"])
def test_the_screen_fits_the_terminal(run, lab_name):
    follower = LogFollower(run / "run.jsonl")
    follower.poll()
    truth = compute_expected_readings(read_lab(find_lab(lab_name)), ANGLES)
    text = screen(follower.run, truth, width=80, height=24)
    assert len(text.splitlines()) < 24
    assert max(map(len, text.splitlines())) <= 80
    assert text.startswith("tester in standard_lab.xml: cycle ")
    assert "waiting" in screen(None, truth)


def test_watch_once_shows_the_last_belief(run):
    out = io.StringIO()
    watch(run / "run.jsonl", read_lab(find_lab("standard")), out=out, once=True, colour=False)
    assert "most likely cell" in out.getvalue()
    assert "(27, 7)" in out.getvalue()


def test_watch_ends_when_nothing_comes(tmp_path):
    out = io.StringIO()
    watch(tmp_path / "never.jsonl", read_lab(find_lab("standard")), out=out, idle_limit=0.05)
    assert out.getvalue() == "\x1b[2J"


def test_the_track_ends_in_the_most_likely_cell(run):
    from agent.offline.track import estimated_track
    from ciberrato.files.beliefs import read_beliefs
    from ciberrato.files.run_log import read_run

    beliefs = read_beliefs(run / "localization.out")[-1].beliefs
    track = estimated_track(read_run(run / "run.jsonl"), beliefs)
    np.testing.assert_allclose(track[-1][:2], (27, 7))
    np.testing.assert_allclose(track[0][:2], (19, 7))


SIMULATOR_LOG = Path(__file__).parents[1] / "data" / "golden" / "logs" / "log2_two_robots" / "sim.log.gz"


def test_watch_shows_a_simulators_log_and_the_true_pose(capsys):
    assert main(["watch", str(SIMULATOR_LOG), "--once", "--angles", "0,60,-60,180"]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith("bot1 in Open: cycle 400 of 400, logged")
    # The last line of the log: <Pos X="24.6008" Y="5.25309" Dir="-42.7437"/>
    assert "true pose (24.60, 5.25) -42.7°" in shown
    assert main(["watch", str(SIMULATOR_LOG), "--once", "--robot", "2", "-m", "standard"]) == 0
    assert capsys.readouterr().out.startswith("bot2 in ")


def test_watch_needs_the_lab_of_an_agents_log(run, tmp_path, capsys):
    for path in (run / "run.jsonl", tmp_path / "not-there-yet.jsonl"):
        assert main(["watch", str(path), "--once"]) == 2
        assert "-m LAB is needed" in capsys.readouterr().err


def test_a_simulators_log_is_followed_while_it_grows(tmp_path):
    from agent.views.logfollower import SimulatorLogFollower, follow

    whole = gzip.decompress(SIMULATOR_LOG.read_bytes())
    path = tmp_path / "sim.log"
    path.write_bytes(whole[:20_000])
    follower = SimulatorLogFollower(path, (0.0, 60.0, -60.0, 180.0))
    assert follower.poll()  # what was there from the beginning is news
    assert not follower.poll()
    first = len(follower.run.cycles)
    assert 5 < first < 50
    path.write_bytes(whole)
    for found in follow(follower, interval=0.01, ended=lambda: len(follower.poses) == 401):
        assert len(found.run.cycles) >= first
    assert len(follower.run.cycles) == 401
    path.unlink()
    with pytest.raises(LabError, match="cannot be read"):
        for _ in follow(follower, interval=0.01):
            pass


def test_animate_draws_a_simulators_log_with_its_own_lab_and_truth(tmp_path, capsys):
    output = tmp_path / "run.gif"
    words = ["animate", str(SIMULATOR_LOG), "-o", str(output), "--every", "100", "--robot", "2"]
    assert main(words) == 0
    assert "frames" in capsys.readouterr().out
    assert output.read_bytes().startswith(b"GIF8")


def test_names_of_others_cannot_command_the_terminal(run):
    follower = LogFollower(run / "run.jsonl")
    follower.poll()
    recorded = follower.run
    header = dataclasses.replace(recorded.header, robot_name="\x1b[2Jx\u202e" + "y" * 400, lab_name="a\nb")
    truth = compute_expected_readings(read_lab(find_lab("standard")), ANGLES)
    first, second = screen(dataclasses.replace(recorded, header=header), truth).splitlines()[:2]
    assert first.startswith("\ufffd[2Jx\ufffdyyy")
    assert "… in a\ufffdb: cycle" in first
    assert second.startswith("IR")


@pytest.fixture
def drawn(monkeypatch):
    """The figures as they are saved."""
    from agent.views.figures import beliefs, canvas, curves, differences, labmaps

    figures = []

    def keep(figure, path):
        figure.canvas.draw()
        figures.append(figure)
        canvas.save_figure(figure, path)

    for module in (beliefs, curves, differences, labmaps):
        monkeypatch.setattr(module, "save_figure", keep)
    return figures


DIFFERENCE = "difference in probability"


def shown_axes(figure):
    return [axis for axis in figure.get_axes() if axis.axison and axis.get_visible()]


def test_all_axes_have_names_and_units_and_no_legend_covers_data(run, tmp_path, drawn):
    files = ["--beliefs", str(run / "localization.out"), "--run", str(run / "run.jsonl")]
    files += ["--truth", str(run / "truth.csv")]
    for what in ("walls", "cones", "table", "beliefs", "curves", "errors"):
        words = ["draw", what, "-m", "standard", "-o", str(tmp_path / f"{what}.png")]
        assert main([*words, *(files if what in ("beliefs", "curves", "errors") else [])]) == 0
    out = str(run / "localization.out")
    assert main(["compare", out, out, "--png", str(tmp_path / "d.png"), "-m", "standard"]) == 0
    assert len(drawn) == 7
    for figure in drawn:
        axes = shown_axes(figure)
        # The outer axes say what they are; a colour bar has its one name.
        named = [(axis.get_xlabel(), axis.get_ylabel()) for axis in axes]
        assert any(x for x, _ in named)
        for x, y in named:
            assert x in ("", "x (units)", "step (0: start cell)", "time (cycles)")
            assert "(" in y or y in (
                "",
                "probability",
                "probability of the cell",
                "difference in probability",
            )
        # Each panel is below or beside one that has the names.
        assert all(axis.get_xlabel() or not axis.get_xticklabels() for axis in axes[:1])
        assert all(axis.get_legend() is None for axis in axes)


def test_the_difference_figure_says_which_file_is_which(run, tmp_path, drawn):
    folders = []
    for name in ("a", "b"):
        folders.append(tmp_path / name)
        folders[-1].mkdir()
        shutil.copy(run / "localization.out", folders[-1])
    renamed = tmp_path / "other.out"
    shutil.copy(run / "localization.out", renamed)
    first, second = (str(folder / "localization.out") for folder in folders)
    png = ["--png", str(tmp_path / "d.png")]
    assert main(["compare", first, str(renamed), *png]) == 0
    assert main(["compare", first, second, *png]) == 0
    titles = [figure.subfigs[0].get_suptitle() for figure in drawn]
    assert titles[0].startswith("other.out minus localization.out: purple where other.out has more")
    assert "no difference of 0.0005 or more" in titles[0]
    assert not titles[1].startswith("localization.out minus localization.out")


def test_panels_are_the_prior_and_each_step_once(run, tmp_path, drawn):
    words = ["draw", "beliefs", "-m", "standard", "--beliefs", str(run / "localization.out")]
    assert main([*words, "-o", str(tmp_path / "b.png"), "--every-step"]) == 0
    names = [axis.get_title().partition(":")[0] for axis in drawn[0].get_axes() if axis.get_title()]
    assert names == ["prior", *(f"step {step}" for step in range(len(names) - 1))]
    assert len(names) > 3


@pytest.mark.parametrize("name", ["$x^$", "\x1b[2J\u202e", "y" * 400, "50 % $ & <b>"])
def test_names_of_labs_are_drawn_as_they_are(tmp_path, drawn, name):
    from agent.views.figures.labmaps import wall_map

    lab = dataclasses.replace(read_lab(find_lab("standard")), name=name)
    wall_map(lab, tmp_path / "w.png")
    title = shown_axes(drawn[0])[0].get_title()
    assert title.isprintable()
    assert len(title) <= 100
    assert title[:3] == name[:3].replace("\x1b", "\ufffd")
