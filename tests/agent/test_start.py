"""What is loaded before the robot registers, and the tables from which the command line follows."""

import json
import pkgutil
import re
import subprocess
import sys

import pytest

import agent.commands
import agent.drives
from agent.cli import main
from agent.commands import DRIVE, SUBCOMMANDS
from agent.commands.drive import make_parser
from agent.drives.registry import DRIVES, load_drive, parse_drive, read_place
from ciberrato.evaluation.task import DRIVES as EVALUATED
from ciberrato.files.lab import default_lab
from ciberrato.world.parameters import Parameters

ANGLES = (0.0, 60.0, -60.0, 180.0)
# A first datagram, or connection, ends the program, which says what it has loaded by then.
LOADED = """
import json, os, sys

def hook(event, arguments):
    if event in ("socket.sendto", "socket.connect"):
        print(json.dumps(sorted(sys.modules)), flush=True)
        os._exit(0)

sys.addaudithook(hook)
from agent.cli import main
main(sys.argv[1:])
"""


def test_before_the_registration_neither_numpy_nor_a_filter_nor_a_drive_is_loaded():
    program = (
        "import json, sys, agent.cli, agent.commands.drive as drive\n"
        "drive.settings_of(drive.make_parser().parse_args([]))\n"
        "import agent.run.session\n"
        "print(json.dumps(sorted(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    loaded = set(json.loads(done.stdout))
    assert "agent.run.session" in loaded
    assert not loaded & {"numpy", "ciberrato.localization.grid_filter", "ciberrato.files.run_records"}
    assert "ciberrato.protocol.tolerantxml" not in loaded
    assert not loaded & {kind.home for kind in DRIVES.values()}


@pytest.mark.parametrize("transport", ["udp", "tcp"])
def test_numpy_is_loaded_after_the_registration_has_left(tmp_path, transport):
    words = ["-h", "127.0.0.1:1", "--give-up-after", "0.01", "--transport", transport]
    command = [sys.executable, "-c", LOADED, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
    loaded = set(json.loads(done.stdout))
    assert "agent.run.registration" in loaded
    assert not loaded & {"numpy", "scipy", "numba", "ciberrato.localization.pose_filter"}
    assert "ciberrato.protocol.messages" not in loaded  # all the others
    assert not loaded & {"shutil", "traceback", "ciberrato.localization.evidence.start_prior"}


def test_in_lockstep_all_is_loaded_before_the_registration_leaves(tmp_path):
    """The first answer is then not so late that it is taken for the next one's."""
    command = [sys.executable, "-c", LOADED, "-h", "127.0.0.1:1", "--give-up-after", "0.01", "--lockstep"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
    loaded = set(json.loads(done.stdout))
    assert {"numpy", "agent.drives.right.controller", "ciberrato.files.run_log"} <= loaded


def test_the_process_that_answers_is_soon_there():
    program = "import json, sys, agent.run.answering; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert not set(json.loads(done.stdout)) & {"numpy", "asyncio", "ciberrato.client.robot"}


def test_a_simulator_loads_nothing_that_only_filters_use():
    program = "import json, sys, simulator_stub.assembly; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    loaded = set(json.loads(done.stdout))
    assert "simulator_stub.simulation" in loaded
    assert not {name for name in loaded if name.startswith(("ciberrato.bayes", "scipy", "numba"))}


def test_every_subcommand_is_a_module_and_is_told_of(capsys):
    modules = {module.name for module in pkgutil.iter_modules(agent.commands.__path__)}
    assert set(SUBCOMMANDS) | {DRIVE} <= modules
    helpers = {"beside", "files", "option_types", "parser"}
    assert modules - helpers == set(SUBCOMMANDS) | {DRIVE}
    for name, (words, what) in SUBCOMMANDS.items():
        assert re.search(rf"{name} {re.escape(words)} +{re.escape(what)}\n", make_parser().format_help())
        with pytest.raises(SystemExit) as ended:
            main([name, "--help"])
        assert ended.value.code == 0
        assert f"ciberrato-agent {name}" in capsys.readouterr().out


@pytest.mark.parametrize("name", [name for name in DRIVES if name != "right"])
def test_every_drive_is_made_from_its_name(name):
    goal = (9.0, 3.0) if DRIVES[name].argument is read_place else None
    drive = agent.drives.make_drive(name, default_lab(), Parameters(), ANGLES, goal=goal)
    assert type(drive).__module__ == DRIVES[name].home == load_drive(name).__name__
    assert name in EVALUATED


@pytest.mark.parametrize("name", ["right", "nowhere", "goto"])
def test_no_drive_is_made_without_what_it_needs(name):
    with pytest.raises(ValueError, match=f"no drive '{name}', or no argument"):
        agent.drives.make_drive(name, default_lab(), Parameters(), ANGLES)


@pytest.mark.parametrize(
    ("text", "expected"), [("explore", ("explore", None)), ("goto:1,2.5", ("goto", (1.0, 2.5)))]
)
def test_a_drive_is_read_from_the_command_line(text, expected):
    assert parse_drive(text) == expected


@pytest.mark.parametrize(
    "text", ["", "explor", "explore:", "explore:1", "goto", "goto:", "goto:1", "goto:1,nan", "goto:1,2,3"]
)
def test_what_is_no_drive_is_said_with_those_there_are(text):
    with pytest.raises(ValueError, match=f"'{text}' is not right, explore, active or goto:X,Y"):
        parse_drive(text)
