"""What gradings that were killed leave, users who are not root, and agents that think too long."""

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

import pytest

from ciberrato.errors import UsageError
from ciberrato.grading import leftovers, runner
from ciberrato.processes import ROOT
from tests.grading.agents import BREEDING, BROKEN, ROBOT, table, write
from tests.grading.program import command, rows, run, wait_for_a_run

LAB = "[[lab]]\nname = 'maze'\ngrid = 'maze'\nset = {SimTime = 60}\n"
UNPRIVILEGED = 65534
THINKS = """
            import time
            until = time.monotonic() + 7.0
            while measures.time == 20 and time.monotonic() < until:
                pass
"""


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """An empty folder for temporary files."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setenv("TMPDIR", str(folder))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return folder


@pytest.mark.slow
def test_the_next_grading_removes_what_a_killed_one_left(tmp_path, temporary):
    write(tmp_path, "robot", ROBOT)
    path = tmp_path / "course.toml"
    path.write_text("seeds = 3\n" + LAB + table("robot"))
    words = command(path, "--output", tmp_path / "report", "--jobs", "1")
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    wait_for_a_run(process)
    process.kill()
    process.communicate(timeout=300)
    assert len(list(temporary.glob("ciberrato-grade-*"))) == 1
    run(path, "--quiet", "--output", tmp_path / "report")
    assert not list(temporary.glob("ciberrato-grade-*"))


def test_folders_that_are_in_use_or_not_ours_stay(temporary, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    (other / "in-use").touch()
    (temporary / "ciberrato-grade-link").symlink_to(other)
    (temporary / "ciberrato-grade-unmarked").mkdir()
    with leftovers.temporary_folder() as mine:
        program = "import sys; from ciberrato.grading import leftovers; print(leftovers.remove_leftovers())"
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT)
        assert done.stdout == "[]\n", done.stderr
        assert mine.is_dir()
    assert not mine.exists()
    assert (other / "in-use").exists()
    assert (temporary / "ciberrato-grade-unmarked").is_dir()
    gone = temporary / "ciberrato-grade-gone"
    gone.mkdir()
    (gone / "in-use").touch()
    assert leftovers.remove_leftovers() == [gone]


@pytest.fixture
def stranger():
    """A folder that an unprivileged user has, and how that user runs Python with this checkout in it.

    Checkout and environment may lie where only root looks: the user finds them in mounts of their own.
    """
    if not hasattr(os, "getuid") or os.getuid() != 0:
        pytest.skip("the tests do not run as root: all others are this test")
    if missing := [name for name in ("setpriv", "unshare", "mount", "bwrap") if shutil.which(name) is None]:
        pytest.skip(f"there is no {missing[0]} here")
    folder = Path(tempfile.mkdtemp())
    for name in ("checkout", "environment", "base", "home"):
        (folder / name).mkdir()
    for path in (folder, folder / "home"):
        os.chown(path, UNPRIVILEGED, UNPRIVILEGED)
    packages = Path(sysconfig.get_path("purelib")).relative_to(sys.prefix)
    paths = f"{folder / 'checkout'}\n{folder / 'environment' / packages}\n"
    script = (
        'mount --bind "$1" "$4/checkout" && mount --bind "$2" "$4/environment" && '
        'mount --bind "$3" "$4/base" && cd "$4/home" && '
        "export HOME=$4/home TMPDIR=$4/home LD_LIBRARY_PATH=$4/base/lib && shift 4 && "
        f"exec setpriv --reuid {UNPRIVILEGED} --regid {UNPRIVILEGED} --clear-groups --bounding-set=-all "
        '--inh-caps=-all -- "$@"'
    )

    def run_there(*words):
        places = [str(ROOT), sys.prefix, sys.base_prefix, str(folder)]
        inside = ["unshare", "--mount", "sh", "-c", script, "sh", *places, *map(str, words)]
        return subprocess.run(inside, capture_output=True, text=True, timeout=300, check=False)

    made = run_there(
        folder / "base" / "bin" / "python3", "-m", "venv", "--without-pip", folder / "home" / "own"
    )
    for place in (folder / "home" / "own").glob("lib/python*/site-packages"):
        (place / "paths.pth").write_text(paths)

    def python(*words):
        return run_there(folder / "home" / "own" / "bin" / "python", *words)

    seen = python("-c", "import os, ciberrato, numpy; print(os.getuid())")
    if seen.stdout != f"{UNPRIVILEGED}\n":
        shutil.rmtree(folder)
        pytest.skip(f"an unprivileged user cannot run this Python: {(made.stderr + seen.stderr)[-200:]}")
    yield folder, python
    shutil.rmtree(folder, ignore_errors=True)


@pytest.mark.slow
def test_users_other_than_root_have_the_same_sandbox(stranger):
    folder, python = stranger
    home = folder / "home" / "course"
    probe = "from ciberrato.grading import sandbox; print(sandbox.choose('auto'))"
    if python("-c", probe).stdout != "bwrap\n":
        pytest.skip("bubblewrap does not work here for users other than root")
    spy = ROBOT + "    import os\n    print(os.getuid(), sorted(os.listdir('/tmp')))\n"
    write(home, "robot", spy)
    write(home, "breeding", BREEDING)
    path = home / "course.toml"
    readable = f"readable = ['{folder / 'environment'}']\n"
    path.write_text(
        readable + "[limits]\nprocesses = 20\nsilence = 1\n" + LAB + table("robot") + table("breeding")
    )
    for place in (home, *home.rglob("*")):
        os.chown(place, UNPRIVILEGED, UNPRIVILEGED)
    report = home / "report"
    done = python("-m", "ciberrato.grading", path, "--sandbox", "bwrap", "--quiet", "--output", report)
    assert done.returncode == 0, done.stdout + done.stderr
    came = {row["agent"]: row for row in rows(report)}
    assert came["robot"]["status"] == "time over"
    assert came["robot"]["answered"] == "60"
    assert "1000 [" in (report / "runs.jsonl").read_text()
    # The system itself refuses it more processes, or the count stops it: whichever comes first.
    assert came["breeding"]["detail"] in {"process limit", "exit status 1"}
    assert (report / "index.html").stat().st_uid == UNPRIVILEGED


@pytest.mark.slow
def test_an_agent_that_thinks_too_long_loses_the_cycle_and_not_others_time(tmp_path, walls):
    write(tmp_path, "robot", ROBOT)
    # Counts for longer than the limit, once: the cycles go on without it, longer than it counts. All are
    # seconds apart: what a busy machine takes does not come to that.
    settings = "answer_limit = 4\nlimits = {silence = 15}\n" + LAB.replace("60", "300")
    thinking = ROBOT.replace("            robot.drive", THINKS + "            robot.drive")
    write(tmp_path, "thinking", thinking)
    path = tmp_path / "course.toml"
    path.write_text(settings + table("robot"))
    run(path, "--sandbox", walls, "--quiet", "--output", tmp_path / "alone")
    path.write_text(settings + table("thinking") + table("robot"))
    run(path, "--sandbox", walls, "--quiet", "--output", tmp_path / "both")
    (alone,) = rows(tmp_path / "alone")
    both = {row["agent"]: row for row in rows(tmp_path / "both")}
    assert both["robot"] == alone
    assert (alone["answered"], alone["unanswered"], alone["late"]) == ("300", "0", "0")
    late = both["thinking"]
    assert late["status"] == "time over"
    # Its robot answers the newest Measures only: what it has skipped stays unanswered.
    assert int(late["unanswered"]) >= 1
    assert int(late["answered"]) + int(late["unanswered"]) == 300


def test_one_grading_at_a_time_works_on_a_folder(tmp_path):
    path = tmp_path / "runs.jsonl"
    with (
        runner.open_runs(path, tmp_path / "recordings"),
        pytest.raises(UsageError, match="another grading is at work there"),
    ):
        runner.open_runs(path, tmp_path / "recordings")
    runner.open_runs(path, tmp_path / "recordings").close()


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no full device here")
def test_a_run_that_cannot_be_kept_is_told():
    with (
        open("/dev/full", "ab", buffering=0) as full,
        pytest.raises(UsageError, match="/dev/full: cannot be written: No space left"),
    ):
        runner.add_run(full, {"key": 1})


def test_a_run_that_is_kept_in_part_is_told():
    class Full:
        name = "runs.jsonl"

        def write(self, line):
            return len(line) - 1

    with pytest.raises(UsageError, match="there is no room"):
        runner.add_run(Full(), {"key": 1})


@pytest.mark.slow
def test_who_fills_its_folder_is_stopped(tmp_path, walls):
    filling = BROKEN.replace("DO", "[open(f'f{n}', 'wb').write(bytes(3 << 20)) for n in range(40)]")
    write(tmp_path, "filling", filling + "\n        __import__('time').sleep(0.2)\n")
    path = tmp_path / "course.toml"
    path.write_text("limits = {disk = 4}\n" + LAB + table("filling"))
    run(path, "--quiet", "--sandbox", walls, "--output", tmp_path / "report")
    (row,) = rows(tmp_path / "report")
    assert row["status"].startswith("stopped at")
    assert row["detail"] == "disk limit"


@pytest.mark.slow
def test_who_is_at_work_when_the_run_is_over_has_its_last_words(tmp_path, walls):
    write(tmp_path, "robot", ROBOT)
    file = tmp_path / "agents" / "robot" / "agent.py"
    file.write_text(
        file.read_text()
        + "\nimport time\nuntil = time.process_time() + 1.3\n"
        + "while time.process_time() < until:\n    pass\nprint('that was it')\n"
    )
    path = tmp_path / "course.toml"
    path.write_text(LAB + table("robot"))
    run(path, "--quiet", "--sandbox", walls, "--output", tmp_path / "report")
    assert "that was it" in (tmp_path / "report" / "junit.xml").read_text()
