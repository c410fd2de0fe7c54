"""The localization manual's programs, run as they are written, and its names, looked up."""

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "bayes.md").read_text()


def test_the_programs_run_one_after_the_other():
    blocks = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
    assert len(blocks) == 6
    names = {}
    for block in blocks:
        exec(compile(block, "docs/bayes.md", "exec"), names)


@pytest.mark.parametrize("package", ["motion", "sensors"])
def test_each_model_in_the_tables_is_a_module_and_each_module_is_in_the_tables(package):
    section = TEXT[TEXT.index("## Motion models" if package == "motion" else "## Sensor models") :]
    section = section[: section.index("\n## ", 4)]
    listed = set(re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE))
    for name in listed:
        importlib.import_module(f"ciberrato.bayes.{package}.{name}")
    helpers = {
        "__init__",
        "displacements",
        "fans",
        "pose_kernel",
        "odometry_reading",
        "normal",
        "in_machine_code",
        "inputs",
        "lattice",
        "long_rows",
        "passes",
        "selected",
    }
    modules = {path.stem for path in (ROOT / "ciberrato" / "bayes" / package).glob("*.py")}
    assert modules - helpers == listed


def test_the_examples_are_those_of_the_table():
    from examples import PROBLEMS

    section = TEXT[TEXT.index("## The classic problems") :]
    assert re.findall(r"^\| `(\w+)` \|", section, re.MULTILINE) == list(PROBLEMS)
