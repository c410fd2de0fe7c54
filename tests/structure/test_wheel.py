"""The wheel that is built from the checkout ships what users need, and nothing else."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SHIPPED = ("ciberrato", "agent", "simulator_stub")


@pytest.mark.slow
def test_the_wheel_ships_the_packages_and_the_maps(tmp_path):
    source = tmp_path / "source"
    source.mkdir()
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    for name in (*SHIPPED, "maps", "benchmarks", "examples", "tests/structure"):
        if (ROOT / name).is_dir():
            ignore = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / name, source / name, ignore=ignore)
    words = [
        sys.executable,
        "-m",
        "build",
        "--wheel",
        "--no-isolation",
        "--outdir",
        str(tmp_path),
        str(source),
    ]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    tops = {name.split("/")[0] for name in names if ".dist-info" not in name}
    assert tops == set(SHIPPED)
    programs = {str(path.relative_to(ROOT)) for name in SHIPPED for path in (ROOT / name).rglob("*.py")}
    assert {name for name in names if name.endswith(".py")} == programs
    maps = {name for name in names if name.startswith("ciberrato/maps/")}
    assert maps == {f"ciberrato/maps/{path.name}" for path in (ROOT / "maps").glob("*.xml")}
    schemas = {name for name in names if name.endswith(".rng")}
    assert schemas == {f"ciberrato/files/schemas/{kind}.rng" for kind in ("lab", "grid", "parameters")}
    assets = {
        str(path.relative_to(ROOT)) for path in (ROOT / "ciberrato").rglob("assets/**/*") if path.is_file()
    }
    assert assets <= set(names)
    assert any("grading" in name for name in assets)
    assert "ciberrato/py.typed" in names
    (entries,) = [name for name in names if name.endswith("entry_points.txt")]
    assert (
        "[pytest11]\nciberrato = ciberrato.testing.plugin\n" in zipfile.ZipFile(wheel).read(entries).decode()
    )
    _environments_are_made(wheel, tmp_path / "site")


def _environments_are_made(wheel: Path, site: Path) -> None:
    """Run the manual's first program on learning with what the wheel holds, and nothing of the checkout."""
    zipfile.ZipFile(wheel).extractall(site)
    program = (ROOT / "docs" / "learning.md").read_text().partition("```python\n")[2].partition("```")[0]
    assert "gymnasium.make(" in program
    program += "\nimport ciberrato; print(ciberrato.__file__)"
    environment = {**os.environ, "PYTHONPATH": str(site)}
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=site.parent,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    score, where = done.stdout.splitlines()
    assert score.endswith(("True", "False"))
    assert where == str(site / "ciberrato" / "__init__.py")
