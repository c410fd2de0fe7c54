"""The environments of Gymnasium: its own checker, units and bounds, and what episodes are made of."""

from __future__ import annotations

import subprocess
import sys
import time

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

from ciberrato.errors import UsageError  # noqa: E402
from ciberrato.gym import CiberRatoEnv, CiberRatoVectorEnv  # noqa: E402
from ciberrato.gym.human import Window  # noqa: E402
from ciberrato.gym.scenario import Scenario  # noqa: E402
from ciberrato.labs import find_lab  # noqa: E402
from ciberrato.net.udp import UdpLink  # noqa: E402
from ciberrato.physics.kinematics import MAX_POWER  # noqa: E402
from ciberrato.protocol import (  # noqa: E402
    GridRequest,
    LabRequest,
    RobotStatus,
    ViewRegistration,
    decode_simulator_message,
    encode,
)
from ciberrato.world.lab import Lab, Target, Wall  # noqa: E402
from ciberrato.world.parameters import Parameters  # noqa: E402

NAMES = ("Navigate", "Localize", "Circuit")
QUIET = Parameters(compass_noise=0.0, obstacle_noise=0.0, motors_noise=0.0)
HALL = Lab(name="hall", width=16.0, height=6.0, targets=(Target(x=12.0, y=3.0, radius=2.0),))
RING = Lab(
    name="ring",
    width=8.0,
    height=6.0,
    walls=(Wall(corners=((2.0, 2.0), (6.0, 2.0), (6.0, 4.0), (2.0, 4.0))),),
)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_gymnasiums_checker_finds_nothing(name: str) -> None:
    """With its warnings as errors; it starts the viewer, too."""
    check_env(gymnasium.make(f"ciberrato/{name}-v0").unwrapped)


def test_make_imports_the_package_by_itself() -> None:
    program = (
        "import gymnasium, sys; assert 'ciberrato.gym' not in sys.modules;"
        "env = gymnasium.make('ciberrato.gym:ciberrato/Navigate-v0'); env.reset(seed=1);"
        "print(env.unwrapped.scenario.names)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "('maze',)\n"


def test_gymnasium_loads_no_plugins() -> None:
    """From 0.27 to 0.29 it did, by entry points in the group ``gymnasium.envs``; since 1.0 it does not.

    If this fails it does again: declare ``ciberrato = "ciberrato.gym.registration:register_environments"``
    there, and the manual need no longer tell anyone to import the package.
    """
    assert not hasattr(gymnasium.envs.registration, "load_plugin_envs")
    program = "import gymnasium; gymnasium.make('ciberrato/Navigate-v0')"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert "NamespaceNotFound: Namespace ciberrato not found" in done.stderr


@pytest.mark.parametrize("name", NAMES)
def test_observations_stay_within_their_bounds(name: str) -> None:
    env = gymnasium.make(f"ciberrato/{name}-v0", time_limit=60, noise=(0.0, 3.0)).unwrapped
    assert env.observation_space.dtype == np.float32
    assert len(env.task.columns()) == env.observation_space.shape[0]
    env.action_space.seed(1)
    for seed in range(3):
        observation, _ = env.reset(seed=seed)
        over = False
        while not over:
            assert observation in env.observation_space
            observation, reward, terminated, truncated, _ = env.step(env.action_space.sample())
            assert np.isfinite(reward)
            over = terminated or truncated


def drive_to(env: CiberRatoEnv, x: float) -> tuple[float, bool, dict]:
    """Drive along x to a place, forwards or backwards."""
    total, terminated, info = 0.0, False, {}
    while not terminated and abs(env._simulation.poses()[0, 0] - x) > 0.1:
        ahead = 1.0 if env._simulation.poses()[0, 0] < x else -1.0
        _, reward, terminated, truncated, info = env.step([ahead, ahead])
        assert not truncated
        total += reward
    return total, terminated, info


def test_a_perfect_run_is_worth_one_more_than_there_are_targets() -> None:
    env = CiberRatoEnv("navigate", labs=HALL, starts=[(2.0, 3.0, 0.0)], parameters=QUIET)
    observation, _ = env.reset(seed=1)
    assert observation[7:].tolist() == [-1.0, 1.0]
    there, terminated, info = drive_to(env, 11.9)
    observation, visit, *_ = env.step([0.0, 0.0])
    assert observation[7:].tolist() == [0.0, 0.0]
    assert not terminated
    home, terminated, info = drive_to(env, 2.0)
    assert terminated
    assert info["success"]
    # The way that is left when the EndLed is lit, within half a unit of the start, is what is missing.
    assert there + visit + home == pytest.approx(2.0 - info["score"] / 100.0, abs=1e-12)
    assert info["score"] <= 5


def test_a_round_is_a_success_and_gives_a_point_a_cell() -> None:
    env = CiberRatoEnv("circuit", labs=RING, starts=[(1.0, 1.0, 0.0)], parameters=QUIET, time_limit=3000)
    env.reset(seed=1)
    total, info = 0.0, {"success": False}
    corners = [(7.0, 1.0), (7.0, 5.0), (1.0, 5.0), (1.0, 1.0)]
    while not info["success"]:
        x, y, heading = env._simulation.poses()[0]
        dx, dy = corners[0][0] - x, corners[0][1] - y
        if np.hypot(dx, dy) < 0.3:
            corners.pop(0)
            continue
        turn = np.angle(np.exp(1j * (np.arctan2(dy, dx) - heading)))
        wheels = (0.5 - turn, 0.5 + turn) if abs(turn) < 0.3 else (-0.5 * np.sign(turn), 0.5 * np.sign(turn))
        _, reward, terminated, truncated, info = env.step(wheels)
        assert not terminated
        assert not truncated
        total += reward
    assert total == pytest.approx(10.0)  # ten cells, the start again included
    assert len(corners) <= 1


def test_time_is_up() -> None:
    env = CiberRatoEnv(time_limit=5)
    env.reset(seed=1)
    ends = [env.step([0.0, 0.0])[2:4] for _ in range(5)]
    assert ends == [(False, False)] * 4 + [(False, True)]


@pytest.mark.slow
def test_localizing_gains_information_and_ends_with_a_right_claim() -> None:
    env = CiberRatoEnv("localize", time_limit=900)
    outcomes = []
    for seed in range(4):
        observation, _ = env.reset(seed=seed)
        begin, total, over = float(observation[12]), 0.0, False
        while not over:
            blocked = observation[0] > 1.5
            wheels = (0.8, -0.8) if blocked else (0.9, 0.9)
            observation, reward, terminated, truncated, info = env.step(wheels)
            total += reward
            over = terminated or truncated
        bonus = (1.0 if info["success"] else -1.0) if terminated else 0.0
        assert total == pytest.approx(begin - float(observation[12]) + bonus, abs=1e-5)
        outcomes.append(info["success"])
    assert sum(outcomes) >= 3


def test_actions_are_shares_of_the_greatest_power() -> None:
    env = CiberRatoEnv(labs=HALL, starts=[(2.0, 3.0, 0.0)], parameters=QUIET)
    env.reset(seed=1)
    env.step([2.0, 0.5])
    robot = env._simulation.robots[0]
    assert (robot.left_command, robot.right_command) == (MAX_POWER, 0.5 * MAX_POWER)
    with pytest.raises(ValueError, match="actions must have the shape"):
        env.step([0.1])
    with pytest.raises(ValueError, match="not NaN"):
        env.step([0.1, np.nan])


def test_episodes_are_drawn_from_the_options() -> None:
    scenario = Scenario(["maze", "rooms"], "free", (0.5, 2.0), Parameters(), 100)
    generator = np.random.default_rng(1)
    episodes = [scenario.draw(generator) for _ in range(200)]
    assert {episode.number for episode in episodes} == {0, 1}
    factors = [episode.parameters.motors_noise / 1.5 for episode in episodes]
    assert min(factors) < 0.6
    assert max(factors) > 1.9
    for episode in episodes:
        assert episode.parameters.sim_time == 100
        assert episode.parameters.obstacle_noise / 0.1 == pytest.approx(episode.parameters.motors_noise / 1.5)
    asked = scenario.draw(generator, {"lab": "rooms", "start": (3.0, 4.0, 90.0)})
    assert (asked.number, asked.start) == (1, (3.0, 4.0, 90.0))
    circuit = Scenario(RING, "circuit", 1.0, Parameters(), 10)
    assert {circuit.draw(generator).start for _ in range(99)} >= {(1.0, 1.0, 0.0)}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"task": "navigte"}, "unknown task 'navigte'.*navigate"),
        ({"labs": []}, "there must be one at least"),
        ({"labs": "maz"}, "neither a file nor a lab"),
        ({"labs": HALL}, "'hall' has no start grid"),
        ({"starts": "anywhere"}, "one of grid, free, circuit"),
        ({"starts": [(1.0, 2.0)]}, "is not x, y in units and a direction"),
        ({"task": "circuit", "labs": "twins"}, "there is no start of the kind 'circuit'"),
        ({"noise": (2.0, 1.0)}, "nor a range"),
        ({"time_limit": 0}, "no positive number of cycles"),
        ({"time_limit": True}, "time_limit: True is no positive number"),
        ({"labz": "maze"}, "no option labz.*labs"),
        ({"labs": 3}, "labs: 3 is neither a name"),
        ({"parameters": "calm"}, "parameters: 'calm' are no Parameters"),
        ({"noise": "loud"}, "noise: 'loud' is neither a factor"),
        ({"noise": (1.0, 2.0, 3.0)}, "noise: .* is neither a factor"),
        ({"starts": 3}, "starts: 3 is none of"),
        ({"starts": [("a", 1, 1)]}, "start: .* is not x, y in units"),
    ],
)
def test_options_that_cannot_be_used_are_refused_in_one_line(options: dict, message: str) -> None:
    for kind in (CiberRatoEnv, CiberRatoVectorEnv):
        with pytest.raises(UsageError, match=message) as caught:
            kind(**options)
        assert "\n" not in str(caught.value)


def test_many_environments_are_a_positive_number() -> None:
    for number in (0, -1, "2", 1.5, True):
        with pytest.raises(UsageError, match="is no positive number of environments"):
            CiberRatoVectorEnv(num_envs=number)
    with pytest.raises(ValueError, match="threads: 0 is below 1"):
        CiberRatoVectorEnv(threads=0)


def test_labs_may_be_paths_and_starts_an_array() -> None:
    env = CiberRatoEnv(labs=find_lab("rooms"), starts=np.array([[3.0, 4.0, 90.0]]))
    env.reset(seed=1)
    assert env._simulation.poses()[0] == pytest.approx([3.0, 4.0, np.pi / 2.0])


def test_resets_check_their_options() -> None:
    env = CiberRatoEnv()
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step([0.0, 0.0])
    with pytest.raises(UsageError, match="lab: 'twins' is not one of maze"):
        env.reset(options={"lab": "twins"})
    with pytest.raises(UsageError, match="options: unknown speed"):
        env.reset(options={"speed": 3})
    with pytest.raises(ValueError, match="render_mode 'ansi' is not one of"):
        CiberRatoEnv(render_mode="ansi")


def test_pictures_show_the_robot() -> None:
    env = CiberRatoEnv(labs=HALL, starts=[(4.0, 3.0, 0.0)], render_mode="rgb_array")
    env.reset(seed=1)
    first = env.render()
    assert first.shape == (130, 330, 3)
    robot = (first == (0, 114, 178)).all(axis=-1)
    rows, columns = np.nonzero(robot)
    assert columns.mean() / 20 - 0.25 == pytest.approx(4.0, abs=0.15)
    assert (first.shape[0] - rows.mean()) / 20 - 0.25 == pytest.approx(3.0, abs=0.15)
    env.reset(options={"start": (8.0, 3.0, 0.0)})
    assert not np.array_equal(env.render(), first)


@pytest.mark.slow
def test_the_window_tells_a_viewer_lab_grid_and_poses() -> None:
    env = CiberRatoEnv(labs=HALL, starts=[(4.0, 3.0, 0.0)])
    env.reset(seed=1)
    window = Window(env._simulation, 1000)
    try:
        with UdpLink("127.0.0.1", window.port) as link:
            link.register(encode(ViewRegistration()))
            answers: list[object] = []
            asked = False
            until = time.monotonic() + 300.0
            while not any(isinstance(one, RobotStatus) for one in answers) or len(answers) < 4:
                assert time.monotonic() < until
                window.show(env._simulation)
                answers += [decode_simulator_message(data) for data in link.receive_waiting()]
                if answers and not asked:
                    asked = True
                    link.send(encode(LabRequest()))
                    link.send(encode(GridRequest()))
        kinds = {type(one).__name__ for one in answers}
        assert {"Acceptance", "RobotStatus"} <= kinds
        (status, *_) = [one for one in answers if isinstance(one, RobotStatus)]
        assert (status.x, status.y) == (4.0, 3.0)
    finally:
        window.close()
