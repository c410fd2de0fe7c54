"""Moving pictures of drives that do not go to the right: their beliefs are the pose filter's."""

import math

import numpy as np
import pytest

from agent.cli import main
from agent.offline.pose_replay import replay_poses
from agent.views.figures import animation
from ciberrato import Robot, find_grid, find_lab, read_grid, read_lab
from ciberrato.files.beliefs import read_beliefs
from ciberrato.files.run_log import read_run
from ciberrato.world.lab import CELL_SIZE
from simulator_stub.simulation import Simulation


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A drive that turns before walls: its log, and the true pose at each time, units and degrees."""
    log = tmp_path_factory.mktemp("drive") / "run.jsonl"
    simulation = Simulation(read_lab(find_lab("maze")), read_grid(find_grid("maze")), seed=7)
    truth = {}
    with Robot("rosa", simulation=simulation, localize="maze", log=log) as robot:
        for measures in robot:
            ahead, left, right, _ = measures.infrared
            turn = 0.1 if left < right else -0.1
            robot.drive(-turn, turn) if ahead > 1.2 else robot.drive(0.1, 0.1)
            x, y, heading = simulation.poses()[0]
            truth[measures.time] = (float(x), float(y), math.degrees(heading))
            if measures.time == 150:
                robot.finish()
    return log, truth


def cell(pose):
    return int(pose[1] // CELL_SIZE), int(pose[0] // CELL_SIZE)


def test_the_estimates_and_the_beliefs_are_right(recorded):
    log, truth = recorded
    run, lab = read_run(log), read_lab(find_lab("maze"))
    assert not run.drives_right
    replay = replay_poses(run, lab, lambda index, _: index % 10 == 0)
    assert len(replay.poses) == len(run.cycles)
    assert len(replay.beliefs) == 1 + len(run.cycles[::10])
    assert replay.doubtful_since is None
    sure = [(c.time, pose) for c, pose in zip(run.cycles, replay.poses, strict=True) if pose is not None]
    assert len(sure) > 50
    assert all(math.dist(pose[:2], truth[time][:2]) < 0.3 for time, pose in sure if time in truth)
    for number, belief in enumerate(replay.beliefs[1:]):
        time = run.cycles[10 * number].time
        if time in truth and belief.max() > 0.99 and time > 60:
            row, column = np.unravel_index(belief.argmax(), belief.shape)
            x, y = (column + 0.5) * CELL_SIZE, (row + 0.5) * CELL_SIZE
            # Within half a cell and what a step takes: on an edge either cell is right.
            assert max(abs(x - truth[time][0]), abs(y - truth[time][1])) < CELL_SIZE / 2 + 0.2


def test_each_frame_shows_the_belief_of_its_cycle(recorded, tmp_path, monkeypatch, capsys):
    log, truth = recorded
    scenes = []

    def keep(scene, frames, path, frames_per_second):
        scenes.append((scene, frames))
        return len(frames)

    monkeypatch.setattr(animation, "_save", keep)
    words = ["animate", str(log), "-m", "maze", "--every", "25", "-o", str(tmp_path / "run.gif")]
    assert main(words) == 0
    ((scene, frames),) = scenes
    last = scene._beliefs[scene._shown[frames[-1]]]
    # The last message is one cycle after the last pose known here.
    assert last[cell(truth[150])] > 0.99
    for index in frames:
        name, time = scene._moments[scene._shown[index]]
        assert (name, time) == (f"belief of cycle {time}", scene._run.cycles[index].time)


def test_localize_draws_it_along(recorded, tmp_path, monkeypatch, capsys):
    log, _ = recorded
    drawn = []
    monkeypatch.setattr(animation, "animate_poses", lambda *words, **more: drawn.append(words) or 7)
    text = log.read_text().replace('"phase":"', '"step":0,"readings":[1,1,1,1],"phase":"', 1)
    marked = tmp_path / "marked.jsonl"
    marked.write_text(text)
    output = tmp_path / "run.out"
    words = ["localize", str(marked), "-m", "maze", "-o", str(output), "--animate", str(tmp_path / "a.gif")]
    assert main(words) == 0, capsys.readouterr()
    assert len(drawn) == 1
    assert len(read_beliefs(output)[-1].beliefs) == 2
