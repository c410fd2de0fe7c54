"""Imports point one way: asserted from the import statements themselves."""

import ast
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROCESSES = {"agent", "simulator_stub", "viewer"}
PACKAGES = PROCESSES | {"ciberrato", "maps", "evaluation", "examples", "benchmarks"}
# What each package may import of the others.
ALLOWED = {
    "ciberrato": set(),
    "maps": {"ciberrato"},
    "agent": {"ciberrato", "maps"},
    "simulator_stub": {"ciberrato", "maps"},
    "viewer": {"ciberrato", "maps"},
    "evaluation": {"ciberrato", "maps", "agent", "simulator_stub"},
    "examples": PACKAGES - {"benchmarks"},
    "benchmarks": PACKAGES,
}
# The agent's rooms, and which others each may import: inside functions and for type checkers, too.
AGENT_ROOMS = {
    "control": set(),
    "pose_filter": set(),
    "drives": {"pose_filter"},
    "offline": {"control"},
    "views": {"offline"},
    "run": {"control", "drives", "offline", "pose_filter"},
}
# What is not in a room is the command line: it may import all rooms, and none imports it.
COMMAND_LINE = {"cli", "commands", "localizecommand", "optionparser", "optiontypes", "showing"}
# Slow to load: only inside the functions that use them.
LAZY = {"scipy", "matplotlib", "numba"}
# Compiled loops: these modules are themselves imported only where the extra `fast` is asked for.
ITSELF_LAZY = {"ciberrato/coneloops.py", "simulator_stub/batch/loops.py", "agent/pose_filter/kernels.py"}


def modules(package):
    return sorted((ROOT / package).rglob("*.py"))


def imports(path, *, top_level_only=False, types=False):
    """Names imported by a file, as dotted paths; `types`: those that are for type checkers only, too."""
    tree = ast.parse(path.read_text())
    package = path.relative_to(ROOT).with_suffix("").parts[:-1]

    def walk(node):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test) and not types:
                continue
            if top_level_only and isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
                continue
            if isinstance(child, ast.Import):
                yield from (alias.name for alias in child.names)
            elif isinstance(child, ast.ImportFrom):
                if child.level:
                    base = ".".join(package[: len(package) - child.level + 1])
                    yield f"{base}.{child.module}" if child.module else base
                else:
                    yield child.module
            else:
                yield from walk(child)

    return sorted(set(walk(tree)))


def existing():
    return sorted(name for name in PACKAGES if (ROOT / name).is_dir())


@pytest.mark.parametrize("package", existing())
def test_a_package_imports_only_what_stands_below_it(package):
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in modules(package)
        for name in imports(path)
        if name.split(".")[0] in PACKAGES - {package} - ALLOWED[package]
    ]
    assert not wrong


def test_the_agents_rooms_are_known():
    folders = {path.parent for path in modules("agent")} - {ROOT / "agent"}
    assert {path.relative_to(ROOT / "agent").parts[0] for path in folders} == set(AGENT_ROOMS)
    outside = {path.stem for path in (ROOT / "agent").glob("*.py")}
    assert outside == COMMAND_LINE | {"__init__", "__main__"}


@pytest.mark.parametrize("room", sorted(AGENT_ROOMS))
def test_doors_between_the_agents_rooms_open_one_way(room):
    allowed = {f"agent.{to}" for to in {room} | AGENT_ROOMS[room]}
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in modules(f"agent/{room}")
        for name in imports(path, types=True)
        if name.split(".")[0] == "agent" and ".".join(name.split(".")[:2]) not in allowed
    ]
    assert not wrong


def test_the_agents_rooms_have_an_order():
    import graphlib

    assert set(graphlib.TopologicalSorter(AGENT_ROOMS).static_order()) == set(AGENT_ROOMS)


def test_bayes_knows_nothing_of_ciberrato():
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in modules("ciberrato/bayes")
        for name in imports(path)
        if name.split(".")[0] == "ciberrato" and not name.startswith("ciberrato.bayes")
    ]
    assert not wrong


def test_the_protocol_knows_nothing_of_geometry():
    known = {"protocol", "errors", "lab", "parameternames", "parameters", "startgrid"}
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in modules("ciberrato/protocol")
        for name in imports(path)
        if name.split(".")[0] == "ciberrato" and name.split(".")[1] not in known
    ]
    assert not wrong


def test_only_net_touches_sockets_in_the_library():
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in modules("ciberrato")
        if "net" not in path.relative_to(ROOT).parts
        for name in imports(path)
        if name.split(".")[0] in {"socket", "threading", "signal", "asyncio", "select", "selectors"}
    ]
    assert not wrong


@pytest.mark.parametrize("package", sorted(set(existing()) - {"benchmarks"}))
def test_slow_libraries_are_loaded_where_they_are_used(package):
    wrong = [
        f"{path.relative_to(ROOT)} imports {name} at its top level"
        for path in modules(package)
        if str(path.relative_to(ROOT)) not in ITSELF_LAZY
        for name in imports(path, top_level_only=True)
        if name.split(".")[0] in LAZY
    ]
    assert not wrong


def test_every_third_party_import_is_a_declared_dependency():
    import re
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lists = [project["dependencies"], *project["optional-dependencies"].values()]
    declared = {re.match(r"[\w-]+", text)[0].lower().replace("-", "_") for one in lists for text in one}
    if "pillow" in declared:
        declared.add("PIL")  # what it is called in programs
    undeclared = {
        name.split(".")[0]
        for package in existing()
        for path in modules(package)
        for name in imports(path)
        if name.split(".")[0] not in PACKAGES | set(sys.stdlib_module_names) | declared
    }
    assert not undeclared


def test_modules_stay_small():
    long = {
        str(path.relative_to(ROOT)): lines
        for package in existing()
        for path in modules(package)
        if (lines := len(path.read_text().splitlines())) > 420
    }
    assert not long


def names_of_modules():
    return {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for package in existing()
        for path in modules(package)
    }


def imported_modules(path, known):
    """Modules of this house that a file loads when it is loaded itself."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        # Types may know one another, and what a function imports is loaded when it is called.
        later = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        if later or (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)):
            node.body = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in known)
        elif isinstance(node, ast.ImportFrom) and node.module in known:
            inside = {f"{node.module}.{alias.name}" for alias in node.names} & known
            yield from inside
            if len(inside) < len(node.names):
                yield node.module


def test_no_module_imports_itself_by_a_detour():
    import graphlib

    paths = names_of_modules()
    graph = {name: set(imported_modules(path, set(paths))) - {name} for name, path in paths.items()}
    order = list(graphlib.TopologicalSorter(graph).static_order())  # CycleError names a circle
    assert len(order) == len(paths) > 200
