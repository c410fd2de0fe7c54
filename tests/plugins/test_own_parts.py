"""docs/extending.md, outside this project: a distribution made of its files is used by the programs."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from ciberrato import read_grid, read_lab
from ciberrato.errors import UsageError
from ciberrato.labs import find_grid, find_lab
from ciberrato.net.udp import UdpLink
from ciberrato.plugins import installed, load_model, load_part, models
from ciberrato.protocol import RobotRegistration, encode
from simulator_stub.sensors import Sensor
from simulator_stub.simulation import Simulation

ROOT = Path(__file__).parents[2]
BIN = Path(sys.executable).parent
TEXT = (ROOT / "docs" / "extending.md").read_text().partition("## Outside this project")[2]
FILES = dict(re.findall(r"^`(own_parts/\w+\.py)`:\n\n```python\n(.*?)```", TEXT, re.MULTILINE | re.DOTALL))
PROGRAMS = re.findall(r"(?:```|\.)\n\n```python\n((?:import|from).*?)```", TEXT, re.DOTALL)
(PROJECT,) = re.findall(r"```toml\n(.*?)```", TEXT, re.DOTALL)


def install(folder, entry_points, files, name="own-parts", version="1.0"):
    """Leave what an installation leaves: modules, and a folder with metadata and entry points."""
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    info = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    lines = []
    for group, points in entry_points.items():
        lines += [f"[{group}]", *(f"{point} = {value}" for point, value in points.items())]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")


@pytest.fixture
def own(tmp_path, monkeypatch):
    """Install the manual's distribution; return the folder of a process that sees it."""
    site = tmp_path / "site"
    install(site, tomllib.loads(PROJECT)["project"]["entry-points"], FILES)
    monkeypatch.setenv("PYTHONPATH", str(site))
    monkeypatch.setenv("CIBERRATO_CACHE", str(tmp_path / "cache"))
    work = tmp_path / "work"
    work.mkdir()
    return work


def run(folder, *words, status=0):
    program = [str(BIN / words[0])] if words[0].startswith("ciberrato") else [sys.executable, words[0]]
    done = subprocess.run(
        [*program, *words[1:]], cwd=folder, capture_output=True, text=True, timeout=240, check=False
    )
    assert done.returncode == status, done.stdout + done.stderr
    return done


def refused(folder, *words):
    """Return the one line that a program says of a part that it cannot use."""
    done = run(folder, *words, status=2)
    assert done.stderr.count("\n") == 1, done.stderr
    return done.stderr


@pytest.fixture
def serving(own):
    """Run a simulator with the distribution's sensor and scoring mode; the command line may be added to."""
    started = []

    def start(*words):
        program = [str(BIN / "ciberrato-simulator"), "--bind", "127.0.0.1", "--port", "0", "--lab", "maze"]
        program += ["--grid", "maze", "--autostart", "1", "--exit-at-end", "--param", "p.xml"]
        program += ["--lockstep", "--answer-limit", "inf"]
        (own / "p.xml").write_text('<Parameters SimTime="40"/>')
        started.append(subprocess.Popen([*program, *words], cwd=own, stdout=subprocess.PIPE, text=True))
        said = [started[-1].stdout.readline() for _ in range(3)]
        return re.search(r":(\d+)", said[1])[1], started[-1]

    yield start
    for process in started:
        process.terminate()
        process.wait()
        process.stdout.close()


def test_the_manuals_programs_run(own):
    assert len(PROGRAMS) == 2
    for number, text in enumerate(PROGRAMS):
        (own / f"program{number}.py").write_text(text)
        run(own, f"program{number}.py")


def test_an_own_drive_drives_the_real_agent_past_an_own_sensor_and_scoring(serving, own):
    port, simulator = serving(
        *("--sensor", "odometer", "--scoring", "distance", "--result", "result.json", "--log", "log.xml")
    )
    agent = ["ciberrato-agent", "-h", f"127.0.0.1:{port}", "-m", "maze", "--lockstep", "--log", "run.jsonl"]
    run(own, *agent, "--angles", "0,60,-60,180", "--drive", "circle:0.4", "--output", "l.out")
    assert simulator.wait(300) == 0
    result = (own / "result.json").read_text()
    assert '"scoring": "distance"' in result
    assert (own / "log.xml").read_text().count("<Odometer Value=") > 40
    log = (own / "run.jsonl").read_text().replace(" ", "")
    commands = set(re.findall(r'"command":\[([-0-9.,]+)\]', log))
    assert "0.05,0.15000000000000002" in commands  # of the circle; while the tables were computed another one


def test_parts_go_by_where_they_are_too_and_by_folder(tmp_path, monkeypatch):
    (tmp_path / "here.py").write_text(FILES["own_parts/odometer.py"])
    # A module of the folder that is called like one of ours, or of the interpreter, is not taken for it.
    (tmp_path / "agent.py").write_text("raise RuntimeError('not ours')")
    monkeypatch.setenv("CIBERRATO_CACHE", str(tmp_path / "cache"))
    said = refused(tmp_path, "ciberrato-simulator", "--sensor", "here:Odometr", "--port", "0")
    assert "sensor here:Odometr: here has no 'Odometr'; did you mean 'Odometer'?" in said
    text = "import agent, ciberrato.plugins as p; print(p._import('here').Odometer.name, agent.__file__)"
    program = [sys.executable, "-P", "-c", text]
    done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.split()[0] == "odometer"
    assert str(tmp_path) not in done.stdout


BROKEN = {
    "own_broken/__init__.py": "",
    "own_broken/missing.py": "import a_module_that_is_not_there\n",
    "own_broken/odd.py": "number = 7\ndef failing(setup):\n    return 1 / 0\n",
    "own_broken/named.py": "from simulator_stub.sensors.compass import CompassSensor\n"
    "class Second(CompassSensor):\n    pass\n",
}


@pytest.fixture
def broken(tmp_path, monkeypatch):
    def make(**points):
        site = tmp_path / "broken"
        install(site, {f"ciberrato.{group}": names for group, names in points.items()}, BROKEN, "own-broken")
        monkeypatch.setenv("PYTHONPATH", str(site))
        monkeypatch.setenv("CIBERRATO_CACHE", str(tmp_path / "cache"))
        return tmp_path

    return make


def test_a_broken_sensor_is_one_line(broken):
    folder = broken(sensors={"lost": "own_broken.missing:X", "odd": "own_broken.odd:number"})
    words = ("ciberrato-simulator", "--port", "0", "--sensor")
    assert (
        "sensor 'lost' (own_broken.missing:X, own-broken 1.0) cannot be loaded: ModuleNotFoundError: "
        "No module named 'a_module_that_is_not_there' (missing.py:1)" in refused(folder, *words, "lost")
    )
    assert "7 is not a class derived from simulator_stub.sensors.Sensor" in refused(folder, *words, "odd")
    assert "there are lost, odd, and any module:object; did you mean 'lost'?" in refused(
        folder, *words, "los"
    )
    said = refused(folder, *words, "own_broken.named:Second")
    assert "the name 'compass' is already used by another sensor" in said


def test_a_broken_scoring_mode_is_one_line(broken):
    folder = broken(scoring={"odd": "own_broken.odd:number"})
    words = ("ciberrato-simulator", "--port", "0", "--scoring")
    assert "7 is not a class derived from simulator_stub.scoring.Scoring" in refused(folder, *words, "odd")


FAULTY = """from simulator_stub.scoring import Scoring
from simulator_stub.sensors import Sensor, report_other

class Fine(Sensor):
    name = "faulty"
    def update(self, robot, scene): pass
    def report(self, robot, fields): pass

class Divides(Fine):
    def update(self, robot, scene): 1 / 0

class Reports(Fine):
    def report(self, robot, fields):
        report_other(fields, "X", Value=None)

class Records(Fine):
    def record(self, fields): {}["here"]

class Begins(Fine):
    def __init__(self, world): pass

class Present(Fine):
    is_present = property(lambda self: self.missing)

class Misspells(Fine):
    def report(self, robot, fields):
        fields["compas"] = 3.0

class Counts(Scoring):
    def update(self, robot, time, robots):
        if time == 3: robot.scores += 1
"""


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Divides", "sensor faulty:Divides: ZeroDivisionError: division by zero (faulty.py:10)"),
        ("Reports", "sensor faulty:Reports: TypeError: unsupported format string"),
        ("Records", "sensor faulty:Records: KeyError: 'here' (faulty.py:17)"),
        ("Begins", "sensor faulty:Begins: TypeError: Begins.__init__() takes 2"),
        ("Present", "sensor faulty:Present: AttributeError: 'Present' object has no attribute 'missing'"),
        ("Misspells", "a sensor reports 'compas', which is no field of Measures"),
        ("Counts", "scoring mode faulty:Counts: AttributeError: 'Robot' object has no attribute 'scores'"),
    ],
)
def test_what_a_sensor_or_a_scoring_mode_raises_in_a_run_is_one_line(tmp_path, monkeypatch, name, message):
    (tmp_path / "faulty.py").write_text(FAULTY)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    lab, grid = read_lab(find_lab("maze")), read_grid(find_grid("maze"))
    part = {"scoring" if name == "Counts" else "sensors": f"faulty:{name}"}
    with pytest.raises(UsageError) as caught:  # noqa: PT012  # where in a run, the message says
        simulation = Simulation(
            lab, grid, scoring=part.get("scoring", 0), sensors=[part["sensors"]] if "sensors" in part else []
        )
        robot = simulation.register(RobotRegistration())
        simulation.launch()
        for _ in range(5):
            simulation.step({robot: (0.1, 0.1)})
            simulation.readings(simulation.robots[0])
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "plugins.py" not in str(caught.value)


def test_the_simulator_ends_with_that_line(own):
    (own / "faulty.py").write_text(FAULTY)
    program = [str(BIN / "ciberrato-simulator"), "--bind", "127.0.0.1", "--port", "0"]
    program += ["--sensor", "faulty:Divides", "--quiet"]
    with subprocess.Popen(
        program, cwd=own, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        ports = [re.search(r"udp 127\.0\.0\.1:(\d+)", process.stdout.readline()) for _ in range(3)]
        (port,) = [found[1] for found in ports if found]
        with UdpLink("127.0.0.1", int(port)) as link:
            link.register(encode(RobotRegistration(name="near")))
            said = process.communicate(timeout=300)[1]
    assert process.returncode == 2
    assert said.splitlines()[-1].endswith(
        "sensor faulty:Divides: ZeroDivisionError: division by zero (faulty.py:10)"
    )
    assert "Traceback" not in said


def test_a_broken_drive_is_one_line(broken):
    folder = broken(drives={"lost": "own_broken.missing:X", "odd": "own_broken.odd:number"})
    words = ("ciberrato-agent", "--drive")
    assert "drive 'lost' (own_broken.missing:X, own-broken 1.0) cannot be" in refused(folder, *words, "lost")
    assert "7 is not a DriveKind, or a function" in refused(folder, *words, "odd")
    said = refused(folder, *words, "nowhere")
    assert "'nowhere' is not right, explore, active, goto:X,Y, lost or odd" in said


@pytest.mark.parametrize(
    ("group", "name", "words"),
    [
        ("drives", "explore", ("ciberrato-agent", "--drive", "explore")),
        ("drives", "explore", ("ciberrato-evaluate", "--lab", "maze", "--drive", "explore")),
        ("scoring", "mapping", ("ciberrato-simulator", "--port", "0", "--scoring", "mapping")),
    ],
)
def test_a_name_that_is_taken_is_one_line_even_if_the_built_in_one_is_meant(broken, group, name, words):
    folder = broken(**{group: {name: "own_broken.odd:failing"}})
    said = refused(folder, *words)
    assert f"{name!r} (own_broken.odd:failing, own-broken 1.0): the name is used by one that is built" in said


def test_two_distributions_with_one_name_are_told(tmp_path, monkeypatch):
    for number in (1, 2):
        points = {"ciberrato.drives": {"twin": f"twin{number}:make"}}
        install(tmp_path / str(number), points, {f"twin{number}.py": ""}, f"twin-{number}")
        monkeypatch.syspath_prepend(str(tmp_path / str(number)))
    with pytest.raises(
        UsageError, match=r"two distributions have taken the name, twin1:make, twin-1 1.0 and"
    ):
        load_part("ciberrato.drives", "twin", fits=callable, wanted="a function")


def test_what_a_drive_raises_or_returns_wrongly_is_told(tmp_path, monkeypatch):
    from agent.drives import make_drive
    from ciberrato.files.lab import default_lab
    from ciberrato.protocol import Measures
    from ciberrato.world.parameters import Parameters

    (tmp_path / "odd_drives.py").write_text(
        "from types import SimpleNamespace\n"
        "def raising(setup):\n    return SimpleNamespace(decide=lambda measures, known: 1 / 0)\n"
        "def nothing(setup):\n    return SimpleNamespace(decide=lambda measures, known: None)\n"
        "def pair(setup):\n    return SimpleNamespace(decide=lambda measures, known: (0.1, 0.05))\n"
        "def none(setup):\n    return None\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))

    def made(name):
        return make_drive(f"odd_drives:{name}", default_lab(), Parameters(), (0.0, 60.0, -60.0, 180.0))

    assert made("pair").decide(Measures(time=3), None).command == (0.1, 0.05)
    with pytest.raises(
        UsageError, match=r"drive 'odd_drives:raising' at time 3: ZeroDivisionError: .*\.py:3"
    ):
        made("raising").decide(Measures(time=3), None)
    with pytest.raises(UsageError, match="at time 3 decided None; it returns a Decision"):
        made("nothing").decide(Measures(time=3), None)
    with pytest.raises(UsageError, match="what it makes is None, which has no method decide"):
        made("none")


@pytest.mark.parametrize("wanted", ["compass", 7, [7], [Sensor], [int], [None]])
def test_what_is_no_list_of_sensors_is_a_named_error(wanted):
    from ciberrato.files.lab import default_lab
    from ciberrato.files.start_grid import default_grid

    with pytest.raises((ValueError, UsageError), match="sensor"):
        Simulation(default_lab(), default_grid(), sensors=wanted)


def test_an_own_sensor_leaves_the_others_numbers_as_they_were(tmp_path, monkeypatch):
    from ciberrato.files.lab import default_lab
    from ciberrato.files.start_grid import default_grid
    from ciberrato.protocol import RobotRegistration, decode_simulator_message, encode

    (tmp_path / "own_odometer.py").write_text(FILES["own_parts/odometer.py"])
    monkeypatch.syspath_prepend(str(tmp_path))
    runs = []
    for sensors in ([], ["own_odometer:Odometer"]):
        simulation = Simulation(default_lab(), default_grid(), seed=3, sensors=sensors)
        robot = simulation.register(RobotRegistration(name="r"))
        simulation.launch()
        runs.append([simulation.step({robot: (0.1, 0.08)})[robot] for _ in range(30)])
    plain, more = runs
    for one, other in zip(plain, more, strict=True):
        assert one.infrared == other.infrared
        assert one.compass == other.compass
        assert other.other("Odometer") is not None
        assert other.other("Speedometer") is None
        assert decode_simulator_message(encode(other)).others == other.others


def test_models_are_found_by_name():
    assert {"Shift", "GaussianOdometry", "VelocityMotion"} <= set(models("ciberrato.motion_models"))
    assert {"LandmarkSensor"} <= set(models("ciberrato.sensor_models"))
    assert load_model("ciberrato.motion_models", "Shift").__name__ == "Shift"
    with pytest.raises(UsageError, match=r"no motion model 'Shft'; there are .*did you mean 'Shift'"):
        load_model("ciberrato.motion_models", "Shft")
    assert installed("ciberrato.motion_models") == {}
