"""Agents that git addresses name."""

import json
import os
import shutil
import subprocess

import pytest

from ciberrato.grading import repositories
from ciberrato.grading.course import CourseError, read_course
from tests.grading.agents import ROBOT, write
from tests.grading.program import rows, run

pytestmark = pytest.mark.skipif(shutil.which("git") is None, reason="there is no git here")
LAB = "[[lab]]\nname = 'maze'\ngrid = 'maze'\nset = {SimTime = 30}\n"
AGENT = "[[agent]]\nname = 'ana'\ncommand = 'python agent.py {host} {port} {name}'\n"


@pytest.fixture(autouse=True)
def settings(tmp_path, monkeypatch):
    """A cache and git settings of the test's own; git is to find no others."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("GIT_CONFIG_NOSYSTEM", "1")
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", str(tmp_path / "settings"))
    (tmp_path / "settings").write_text(
        "[user]\nname = t\nemail = t@example.org\n[init]\ndefaultBranch = main\n"
    )


@pytest.fixture
def repository(tmp_path):
    """A repository with an agent in the folder robot/."""
    write(tmp_path / "made", "ana", ROBOT)
    place = tmp_path / "repository"
    place.mkdir()
    git(place, "init", "-q")
    shutil.move(tmp_path / "made" / "agents" / "ana", place / "robot")
    commit(place)
    return place


def git(place, *words):
    done = subprocess.run(["git", "-C", str(place), *words], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def commit(place):
    git(place, "add", "-A")
    git(place, "commit", "-qm", "x", "--allow-empty")
    return git(place, "rev-parse", "HEAD")


def course(tmp_path, address, more="folder = 'robot'\n"):
    path = tmp_path / "course.toml"
    path.write_text(LAB + AGENT + f"git = '{address}'\n" + more)
    return path


def fetched(path, **options):
    return repositories.fetch_agents(read_course(path), lambda line: None, **options)


@pytest.mark.slow
def test_the_commit_is_in_every_run_and_in_the_report(tmp_path, repository):
    first = git(repository, "rev-parse", "HEAD")
    path = course(tmp_path, repository.as_uri())
    said = run(path, "--output", tmp_path / "report").stderr
    assert f"ana: {repository.as_uri()}" in said
    (row,) = rows(tmp_path / "report")
    assert (row["status"], row["answered"], row["commit"]) == ("time over", "30", first)
    kept = json.loads((tmp_path / "report" / "runs.jsonl").read_text())
    assert kept["commit"] == first
    assert json.loads((tmp_path / "report" / "results.json").read_text())["ranking"][0]["commit"] == first
    assert first[:10] in (tmp_path / "report" / "index.html").read_text()
    (repository / "robot" / "new").write_text("x")
    second = commit(repository)
    run(path, "--quiet", "--report", "--output", tmp_path / "report")  # what was fetched: nothing has changed
    assert rows(tmp_path / "report")[0]["commit"] == first
    run(path, "--quiet", "--output", tmp_path / "report")
    assert rows(tmp_path / "report")[0]["commit"] == second
    shutil.rmtree(repository)  # what does not answer now is one line, and what was run stays
    said = run(path, "--quiet", "--output", tmp_path / "report", expect=1).stderr
    assert len(said.splitlines()) == 1
    assert "could not be run: ana: file://" in said
    assert "cannot be fetched: " in said


def test_branches_tags_and_commits_can_be_named_and_a_commit_is_fetched_once(tmp_path, repository):
    first = git(repository, "rev-parse", "HEAD")
    git(repository, "tag", "handed-in")
    git(repository, "checkout", "-qb", "next/try")
    (repository / "robot" / "later").write_text("x")
    second = commit(repository)
    for ref, wanted in (("handed-in", first), ("next/try", second), (first, first)):
        path = course(tmp_path, repository.as_uri(), f"ref = '{ref}'\nfolder = 'robot'\n")
        (agent,) = fetched(path)[0].agents
        assert agent.commit == wanted
        assert (agent.folder / "later").exists() == (wanted == second)
    shutil.rmtree(repository)
    assert fetched(path)[0].agents[0].commit == first
    assert fetched(course(tmp_path, repository.as_uri(), "ref = 'handed-in'\n"))[1]
    assert not fetched(course(tmp_path, repository.as_uri(), "ref = 'handed-in'\n"), network=False)[1]


def test_a_path_beside_the_course_is_an_address(tmp_path, repository):
    (agent,) = fetched(course(tmp_path, "repository"))[0].agents
    assert (agent.folder / "agent.py").is_file()
    assert agent.folder.is_relative_to(tmp_path / "cache")


def test_nothing_of_a_repository_is_run_when_it_is_fetched(tmp_path, repository):
    mark = tmp_path / "mark"
    evil = tmp_path / "evil.sh"
    evil.write_text(f"#!/bin/sh\ntouch {mark}\ncat\n")
    evil.chmod(0o755)
    for name in ("post-checkout", "pre-auto-gc", "reference-transaction", "post-index-change", "fsmonitor"):
        hook = repository / ".git" / "hooks" / name
        hook.parent.mkdir(exist_ok=True)
        shutil.copy(evil, hook)
        hook.chmod(0o755)
        tracked = repository / ".githooks" / name
        tracked.parent.mkdir(exist_ok=True)
        shutil.copy(evil, tracked)
    (repository / ".gitattributes").write_text("* filter=evil\n*.py filter=lfs diff=evil merge=evil\n")
    (repository / ".gitmodules").write_text(
        f'[submodule "s"]\n\tpath = s\n\turl = ext::{evil}\n\tupdate = !{evil}\n'
    )
    commit(repository)
    # The user's own filters are not for files of strangers, either.
    with (tmp_path / "settings").open("a") as file:
        for name in ("evil", "lfs"):
            file.write(f'[filter "{name}"]\nsmudge = {evil}\nrequired = true\n')
    mark.unlink(missing_ok=True)
    (agent,) = fetched(course(tmp_path, repository.as_uri()))[0].agents
    assert (agent.folder / "agent.py").read_text() == (repository / "robot" / "agent.py").read_text()
    assert not mark.exists()
    # The same with git alone, and settings as they are, runs it: the traps do work.
    git(tmp_path, "clone", "-q", str(repository), "clone")
    assert mark.exists()


def test_links_do_not_lead_out_of_a_repository(tmp_path, repository):
    (tmp_path / "secret").mkdir()
    (repository / "out").symlink_to(tmp_path / "secret")
    commit(repository)
    _, (fault,) = fetched(course(tmp_path, repository.as_uri(), "folder = 'out'\n"))
    assert "has no folder 'out'" in fault
    _, (fault,) = fetched(course(tmp_path, repository.as_uri(), "folder = 'absent'\n"))
    assert "has no folder 'absent'" in fault


def test_too_much_is_refused_before_it_is_written(tmp_path, repository, monkeypatch):
    monkeypatch.setattr(repositories, "MOST_FILES", 3)
    for number in range(4):
        (repository / f"file{number}").write_text("x")
    commit(repository)
    _, (fault,) = fetched(course(tmp_path, repository.as_uri()))
    assert "more than 3 files" in fault
    assert not list((tmp_path / "cache").rglob("file0"))


@pytest.mark.parametrize(
    ("address", "what"),
    [
        ("file:///nowhere/at/all", "does not appear to be a git repository"),
        ("ext::sh -c true", "transport 'ext' not allowed"),
        ("http://127.0.0.1:1/x.git", "unable to access"),
    ],
)
def test_what_cannot_be_fetched_is_one_line(tmp_path, address, what):
    course_, (fault,) = fetched(course(tmp_path, address))
    assert not course_.agents
    assert what in fault
    assert fault.startswith("ana: " + address)
    assert "\n" not in fault


def test_a_server_that_asks_for_a_password_gets_none_and_one_that_is_silent_is_left(tmp_path, monkeypatch):
    from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
    from threading import Event, Thread

    waiting, stay = Event(), Event()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            if "silent" in self.path:
                waiting.set()
                stay.wait(300.0)
                return
            self.send_response(401)
            self.send_header("WWW-Authenticate", 'Basic realm="x"')
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *words):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = Thread(target=server.serve_forever)
        thread.start()
        address = f"http://127.0.0.1:{server.server_port}"
        _, (fault,) = fetched(course(tmp_path, address + "/closed"))
        assert "cannot be fetched: " in fault
        for seconds in (1.0, 8.0, 64.0):  # until git, on a busy machine, has asked before it is left
            monkeypatch.setattr(repositories, "PATIENCE", seconds)
            _, (fault,) = fetched(course(tmp_path, address + "/silent"))
            assert f"cannot be fetched: no end after {seconds:g} s" in fault
            if waiting.is_set():
                break
        assert waiting.is_set()
        stay.set()
        server.shutdown()
        thread.join()


@pytest.mark.parametrize(
    ("more", "what"),
    [
        ("ref = '--upload-pack=x'\n", "is no branch, tag or commit"),
        ("ref = 'a:b'\n", "is no branch, tag or commit"),
        ("folder = '../x'\n", "leads out of the repository"),
        ("folder = '/etc'\n", "leads out of the repository"),
    ],
)
def test_entries_that_cannot_be_are_told(tmp_path, more, what):
    with pytest.raises(CourseError, match=what):
        read_course(course(tmp_path, "https://example.org/x.git", more))
    with pytest.raises(CourseError, match="is no address"):
        read_course(course(tmp_path, "--upload-pack=x", ""))


def test_a_ref_needs_an_address(tmp_path):
    path = tmp_path / "course.toml"
    path.write_text(LAB + AGENT + "ref = 'main'\n")
    with pytest.raises(CourseError, match="ref: needs git"):
        read_course(path)


def test_without_git_one_line_says_so(tmp_path, repository, monkeypatch):
    path = course(tmp_path, repository.as_uri())
    monkeypatch.setenv("PATH", os.devnull)
    _, (fault,) = fetched(path)
    assert fault == "ana: git is not installed; install it"
