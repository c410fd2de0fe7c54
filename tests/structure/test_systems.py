"""What only some systems have is named in one room: asserted from the programs themselves."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOM = ROOT / "ciberrato" / "system"
# What Linux tells of a client's process, and its control groups; on other systems nothing is found.
LINUX = {"simulator_stub/service/client_process.py", "ciberrato/grading/cgroups.py"}
BOUND = {
    "sys": {"platform", "getwindowsversion"},
    "platform": {"system", "platform", "uname"},
    "select": {"poll", "epoll", "kqueue", "POLLIN", "POLLOUT"},
    "signal": {
        "SIGHUP",
        "SIGKILL",
        "SIGALRM",
        "SIGSTOP",
        "SIGBREAK",
        "SIGUSR1",
        "alarm",
        "setitimer",
        "pthread_kill",
    },
    "socket": {"AF_UNIX", "SO_REUSEADDR", "SO_REUSEPORT", "TCP_QUICKACK", "SO_EXCLUSIVEADDRUSE"},
    "os": {
        *(
            "name",
            "fork",
            "killpg",
            "setsid",
            "getpgid",
            "setpgid",
            "getuid",
            "geteuid",
            "getgid",
            "nice",
            "wait",
        ),
        *(
            "sched_getaffinity",
            "sched_yield",
            "sysconf",
            "uname",
            "mkfifo",
            "set_blocking",
            "statvfs",
            "pread",
        ),
        *(
            "O_CLOEXEC",
            "O_NOFOLLOW",
            "O_NONBLOCK",
            "posix_spawn",
            "waitpid",
            "pipe2",
            "openpty",
            "getloadavg",
        ),
    },
    "subprocess": {"CREATE_NEW_PROCESS_GROUP", "STARTUPINFO"},
}
MODULES = {"fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "posix", "msvcrt", "winreg", "_winapi"}
METHODS = {"recvmsg", "sendmsg", "add_signal_handler", "connect_read_pipe", "add_child_handler"}
OPTIONS = {"preexec_fn", "start_new_session", "process_group", "pass_fds", "creationflags"}
PATHS = ("/proc", "/dev/")


def programs():
    return [path for name in ("ciberrato", "agent", "simulator_stub") for path in (ROOT / name).rglob("*.py")]


def bound_names(path):
    """Yield what a module names that only some systems have, with the line."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute):
            owner = node.value.id if isinstance(node.value, ast.Name) else None
            if node.attr in BOUND.get(owner, ()) or node.attr in METHODS:
                yield f"{node.lineno}: {owner}.{node.attr}"
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names = {alias.name for alias in node.names} if isinstance(node, ast.Import) else {node.module}
            yield from (f"{node.lineno}: import {name}" for name in names & MODULES)
            if isinstance(node, ast.ImportFrom):
                bound = {alias.name for alias in node.names} & BOUND.get(node.module, set())
                yield from (f"{node.lineno}: from {node.module} import {name}" for name in bound)
        elif isinstance(node, ast.keyword) and node.arg in OPTIONS:
            yield f"{node.value.lineno}: {node.arg}="
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.startswith(PATHS):
            yield f"{node.lineno}: {node.value!r}"


# bubblewrap is Linux's: options name paths inside. The supervisor hands on what the room says.
ELSEWHERE = {
    "ciberrato/grading/sandbox.py": ("'/proc'", "'/dev'"),
    "ciberrato/grading/supervisor.py": ("preexec_fn=",),
    "ciberrato/grading/tournament/keeper.py": ("preexec_fn=",),
}


def test_what_only_some_systems_have_is_named_in_one_room():
    wrong = [
        f"{name}:{found}"
        for path in programs()
        if not path.is_relative_to(ROOM) and (name := path.relative_to(ROOT).as_posix()) not in LINUX
        for found in bound_names(path)
        if not found.endswith(ELSEWHERE.get(name, ("nothing",)))
    ]
    assert not wrong


def test_the_room_does_name_them():
    assert len([found for path in ROOM.glob("*.py") for found in bound_names(path)]) > 20


def opens_text(call):
    """Whether a call opens or writes a file of text, and with which of the two keywords."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    keywords = {keyword.arg for keyword in call.keywords}
    if name in ("read_text", "write_text"):
        return name == "write_text", keywords
    if name == "open":
        modes = [
            one.value for one in call.args if isinstance(one, ast.Constant) and isinstance(one.value, str)
        ]
        mode = next((one for one in modes if one and set(one) <= set("rwaxbt+")), None)
        if mode is not None and "b" not in mode:
            return bool(set(mode) & set("wax+")), keywords
    return None


def test_text_files_have_an_encoding_and_the_same_line_ends_everywhere():
    wrong = []
    for path in programs():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and (found := opens_text(node)) is not None:
                writes, keywords = found
                if "encoding" not in keywords or (writes and "newline" not in keywords):
                    wrong.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert not wrong


@pytest.mark.slow
@pytest.mark.parametrize("system", ["win32", "darwin"])
def test_a_type_checker_for_another_system_stumbles_in_the_room_only(system, tmp_path):
    pytest.importorskip("mypy")
    words = [sys.executable, "-m", "mypy", "--platform", system, "--cache-dir", str(tmp_path)]
    words += ["ciberrato", "agent", "simulator_stub"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, encoding="utf-8", check=False)
    errors = [line.replace("\\", "/") for line in done.stdout.splitlines() if ": error:" in line]
    assert done.stdout
    assert not [line for line in errors if not line.startswith(("ciberrato/system/", *LINUX))]
    assert bool(errors) == (system == "win32"), errors
