"""Make the tests independent of how they are started and of what their user keeps.

A run in the background ignores SIGINT, one under ``nohup`` SIGHUP, and processes inherit that. While the
tests run such a signal is taken and dropped instead: for this process it is the same, and the processes that
tests start have the handlers that they have in a terminal.
"""

import signal
from collections.abc import Iterator

import hypothesis
import pytest

from tests.recordings import GOLDEN, LABS, VARIABLES

NAMES = ("SIGINT", "SIGTERM", "SIGHUP")  # Windows has no SIGHUP
SIGNALS = tuple(getattr(signal, name) for name in NAMES if hasattr(signal, name))

# The same examples every time, and no clock that judges them: a run that fails says something about a change.
# `--hypothesis-profile=default` searches anew.
hypothesis.settings.register_profile(
    "repeatable",
    derandomize=True,
    deadline=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("repeatable")


def pytest_configure() -> None:
    for variable, folder in zip(VARIABLES, (GOLDEN, LABS), strict=True):
        if folder is not None and not folder.is_dir():
            raise pytest.UsageError(f"{variable}={folder}: no such folder; name another, or unset it")


WHOLE_PROGRAMS = {"chaos", "conformance", "grading", "gym", "structure", "system", "testing"}
"""Folders whose slow tests run programs to their end, many times: for `make thorough`, and CI."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.get_closest_marker("slow") and item.path.parent.name in WHOLE_PROGRAMS:
            item.add_marker("thorough")


def pytest_runtest_setup(item: pytest.Item) -> None:
    for mark in item.iter_markers("recordings"):
        if mark.args[0]:
            pytest.skip(f"set {' and '.join(mark.args[0])} to run this")


@pytest.fixture(scope="session", autouse=True)
def signals_as_in_a_terminal() -> Iterator[None]:
    ignored = [number for number in SIGNALS if signal.getsignal(number) is signal.SIG_IGN]
    for number in ignored:
        signal.signal(number, lambda *_: None)
    yield
    for number in ignored:
        signal.signal(number, signal.SIG_IGN)


@pytest.fixture(scope="session", autouse=True)
def a_cache_of_their_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Tables that a user has computed before must not change what is tested, nor tests what a user has."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CIBERRATO_CACHE", str(tmp_path_factory.mktemp("tables")))
        yield
