"""Every public callable of `ciberrato`, with arguments of wrong kinds: the error names the argument."""

import inspect
import json
import subprocess
import sys

import numpy as np
import pytest

import ciberrato
from ciberrato import CiberratoError, Lab, Parameters, PoseFilter, Robot, StartGrid, find_lab
from ciberrato.files.lab import default_lab
from ciberrato.files.start_grid import default_grid
from ciberrato.protocol import Actions, Measures, RobotRegistration
from ciberrato.world.start_grid import GridPosition
from simulator_stub.simulation import Simulation
from simulator_stub.world.commands import UnknownRobotError

WRONG = (object(), 7.5j, b"x", [object()], lambda: 1)
RIGHT = {"lab": default_lab(), "grid": default_grid(), "parameters": Parameters(), "name_or_path": "maze"}
# What does not count beside a simulation is looked at where it does.
ELSEWHERE = {("Robot", "host"), ("Robot", "transport"), ("PoseFilter", "clock")}


def robot(**arguments):
    return Robot(**({"simulation": Simulation(default_lab(), default_grid())} | arguments))


CALLABLES = {
    name: value
    for name in ciberrato.__all__
    if callable(value := getattr(ciberrato, name))
    and not (inspect.isclass(value) and issubclass(value, Exception))
} | {"Robot": Robot, "Simulation": Simulation}
CASES = [
    (name, argument) for name, value in CALLABLES.items() for argument in inspect.signature(value).parameters
]


def refused(name, call, wrong):
    """The call fails, and the message has the argument's name."""
    with pytest.raises((ValueError, TypeError, CiberratoError), match=name) as caught:
        call()
    assert "\n" not in str(caught.value), wrong
    assert len(str(caught.value)) < 400, wrong


def test_all_of_the_face_is_walked():
    assert {"Lab", "Parameters", "PoseFilter", "Robot", "StartGrid", "read_lab", "find_lab"} <= set(CALLABLES)
    assert len(CASES) > 70


@pytest.mark.parametrize(("name", "argument"), CASES)
def test_an_argument_of_the_wrong_kind_is_named(name, argument):
    if (name, argument) in ELSEWHERE:
        return
    call = robot if name == "Robot" else CALLABLES[name]
    parameters = inspect.signature(CALLABLES[name]).parameters
    right = {} if name == "Robot" else {key: RIGHT[key] for key in parameters if key in RIGHT}
    if name.startswith("read_") and argument != "path":
        right["path"] = str(ciberrato.find_parameters("default"))
    for wrong in WRONG:
        refused(argument, lambda w=wrong: call(**(right | {argument: w})), wrong)


@pytest.mark.parametrize("wrong", WRONG)
def test_host_transport_and_clock_are_named(wrong):
    refused("host", lambda: Robot(host=wrong), wrong)
    refused("transport", lambda: Robot(host="127.0.0.1:1", transport=wrong), wrong)
    if not callable(wrong):
        refused("clock", lambda: PoseFilter(default_lab(), Parameters(), clock=wrong), wrong)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(
            (name, wrong)
            for name in ("motors_noise", "obstacle_noise")
            for wrong in ("a", None, -0.1, np.nan, np.inf)
        ),
        *(("line_sensor_true_probability", wrong) for wrong in (-0.1, 1.1, np.nan, "x")),
        *(("sim_time", wrong) for wrong in ("a", 1.5, None, True)),
        *(("gps", wrong) for wrong in ("On", 1, None)),
        ("lab_file", 7),
    ],
)
def test_parameters_that_cannot_be_are_refused_by_name(name, value):
    with pytest.raises((ValueError, TypeError), match=f"^{name}: "):
        Parameters(**{name: value})


def test_numbers_of_numpy_and_lists_are_as_good():
    parameters = Parameters(motors_noise=np.float32(1.5), sim_time=np.int64(7), gps=np.bool_(True))
    assert parameters == Parameters(motors_noise=1.5, sim_time=7, gps=True)
    grid = StartGrid(positions=[GridPosition(x=1, y=1)])
    assert hash(grid) == hash(StartGrid(positions=(GridPosition(x=1, y=1),)))
    assert grid.positions[0].heading == 0.0
    assert GridPosition(direction_deg=180.0).heading == np.pi


@pytest.mark.parametrize(
    ("argument", "value"),
    [("start", None), ("start", 7), ("budget", "x"), ("angles", None), ("parameters", None), ("wait", "no")],
)
def test_the_pose_filter_names_its_argument(argument, value):
    arguments = {"lab": default_lab(), "parameters": Parameters()} | {argument: value}
    with pytest.raises(ValueError, match=f"^{argument}: "):
        PoseFilter(**arguments)


def test_the_pose_filters_methods_name_theirs():
    with PoseFilter(Lab(width=4.0, height=4.0), Parameters()) as localizer:
        with pytest.raises(TypeError, match=r"^measures: 7 is not a Measures"):
            localizer.observe(7)
        with pytest.raises(ValueError, match=r"^command: 'x' is not"):
            localizer.observe(Measures(time=0), "x")
        with pytest.raises(ValueError, match=r"^timeout: 'x' is not a number of seconds"):
            localizer.wait("x")


@pytest.fixture
def simulation():
    made = Simulation(default_lab(), default_grid(), Parameters(motors_noise=0.0))
    made.register(RobotRegistration(name="r"))
    made.launch()
    return made


@pytest.mark.parametrize("pair", [(0.1, 0.08), [0.1, 0.08], np.array([0.1, 0.08])])
def test_two_motor_commands_are_as_good_as_actions(simulation, pair):
    simulation.step({1: pair})
    other = Simulation(default_lab(), default_grid(), Parameters(motors_noise=0.0))
    other.register(RobotRegistration(name="r"))
    other.launch()
    other.step({1: Actions(left_motor=0.1, right_motor=0.08)})
    assert simulation.poses().tolist() == other.poses().tolist()


@pytest.mark.parametrize(
    "wanted", [0.1, None, "ab", (0.1,), (0.1, "x"), (0.1, np.nan), (0.1, 0.1, 0.1), [Actions(), 7]]
)
def test_what_a_robot_cannot_want_is_told_and_nothing_moves(simulation, wanted):
    before = simulation.poses()
    with pytest.raises(
        TypeError, match=r"actions of robot 1: .* is not Actions, a list of them, or two motor"
    ):
        simulation.step({1: wanted})
    assert simulation.time == 0
    assert simulation.poses().tolist() == before.tolist()


def test_a_robot_that_is_not_there_is_named(simulation):
    for call in (lambda: simulation.step({2: (0.1, 0.1)}), lambda: simulation.place("x", 1.0, 1.0, 0.0)):
        with pytest.raises(UnknownRobotError, match=r"there is no robot .*; there are 1"):
            call()
    with pytest.raises(KeyError):
        simulation.step({2: Actions()})
    with pytest.raises(UnknownRobotError, match="none has registered"):
        Simulation(default_lab(), default_grid()).step({1: Actions()})
    with pytest.raises(TypeError, match="actions: 7 is not a mapping"):
        simulation.step(7)
    with pytest.raises(ValueError, match="x, y, heading"):
        simulation.place(1, np.nan, 1.0, 0.0)


def test_compiled_without_numba_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "ciberrato.infrared.cone_compiled", None)
    with pytest.raises(CiberratoError, match=r"pip install 'ciberrato\[fast\]'"):
        Simulation(default_lab(), default_grid(), compiled=True)


def test_paths_may_be_texts_and_numbers_are_no_files(tmp_path):
    # open() takes 0 for what comes in by the terminal.
    program = "import ciberrato, json; print(json.dumps(repr(ciberrato.read_lab('maze.xml'))))"
    (tmp_path / "maze.xml").write_bytes(find_lab("maze").read_bytes())
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout).startswith("<Lab ")
    with pytest.raises(TypeError, match="path: 0 is not the path of a file"):
        ciberrato.read_lab(0)
