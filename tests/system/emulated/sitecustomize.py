"""Lets a program find what it would find on Windows or macOS, as far as Linux can pretend.

Python imports this at its start from a folder on PYTHONPATH, so child processes get it, too. EMULATED_SYSTEM
is ``windows`` or ``macos``. Names that a system lacks are deleted where the standard library can do without
them; others it needs for itself, on this Linux, and they are hidden from the modules of ours alone. What a
system does differently is done so: text files and standard output in cp1252 with CR LF, no waiting for pipes,
no event loop that watches sockets by default, errors of UDP sockets, open files that cannot be replaced or
deleted, names of files, 127.0.0.1 as the only address of the loopback, short datagrams.

EMULATED_TRACES is a folder: a file in it tells that something was used, so that a test can see it.
"""

import asyncio
import asyncio.unix_events
import builtins
import errno
import io
import multiprocessing.context
import os
import select
import selectors
import shutil
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import types
from pathlib import Path

OURS = ("ciberrato", "agent", "simulator_stub", "__main__")
SYSTEM = os.environ.get("EMULATED_SYSTEM")


def asked_by_us(depth=2):
    package = sys._getframe(depth).f_globals
    name = package.get("__package__") or package.get("__name__") or ""
    return name.partition(".")[0] in OURS


def masked(module, hidden=(), shown=None):
    """Hide names of a module from modules of ours, and show them other values of some."""

    def missing(name, value):
        def get(_):
            if asked_by_us():
                raise AttributeError(f"module {module.__name__!r} has no attribute {name!r}")
            return value

        return property(get)

    def other(theirs, value):
        return property(lambda _: theirs if asked_by_us() else value)

    names = {name: missing(name, vars(module)[name]) for name in hidden if name in vars(module)}
    names |= {name: other(theirs, getattr(module, name)) for name, theirs in (shown or {}).items()}
    module.__class__ = type("Masked", (types.ModuleType,), names)


def delete(module, *prefixes):
    for name in [name for name in vars(module) if name.startswith(prefixes)]:
        delattr(module, name)


def without_modules(*names):
    import_any = builtins.__import__

    def import_some(name, *rest, **more):
        if name in names and asked_by_us():
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return import_any(name, *rest, **more)

    builtins.__import__ = import_some


def without_proc():
    """Nothing is found below /proc and /dev/fd."""

    def blind(call):
        def look(path, *rest, **more):
            if isinstance(path, str | Path) and str(path).startswith(("/proc", "/dev/fd", "/dev/shm")):
                raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
            return call(path, *rest, **more)

        return look

    for name in ("open", "stat", "lstat", "listdir", "scandir", "readlink"):
        setattr(os, name, blind(getattr(os, name)))
    io.open = builtins.open = blind(io.open)


def trace(what):
    folder = os.environ.get("EMULATED_TRACES")
    if folder:
        with REAL_OPEN(f"{folder}/{what}", "ab") as file:
            file.write(b"1\n")


NOT_OF_WINDOWS = """
    O_NOFOLLOW O_NONBLOCK O_CLOEXEC O_DIRECTORY O_SYNC pread pwrite mkfifo statvfs set_blocking sendfile
    getuid geteuid getgid getegid uname chown fchmod fchown chroot sysconf getloadavg openpty ttyname
    fork forkpty killpg setsid getpgid getpgrp setpgid setpgrp nice wait wait3 wait4 waitid posix_spawn
    sched_getaffinity sched_setaffinity sched_yield pipe2 memfd_create eventfd
"""
REAL_OPEN = io.open
REAL_SOCKET = socket.socket
REAL_SELECT = select.select
REAL_LISTDIR, REAL_READLINK, REAL_STAT = os.listdir, os.readlink, os.stat


def spawn_only():
    contexts = multiprocessing.context
    contexts._default_context._default_context = contexts._concrete_contexts["spawn"]


def windows():
    delete(select, "poll", "POLL", "epoll", "EPOLL")
    selectors.DefaultSelector = selectors.SelectSelector
    for name in ("SIGHUP", "SIGALRM", "SIGUSR1", "SIGUSR2", "SIGVTALRM", "SIGPROF", "alarm", "setitimer"):
        delattr(signal, name)
    signal.SIGBREAK = signal.SIGQUIT
    signal.CTRL_C_EVENT, signal.CTRL_BREAK_EVENT = 0, 1
    subprocess.CREATE_NEW_PROCESS_GROUP = 0x200
    socket.SO_EXCLUSIVEADDRUSE = ~socket.SO_REUSEADDR
    known = {"SIGINT", "SIGTERM", "SIGBREAK", "SIGABRT", "SIGFPE", "SIGILL", "SIGSEGV"}
    masked(
        signal,
        [name for name in vars(signal) if name.startswith("SIG") and name[3] != "_" and name not in known]
        + ["pthread_kill", "pthread_sigmask", "sigwait", "siginterrupt", "pause", "getitimer"],
    )
    masked(os, NOT_OF_WINDOWS.split(), {"name": "nt"})
    masked(socket, ["AF_UNIX", "TCP_QUICKACK", "recv_fds", "send_fds", "sethostname"])
    masked(sys, (), {"platform": "win32"})
    without_modules("fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "posix")
    without_proc()
    for method in ("fork", "forkserver"):
        multiprocessing.context._concrete_contexts.pop(method)
    spawn_only()
    windows_signals()
    windows_sockets()
    windows_loops()
    windows_processes()
    windows_files()
    sys.stdout.reconfigure(encoding="cp1252", errors="strict", newline="\r\n")
    sys.stderr.reconfigure(encoding="cp1252", errors="backslashreplace", newline="\r\n")


def is_socket(descriptor):
    number = descriptor if isinstance(descriptor, int) else descriptor.fileno()
    return stat.S_ISSOCK(os.fstat(number).st_mode)


def windows_signals():
    take, wake_up = signal.signal, signal.set_wakeup_fd

    def take_some(number, handler):
        if number not in {2, 3, 4, 6, 8, 11, 15}:
            raise ValueError("invalid signal value")
        return take(number, handler)

    def wake_up_by_socket(descriptor, **options):
        if descriptor >= 0 and not is_socket(descriptor):
            raise ValueError("a pipe cannot wake up select")
        return wake_up(descriptor, **options)

    signal.signal, signal.set_wakeup_fd = take_some, wake_up_by_socket


class WindowsSocket(socket.socket):
    """Errors as Windows reports them."""

    recvmsg = recvmsg_into = sendmsg = property(lambda self: self._lacking())

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        if self.type == socket.SOCK_DGRAM:
            super().setsockopt(socket.IPPROTO_IP, 11, 1)  # IP_RECVERR: refused datagrams are reported

    def _lacking(self):
        raise AttributeError("'socket' object has no such attribute")

    def setsockopt(self, level, option, *value):
        if level == socket.SOL_SOCKET and option == socket.SO_REUSEADDR and asked_by_us():
            raise AssertionError("SO_REUSEADDR lets others take the port")
        if level == socket.SOL_SOCKET and option == socket.SO_EXCLUSIVEADDRUSE:
            trace("exclusive")
            option, value = socket.SO_REUSEADDR, (int(self.type == socket.SOCK_STREAM),)
        super().setsockopt(level, option, *value)

    def _taken(self, take, most, flags):
        if self.type == socket.SOCK_DGRAM and self.getsockname()[1] == 0:
            raise OSError(errno.EINVAL, "[WinError 10022] the socket is not bound")
        try:
            data = take(self, 65536 if self.type == socket.SOCK_DGRAM else most, *flags)
        except ConnectionRefusedError:
            trace("reset")
            raise ConnectionResetError(errno.ECONNRESET, "[WinError 10054] forcibly closed") from None
        if len(data if isinstance(data, bytes) else data[0]) > most:
            raise OSError(errno.EMSGSIZE, "[WinError 10040] larger than the buffer")
        return data

    def recv(self, most, *flags):
        return self._taken(REAL_SOCKET.recv, most, flags)

    def recvfrom(self, most, *flags):
        return self._taken(REAL_SOCKET.recvfrom, most, flags)

    def sendto(self, *arguments):
        try:
            return super().sendto(*arguments)
        except ConnectionRefusedError:  # of the one before, which Windows would report to the reader
            return super().sendto(*arguments)


def windows_sockets():
    def pair(*_):
        with socket.create_server(("127.0.0.1", 0)) as listening:
            one = socket.create_connection(listening.getsockname())
            other, _ = listening.accept()
        return one, other

    def select_sockets(reading, writing, failing, *seconds):
        if not (reading or writing or failing):
            raise OSError(errno.EINVAL, "[WinError 10022] nothing to select from")
        if not all(map(is_socket, [*reading, *writing, *failing])):
            raise OSError(errno.ENOTSOCK, "[WinError 10038] not a socket")
        return REAL_SELECT(reading, writing, failing, *seconds)

    socket.socket = WindowsSocket
    socket.socketpair = pair
    select.select = select_sockets


def windows_loops():
    def lacking(self, *_, **__):
        raise NotImplementedError

    selector = asyncio.SelectorEventLoop
    no_pipes = dict.fromkeys(
        ("add_signal_handler", "connect_read_pipe", "connect_write_pipe", "subprocess_exec"), lacking
    )
    no_sockets = dict.fromkeys(("add_reader", "remove_reader", "add_writer", "remove_writer"), lacking)
    asyncio.SelectorEventLoop = type("WindowsSelectorEventLoop", (selector,), no_pipes)
    proactor = type("ProactorEventLoop", (selector,), no_sockets | no_pipes)
    asyncio.ProactorEventLoop = proactor
    # Python 3.14 warns of the public name.
    policy = getattr(asyncio.unix_events, "_DefaultEventLoopPolicy", None) or asyncio.DefaultEventLoopPolicy
    policy._loop_factory = proactor


def windows_processes():
    begin = subprocess.Popen.__init__

    def start(self, *arguments, **options):
        if options.get("preexec_fn") is not None:
            raise ValueError("preexec_fn is not supported on Windows platforms")
        if options.get("pass_fds"):
            raise AssertionError("pass_fds not supported on Windows.")
        options["start_new_session"] = False
        flags = options.pop("creationflags", 0)
        options["process_group"] = 0 if flags & 0x200 else None
        begin(self, *arguments, **options)

    def send(self, number):
        if self.poll() is None and number == signal.CTRL_BREAK_EVENT:
            KILL(self.pid, signal.SIGBREAK)
        elif self.poll() is None:
            if number != signal.SIGTERM:
                raise ValueError(f"Unsupported signal: {number}")
            KILL(self.pid, 9)

    def terminate(self):
        send(self, signal.SIGTERM)

    subprocess.Popen.__init__ = start
    subprocess.Popen.send_signal, subprocess.Popen.terminate, subprocess.Popen.kill = (
        send,
        terminate,
        terminate,
    )


KILL = os.kill


def held_open(path):
    """Whether a process has a file open, which Windows then neither replaces nor deletes."""
    try:
        wanted = REAL_STAT(path)
    except OSError:
        return False
    if not stat.S_ISREG(wanted.st_mode):
        return False
    for process in REAL_LISTDIR("/proc"):
        if process.isdigit():
            try:
                for name in REAL_LISTDIR(f"/proc/{process}/fd"):
                    if os.path.samestat(REAL_STAT(f"/proc/{process}/fd/{name}"), wanted):
                        return True
            except OSError:
                continue
    return False


def windows_files():
    replace, unlink, open_any, make = os.replace, os.unlink, io.open, os.mkdir

    def denied(path):
        trace("denied")
        raise PermissionError(errno.EACCES, "[WinError 32] another process uses the file", str(path))

    def replace_closed(source, target, **options):
        for path in (source, target):
            if held_open(path):
                denied(path)
        replace(source, target, **options)

    def rename(source, target, **options):
        if os.path.exists(target):
            raise FileExistsError(errno.EEXIST, "[WinError 183] exists already", str(target))
        replace_closed(source, target, **options)

    def unlink_closed(path, **options):
        if "dir_fd" not in options and held_open(path):
            denied(path)
        unlink(path, **options)

    def named(path):
        if isinstance(path, str | Path) and set(str(path)) & set('<>:"|?*\\'):
            raise OSError(errno.EINVAL, "[WinError 123] the name is not a file's", str(path))

    def open_in_cp1252(file, mode="r", buffering=-1, encoding=None, errors=None, newline=None, *rest, **more):
        named(file)
        if "b" not in mode:
            encoding = "cp1252" if encoding in (None, "locale") else encoding
            if newline is None and set(mode) & set("wax+"):
                newline = "\r\n"
        return open_any(file, mode, buffering, encoding, errors, newline, *rest, **more)

    def mkdir(path, *rest, **options):
        named(path)
        make(path, *rest, **options)

    os.replace, os.rename, os.unlink, os.remove, os.mkdir = (
        replace_closed,
        rename,
        unlink_closed,
        unlink_closed,
        mkdir,
    )
    io.open = builtins.open = open_in_cp1252
    shutil._use_fd_functions = False
    tempfile._os = os


class MacSocket(socket.socket):
    """One address on the loopback, and datagrams of 9216 bytes unless more is asked for."""

    _longest = 9216

    def bind(self, address):
        if address[0].startswith("127.") and address[0] != "127.0.0.1":
            trace("address")
            raise OSError(errno.EADDRNOTAVAIL, "Can't assign requested address")
        super().bind(address)

    def setsockopt(self, level, option, *value):
        if level == socket.SOL_SOCKET and option == socket.SO_SNDBUF:
            self._longest = value[0]
        super().setsockopt(level, option, *value)

    def _fits(self, data):
        if self.type == socket.SOCK_DGRAM and len(data) > self._longest:
            raise OSError(errno.EMSGSIZE, "Message too long")

    def send(self, data, *flags):
        self._fits(data)
        return super().send(data, *flags)

    def sendto(self, data, *rest):
        self._fits(data)
        return super().sendto(data, *rest)


def macos():
    delete(select, "epoll", "EPOLL")
    selectors.DefaultSelector = selectors.PollSelector
    masked(os, ["sched_getaffinity", "sched_setaffinity", "memfd_create", "pipe2", "eventfd"])
    masked(socket, ["TCP_QUICKACK"])
    masked(sys, (), {"platform": "darwin"})
    without_proc()
    spawn_only()
    socket.socket = MacSocket


if SYSTEM:
    {"windows": windows, "macos": macos}[SYSTEM]()
    trace(SYSTEM)
