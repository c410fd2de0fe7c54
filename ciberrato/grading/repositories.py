"""Agents that git addresses name: fetched, cached by commit, checked out; nothing of theirs is run for that.

Fetching is the user's git with the user's settings, as addresses may need them; it never asks for a password.
Repositories are bare: they have no hooks of their own, submodules are not fetched, and files are written by
``git checkout-index`` with no settings at all, so that attributes of a repository find no filter to run.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from ciberrato.errors import UsageError
from ciberrato.grading.cache import cache_folder
from ciberrato.grading.course import Agent, Course
from ciberrato.grading.workspace import MOST_BYTES, MOST_FILES
from ciberrato.system.descendants import end_session
from ciberrato.system.limits import file_size_limiter
from ciberrato.system.process import apart

PATIENCE = 120.0
"""Seconds for fetching a repository."""

_QUIET = {
    "GIT_TERMINAL_PROMPT": "0",
    "GIT_ASKPASS": "true",
    "SSH_ASKPASS": "true",
    "SSH_ASKPASS_REQUIRE": "never",
    "GIT_SSH_COMMAND": "ssh -oBatchMode=yes",
    "GIT_ALLOW_PROTOCOL": "file:git:http:https:ssh",
    "GIT_LFS_SKIP_SMUDGE": "1",
    "LC_ALL": "C",
}
_ALONE = {
    "GIT_CONFIG_NOSYSTEM": "1",
    "GIT_CONFIG_GLOBAL": os.devnull,
    "GIT_ATTR_NOSYSTEM": "1",
    "GIT_NO_LAZY_FETCH": "1",
}
_OF_A_REPOSITORY = ("GIT_DIR", "GIT_INDEX", "GIT_WORK", "GIT_OBJECT", "GIT_NAMESPACE", "GIT_ALTERNATE")
_SAFE = ("-c", "core.hooksPath=/dev/null", "-c", "core.fsmonitor=false", "-c", "core.symlinks=true")


def fetch_agents(
    course: Course, tell: Callable[[str], None], *, network: bool = True
) -> tuple[Course, list[str]]:
    """Fetch the agents that git addresses name.

    Parameters
    ----------
    course : Course
    tell : callable
        Is called with a line for each agent that is to be fetched.
    network : bool
        False = take what was fetched last.

    Returns
    -------
    course : Course
        Agents have their ``folder`` and their ``commit``; those that cannot be fetched are not in it.
    faults : list of str
        A line for each of those.
    """
    agents, faults = [], []
    for agent in course.agents:
        if agent.git is None:
            agents.append(agent)
            continue
        try:
            if network:
                tell(f"{agent.name}: {agent.git}{f' ({agent.ref})' if agent.ref else ''}")
            agents.append(_fetched(agent, network=network))
        except UsageError as error:
            faults.append(f"{agent.name}: {error}")
    return dataclasses.replace(course, agents=tuple(agents)), faults


def _fetched(agent: Agent, *, network: bool) -> Agent:
    assert agent.git is not None
    if shutil.which("git") is None:
        raise UsageError("there is no git here; install it")
    address, ref = agent.git, agent.ref or "HEAD"
    place = cache_folder() / "agents" / hashlib.sha256(address.encode()).hexdigest()[:24]
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"{place}: cannot be made: {error.strerror}") from None
    if not (place / "HEAD").exists():
        _git(["init", "--quiet", "--bare", "--template=", str(place)], _ALONE)
    commit = _commit(place, address, ref, network=network)
    files = place / "checked-out" / commit
    if not files.is_dir():
        _check_out(place, commit, files)
    inside = (files / (agent.inside or ".")).resolve()
    if not inside.is_relative_to(files.resolve()) or not inside.is_dir():
        raise UsageError(f"{address} has no folder {agent.inside!r} in {commit[:10]}")
    return dataclasses.replace(agent, folder=inside, commit=commit)


def _commit(place: Path, address: str, ref: str, *, network: bool) -> str:
    """Find the commit, fetched; one that is named by its digits is asked for only once."""
    kept = f"refs/graded/{hashlib.sha256(ref.encode()).hexdigest()[:24]}"
    whole = re.fullmatch("[0-9a-f]{40}", ref) is not None
    if network and not (whole and _resolve(place, ref)):
        words = ["fetch", "--quiet", "--depth", "1", "--no-tags", "--no-recurse-submodules", "--force"]
        words += ["--no-write-fetch-head", "--no-auto-maintenance", "--", address, f"{ref}:{kept}"]
        _git([*_SAFE, f"--git-dir={place}", *words], {}, f"{address}: cannot be fetched")
    commit = _resolve(place, kept) or (_resolve(place, ref) if whole else None)
    if commit is None:
        raise UsageError(f"{address}: {ref} was not fetched yet")
    return commit


def _resolve(place: Path, name: str) -> str | None:
    with contextlib.suppress(UsageError):
        words = ["rev-parse", "--quiet", "--verify", "--end-of-options", f"{name}^{{commit}}"]
        return _git([*_SAFE, f"--git-dir={place}", *words], _ALONE).strip() or None
    return None


def _check_out(place: Path, commit: str, files: Path) -> None:
    """Write a commit's files, after their number and sizes were looked at."""
    _weigh(place, commit)
    files.parent.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=files.parent, prefix="new-") as name:
        target = Path(name) / "files"
        target.mkdir()
        index = {**_ALONE, "GIT_INDEX_FILE": f"{name}/index"}
        base = [*_SAFE, f"--git-dir={place}", f"--work-tree={target}"]
        _git([*base, "read-tree", commit], index, f"{commit[:10]} cannot be checked out")
        _git([*base, "checkout-index", "--all", "--force"], index, f"{commit[:10]} cannot be checked out")
        with contextlib.suppress(OSError):  # another grading was faster
            target.rename(files)


def _weigh(place: Path, commit: str) -> None:
    """Refuse a commit that holds too much, without writing or keeping any of it."""
    words = ["git", *_SAFE, f"--git-dir={place}", "ls-tree", "-r", "-l", "-z", commit]
    size = count = 0
    process = subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=_environment(_ALONE)
    )
    assert process.stdout is not None
    rest = b""
    try:
        while data := process.stdout.read(1 << 16):
            *rows, rest = (rest + data).split(b"\0")
            for row in rows:
                count += 1
                measured = row.split(b"\t", 1)[0].split()[-1]
                size += int(measured) if measured.isdigit() else 0
            if count > MOST_FILES or size > MOST_BYTES or len(rest) > 1 << 16:
                raise UsageError(f"more than {MOST_FILES} files or {MOST_BYTES >> 20} MB in {commit[:10]}")
    finally:
        process.kill()
        process.stdout.close()
        process.wait()


def _environment(extra: dict[str, str]) -> dict[str, str]:
    """Return the user's environment without what names another repository."""
    # On its own git takes no setting from there, either.
    left_out = ("GIT_",) if extra else _OF_A_REPOSITORY
    kept = {name: value for name, value in os.environ.items() if not name.startswith(left_out)}
    return {**kept, **_QUIET, **extra}


def _git(words: Sequence[str], extra: dict[str, str], what: str = "git") -> str:
    """Run git; whatever is wrong is one line."""
    process = subprocess.Popen(
        ["git", *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=_environment(extra),
        **apart(),  # no terminal to ask on
        **file_size_limiter(2 * MOST_BYTES),  # what is packed small may be large
    )
    try:
        output, complaint = process.communicate(timeout=PATIENCE)
    except BaseException as error:
        end_session(process)
        process.communicate()
        if isinstance(error, subprocess.TimeoutExpired):
            raise UsageError(f"{what}: no end after {PATIENCE:g} s") from None
        raise
    if process.returncode:
        lines = [line for line in complaint.decode("utf-8", "replace").splitlines() if line.strip()]
        faults = [line for line in lines if line.startswith(("fatal:", "error:"))]
        raise UsageError(f"{what}: {re.sub(r'^(fatal|error): ', '', [*faults, *lines, 'git failed'][0])}")
    return str(output.decode("utf-8", "replace"))
