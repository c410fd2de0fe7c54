"""What `import ciberrato` shows, and how little it loads."""

import importlib
import json
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

import ciberrato

BIN = Path(sys.executable).parent
FACE = {
    *("CiberratoError", "LabError", "ProtocolError", "UsageError", "__version__"),
    *("Lab", "Parameters", "Robot", "StartGrid", "read_grid", "read_lab", "read_parameters"),
    *("find_grid", "find_lab", "find_parameters", "PoseFilter"),
}


def test_the_names_it_shows():
    assert set(ciberrato.__all__) == FACE
    assert set(dir(ciberrato)) >= FACE
    for name in FACE:
        assert getattr(ciberrato, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'labyrinth'"):
        _ = ciberrato.labyrinth


def test_every_name_is_the_one_of_its_home():
    for name, home in ciberrato._HOMES.items():
        assert getattr(ciberrato, name) is getattr(importlib.import_module(home), name)


def test_it_loads_nothing_by_itself():
    program = "import ciberrato, json, sys; print(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    ours = [name for name in json.loads(done.stdout) if name.split(".")[0] in {"ciberrato", "numpy", "lxml"}]
    assert ours == ["ciberrato", "ciberrato.version"]


def packages():
    """Packages of the library that re-export names."""
    for found in pkgutil.walk_packages(ciberrato.__path__, "ciberrato."):
        if found.ispkg and "maps" not in found.name.split("."):
            yield found.name


@pytest.mark.parametrize("name", sorted(packages()))
def test_what_a_package_shows_is_in_its_list(name):
    package = importlib.import_module(name)
    shown = {
        key
        for key, value in vars(package).items()
        if not key.startswith("_")
        and key != "TYPE_CHECKING"
        and getattr(value, "__module__", name) != "__future__"
        and type(value).__name__ not in {"module", "_Feature"}
    }
    assert shown <= set(getattr(package, "__all__", ()))


def test_every_public_package_has_a_list_and_all_in_it_is_there():
    # The rooms of the filter are behind its one public class; what is in them is not for others.
    public = {name for name in packages() if not name.startswith("ciberrato.localization.")}
    for name in public:
        package = importlib.import_module(name)
        assert package.__all__, name
        modules = {module.name for module in pkgutil.iter_modules(package.__path__)}
        for shown in package.__all__:
            assert shown in modules or hasattr(package, shown), f"{name}.{shown}"


@pytest.mark.parametrize("program", ["agent", "simulator", "viewer", "evaluate", "lab", "grade"])
def test_every_program_says_its_version(program):
    words = [str(BIN / f"ciberrato-{program}"), "--version"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stdout == f"ciberrato {ciberrato.__version__}\n"
