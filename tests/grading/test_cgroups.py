"""Control groups, with stand-ins for systemd and the kernel's folder, which note what is asked of them."""

import os
import shutil
import subprocess
import sys

import pytest

from ciberrato.grading import cgroups
from tests.grading.agents import ROBOT, table, write
from tests.grading.program import rows, run

LAB = "[[lab]]\nname = 'maze'\ngrid = 'maze'\nset = {SimTime = 30}\n"
SYSTEMD = """#!{python}
import os, sys
words = sys.argv[1:]
cut = words.index("--")
with open({log!r}, "a") as file:
    print(*words[:cut], file=file)
if {fails}:
    sys.exit(1)
os.execvp(words[cut + 1], words[cut + 1:])
"""


@pytest.fixture
def systemd(tmp_path, monkeypatch):
    """A stand-in for systemd-run; it notes what it is told."""
    programs = tmp_path / "programs"
    programs.mkdir()
    monkeypatch.setenv("PATH", f"{programs}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("XDG_RUNTIME_DIR", "/run/user/mine")

    def make(fails=False):
        program = programs / "systemd-run"
        program.write_text(SYSTEMD.format(python=sys.executable, log=str(tmp_path / "log"), fails=fails))
        program.chmod(0o755)
        return tmp_path / "log"

    return make


@pytest.fixture
def hierarchy(tmp_path):
    """A folder as the kernel shows it, and the file that says where we are."""
    base = tmp_path / "cgroup" / "user" / "mine"
    base.mkdir(parents=True)
    for place in (tmp_path / "cgroup", base):
        (place / "cgroup.controllers").write_text("cpu memory pids\n")
    own = tmp_path / "own"
    own.write_text("9:name=systemd:/x\n0::/user/mine\n")
    return tmp_path / "cgroup", own, base


@pytest.mark.slow
def test_with_systemd_agents_run_in_scopes_with_limits(tmp_path, systemd, walls):
    log = systemd()
    write(tmp_path, "robot", ROBOT + "    import os\n    print('XDG_RUNTIME_DIR' in os.environ)\n")
    path = tmp_path / "course.toml"
    path.write_text("[limits]\nmemory = 200\nprocesses = 30\n" + LAB + table("robot"))
    said = run(path, "--sandbox", walls, "--output", tmp_path / "report").stderr
    assert "limits: memory and processes by control groups (systemd-run)" in said
    (row,) = rows(tmp_path / "report")
    assert (row["status"], row["answered"]) == ("time over", "30")
    user = () if os.getuid() == 0 else ("--user",)
    limits = "-p MemoryMax=250M -p MemorySwapMax=0 -p TasksMax=34"
    _, agent = log.read_text().splitlines()  # first, it is tried
    assert agent == " ".join((*user, "--scope", "--quiet", "--collect", limits))
    assert '"tail":"False\\n"' in (tmp_path / "report" / "runs.jsonl").read_text()


def test_where_systemd_does_not_work_our_own_group_is_divided(systemd, hierarchy):
    systemd(fails=True)
    root, own, base = hierarchy
    groups = cgroups.find_groups(root, own)
    assert "below our own" in groups.told
    assert (base / "cgroup.subtree_control").read_text() == "+memory +pids"
    words = groups.around(["sh", "-c", "echo $$; exec echo $$"], megabytes=100, processes=10)
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert len(set(done.stdout.split())) == 1  # it becomes the command
    group = max(base.glob("ciberrato-grade-*"), key=lambda path: int(path.name.rpartition("-")[2]))
    assert (group / "cgroup.procs").read_text().split() == done.stdout.split()[:1]
    assert int((group / "memory.max").read_text()) == 125 << 20
    assert (group / "pids.max").read_text() == "14"
    for path in base.glob("ciberrato-grade-*"):
        for file in path.iterdir():  # the kernel's files are no hindrance
            file.unlink()
    groups.close()
    assert not list(base.glob("ciberrato-grade-*"))


@pytest.mark.parametrize("what", ["controllers", "version", "none"])
def test_where_no_group_can_be_made_a_line_says_so(systemd, hierarchy, what):
    systemd(fails=True)
    root, own, base = hierarchy
    if what == "controllers":
        (base / "cgroup.controllers").write_text("cpu\n")
    elif what == "version":
        own.write_text("4:memory:/x\n")
    else:
        shutil.rmtree(base)
    groups = cgroups.find_groups(root, own)
    assert groups.told == cgroups.WITHOUT
    assert groups.around(["x", "y"], megabytes=1, processes=1) == ["x", "y"]
    assert groups.environment() == {}
