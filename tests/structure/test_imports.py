"""Imports point one way: asserted from the import statements themselves.

Every import counts, those inside functions and for type checkers too.
"""

import ast
import graphlib
import re
import sys
import tomllib
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOTS = ("ciberrato", "agent", "simulator_stub")  # what is installed
PACKAGES = (*ROOTS, "examples", "benchmarks")
# The rooms of the library, and which others each may import.
WORLD = {"arrays", "errors", "reprs", "world"}
SHAPES = WORLD | {"geometry", "physics"}
LIBRARY = {
    "version": set(),
    "errors": set(),
    "system": {"reprs"},
    "arrays": set(),
    "command_line": {"errors", "plaintext", "system", "version"},
    "lazy_names": set(),
    "machine_code": {"errors"},
    "processes": set(),
    "progress": set(),
    "plaintext": set(),
    "reprs": set(),
    "plugins": {"bayes", "errors", "reprs"},
    "world": {"errors", "reprs"},
    "labs": {"errors"},
    "geometry": WORLD,
    "physics": WORLD | {"geometry"},
    "bayes": {"errors", "machine_code", "reprs", "system"},
    "infrared": SHAPES | {"bayes", "machine_code"},
    "protocol": WORLD | {"lazy_names"},
    "files": WORLD | {"geometry", "protocol", "system"},
    "overlay": {"arrays", "errors", "reprs"},
    "net": {"errors", "overlay", "protocol", "reprs", "system"},
    "client": WORLD | {"files", "labs", "lazy_names", "localization", "net", "protocol", "system"},
    "croblink": {"client", "errors", "net", "protocol"},
    "localization": SHAPES | {"infrared", "lazy_names", "machine_code", "processes", "protocol", "system"},
    "checks": SHAPES | {"files", "infrared", "labs", "localization"},
    "plot": SHAPES | {"bayes", "files", "infrared", "labs", "localization", "plaintext"},
}
# The rooms behind the full-pose filter, each standing on those before it.
LOCALIZATION = ("belief", "evidence", "tables", "refinement", "filtering", "live")
# Applications stand on all of the library, and on one another only as said here.
APPLICATIONS = {
    "viewer": set(),
    "labtool": {"agent"},
    "evaluation": {"agent", "simulator_stub"},
    "grading": {"evaluation", "labtool", "simulator_stub", "viewer"},
    "testing": {"grading", "labtool", "simulator_stub"},
    "gym": {"simulator_stub"},
    "front": {"agent", "simulator_stub", "viewer", "evaluation", "labtool", "grading"},
    "__main__": {"front"},
}
# The rooms of the two processes, likewise; both stand on all of the library.
AGENT = {
    "drives": set(),
    "offline": {"drives"},
    "views": {"offline"},
    "run": {"drives", "offline"},
    "commands": {"drives", "offline", "run", "views"},
}
SIMULATOR = {
    "world": set(),
    "sensors": {"world"},
    "scoring": {"world"},
    "robot_transitions": {"scoring", "world"},
    "cycle_loops": {"sensors", "world"},
    "compiled_cycle": {"cycle_loops", "sensors", "world"},
    "simulation": {"compiled_cycle", "robot_transitions", "scoring", "sensors", "world"},
    "batch": {"cycle_loops", "scoring", "sensors", "simulation", "world"},
    "recording": {"simulation", "world"},
    "service": {"recording", "simulation", "world"},
}
# What is in no room is a command line: it may import all rooms, and none imports it.
AGENT_COMMAND_LINE = {
    *("__init__", "__main__", "cli"),
}
SIMULATOR_COMMAND_LINE = {"__init__", "__main__", "assembly", "cli", "options"}
# Slow to load: only inside the functions that use them.
LAZY = {"scipy", "matplotlib", "numba", "lxml"}
# Compiled loops: these modules are themselves imported only where the extra `fast` is asked for.
ITSELF_LAZY = {
    "ciberrato/bayes/kernel_loops.py",
    "ciberrato/bayes/loops.py",
    "ciberrato/bayes/motion_loops.py",
    "ciberrato/bayes/product_loops.py",
    "ciberrato/bayes/ray_loops.py",
    "ciberrato/bayes/scan_loops.py",
    "ciberrato/bayes/selected_loops.py",
    "ciberrato/bayes/step_loops.py",
    "ciberrato/bayes/vectors.py",
    "ciberrato/infrared/cone_compiled.py",
    "ciberrato/infrared/sweep_compiled.py",
    "ciberrato/localization/belief/kernels.py",
    "simulator_stub/batch/loops.py",
    "simulator_stub/cycle_loops.py",
}


def files(package):
    return sorted((ROOT / package).rglob("*.py"))


@cache
def house():
    """Path of every module, by its dotted name."""
    return {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for package in PACKAGES
        for path in files(package)
    }


@cache
def imports(path, top_level_only=False):
    """Dotted names of what a file imports: of modules of this house the module, never a name in it."""
    tree = ast.parse(path.read_text())
    package = path.relative_to(ROOT).with_suffix("").parts[:-1]

    def walk(node):
        for child in ast.iter_child_nodes(node):
            if top_level_only and isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
                continue
            if top_level_only and isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
                continue
            if isinstance(child, ast.Import):
                yield from (alias.name for alias in child.names)
            elif isinstance(child, ast.ImportFrom):
                base = child.module or ""
                if child.level:
                    above = package[: len(package) - child.level + 1]
                    base = ".".join((*above, base) if base else above)
                inside = {f"{base}.{alias.name}" for alias in child.names} & set(house())
                yield from inside
                if len(inside) < len(child.names):
                    yield base
            else:
                yield from walk(child)

    return frozenset(walk(tree))


def room(name, root):
    """Name of the room that a module of a root package is in; None for one of another package."""
    first, *rest = name.split(".")
    if first != root:
        return None
    return rest[0] if rest else "__init__"


def doors(root, place, allowed):
    """Imports of one room that lead into a room of the same root that it may not see."""
    return [
        f"{path.relative_to(ROOT)} imports {name}"
        for module, path in house().items()
        if room(module, root) == place
        for name in imports(path)
        if room(name, root) not in {None, "__init__", place} | allowed
    ]


def test_every_room_is_known():
    def rooms(root):
        return {place for name in house() if (place := room(name, root)) is not None}

    assert rooms("ciberrato") == {"__init__", *LIBRARY, *APPLICATIONS}
    assert rooms("agent") == {*AGENT, *AGENT_COMMAND_LINE}
    assert rooms("simulator_stub") == {*SIMULATOR, *SIMULATOR_COMMAND_LINE}


@pytest.mark.parametrize("rooms", [LIBRARY, AGENT, SIMULATOR], ids=["library", "agent", "simulator"])
def test_rooms_have_an_order(rooms):
    assert set(graphlib.TopologicalSorter(rooms).static_order()) == set(rooms)


@pytest.mark.parametrize("place", sorted(LIBRARY))
def test_a_room_of_the_library_imports_only_what_stands_below_it(place):
    assert not doors("ciberrato", place, LIBRARY[place])


def test_the_rooms_behind_the_pose_filter_stand_one_on_the_other():
    root = ROOT / "ciberrato" / "localization"
    assert {path.parent.name for path in root.glob("*/__init__.py")} == set(LOCALIZATION)
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for level, place in enumerate(LOCALIZATION)
        for path in files(root / place)
        for name in imports(path)
        if name.split(".")[:2] == ["ciberrato", "localization"]
        and name.split(".")[2] not in {*LOCALIZATION[: level + 1], "records"}
    ]
    assert not wrong


@pytest.mark.parametrize("place", sorted(APPLICATIONS))
def test_an_application_imports_the_library_and_what_it_is_allowed(place):
    assert not doors("ciberrato", place, set(LIBRARY) | APPLICATIONS[place])


def test_the_library_and_the_applications_know_no_process_but_where_allowed():
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for module, path in house().items()
        if (place := room(module, "ciberrato")) is not None
        for name in imports(path)
        if (top := name.split(".")[0]) in {"agent", "simulator_stub", "examples", "benchmarks"}
        and top not in APPLICATIONS.get(place, set())
    ]
    assert not wrong


@pytest.mark.parametrize("place", sorted(AGENT))
def test_doors_between_the_agents_rooms_open_one_way(place):
    assert not doors("agent", place, AGENT[place])


@pytest.mark.parametrize("place", sorted(SIMULATOR))
def test_doors_between_the_simulators_rooms_open_one_way(place):
    assert not doors("simulator_stub", place, SIMULATOR[place])


@pytest.mark.parametrize("process", ["agent", "simulator_stub"])
def test_the_two_processes_meet_on_the_wire_only(process):
    others = ({*ROOTS, "examples", "benchmarks"} - {process, "ciberrato"}) | {
        f"ciberrato.{application}" for application in APPLICATIONS
    }
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in files(process)
        for name in imports(path)
        if name.split(".")[0] in others or ".".join(name.split(".")[:2]) in others
    ]
    assert not wrong


def test_only_net_and_clients_touch_sockets_in_the_library():
    # Tables are computed by another process while the robot drives: that takes a thread to wait for it.
    waits = {"ciberrato/localization/tables/worker.py"}
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for module, path in house().items()
        if room(module, "ciberrato") in set(LIBRARY) - {"net", "client", "croblink", "system"}
        and str(path.relative_to(ROOT)) not in waits
        for name in imports(path)
        if name.split(".")[0] in {"socket", "threading", "signal", "asyncio", "select", "selectors"}
    ]
    assert not wrong


@pytest.mark.parametrize("package", [name for name in PACKAGES if name != "benchmarks"])
def test_slow_libraries_are_loaded_where_they_are_used(package):
    wrong = [
        f"{path.relative_to(ROOT)} imports {name} at its top level"
        for path in files(package)
        if str(path.relative_to(ROOT)) not in ITSELF_LAZY
        for name in imports(path, top_level_only=True)
        if name.split(".")[0] in LAZY
    ]
    assert not wrong


def test_every_third_party_import_is_a_declared_dependency():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lists = [project["dependencies"], *project["optional-dependencies"].values()]
    declared = {re.match(r"[\w-]+", text)[0].lower().replace("-", "_") for one in lists for text in one}
    if "pillow" in declared:
        declared.add("PIL")  # what it is called in programs
    undeclared = {
        name.split(".")[0]
        for path in house().values()
        for name in imports(path)
        if name.split(".")[0] not in set(PACKAGES) | set(sys.stdlib_module_names) | declared
    }
    assert not undeclared


def test_modules_stay_small():
    long = {
        str(path.relative_to(ROOT)): lines
        for path in house().values()
        if (lines := len(path.read_text().splitlines())) > 420
    }
    assert not long


def test_no_module_imports_itself_by_a_detour():
    graph = {name: (imports(path) & set(house())) - {name} for name, path in house().items()}
    order = list(graphlib.TopologicalSorter(graph).static_order())  # CycleError names a circle
    assert len(order) == len(house()) > 200
