"""The plugin: fixtures, the marker ``ciberrato``, and what a failing test leaves behind.

pytest loads this in every project that has `ciberrato` installed, so it imports next to nothing; all else is
imported when a test asks for a fixture.
"""

from __future__ import annotations

import functools
import shutil
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from ciberrato.grading.conformance.check import Judged
    from ciberrato.testing.runs import AgentRun
    from ciberrato.testing.simulators import RunningSimulator

_MARKER = """\
ciberrato(lab="maze", seeds=[1, 2, 3], ...): defaults for ciberrato_run, ciberrato_simulator and \
ciberrato_check; with seeds the test is run once for each (see docs/test-your-agent.md)"""

_FOLDER = "ciberrato-failures"
_RUNS = pytest.StashKey["list[AgentRun | RunningSimulator]"]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option for the folder of failures."""
    parser.getgroup("ciberrato").addoption(
        "--ciberrato-failures",
        default=_FOLDER,
        metavar="DIR",
        help=f"folder for logs, pictures and files of tests that failed; default: {_FOLDER}",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker."""
    config.addinivalue_line("markers", _MARKER)


def _home(config: pytest.Config) -> Path:
    """Return the project's folder: that of its pyproject.toml or pytest.ini, or where pytest was started."""
    return config.rootpath if config.inipath is not None else Path(config.invocation_params.dir)


def _marked(item: pytest.Item) -> dict[str, Any]:
    """Return the options of all markers, the nearest first.

    Raises
    ------
    UsageError
        Of `ciberrato.errors`, if one is not known.
    """
    options: dict[str, Any] = {}
    for marker in reversed(list(item.iter_markers("ciberrato"))):
        from ciberrato.errors import UsageError
        from ciberrato.testing.options import MARKER, merged

        if marker.args:
            raise UsageError(f"@pytest.mark.ciberrato: options have names, as in lab={marker.args[0]!r}")
        merged(MARKER, marker.kwargs, where="@pytest.mark.ciberrato")
        options |= marker.kwargs
    return options


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Find no tests in what was kept of tests."""
    if collection_path.name == Path(config.getoption("--ciberrato-failures")).name:
        return collection_path == _kept(config) or None
    return None


def _kept(config: pytest.Config) -> Path:
    return _home(config) / str(config.getoption("--ciberrato-failures"))


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Create a test for each seed."""
    if metafunc.definition.get_closest_marker("ciberrato") is None:
        return
    from ciberrato.errors import UsageError
    from ciberrato.testing.options import seeds_of

    try:
        options = _marked(metafunc.definition)
        if options.get("seeds") is None:
            return
        seeds = seeds_of(options["seeds"])
        if "ciberrato_seed" not in metafunc.fixturenames:
            raise UsageError(
                "@pytest.mark.ciberrato(seeds=...): the test takes none of the fixtures ciberrato_run, "
                "ciberrato_simulator, ciberrato_check and ciberrato_seed"
            )
    except UsageError as error:
        raise pytest.Collector.CollectError(f"{metafunc.definition.nodeid}: {error}") from None
    metafunc.parametrize("ciberrato_seed", seeds, ids=[f"seed{seed}" for seed in seeds])


@pytest.fixture
def ciberrato_seed(request: pytest.FixtureRequest) -> int:
    """Return the seed of the test's runs: one of the marker's ``seeds``, or its ``seed``; else 1."""
    return int(_marked(request.node).get("seed", 1))


def _told(method: Callable[..., Any]) -> Callable[..., Any]:
    """Raise mistakes in a call at the call, not in here."""

    @functools.wraps(method)
    def call(*words: Any, **options: Any) -> Any:
        __tracebackhide__ = True
        from ciberrato.errors import CiberratoError

        try:
            return method(*words, **options)
        except CiberratoError as error:
            raise error.with_traceback(None) from None

    return call


class _Bench:
    """State that the fixtures share."""

    def __init__(self, request: pytest.FixtureRequest, seed: int, temporary: Path) -> None:
        self._item = request.node
        self._seed = seed
        self._temporary = temporary
        self._home = _home(request.config)
        self._marked = _marked(request.node)
        self.runs: list[AgentRun | RunningSimulator] = request.node.stash.setdefault(_RUNS, [])

    def __repr__(self) -> str:
        return f"<{self._item.name}, seed {self._seed}>"

    @property
    def _places(self) -> list[Path]:
        return [self._item.path.parent, self._home]

    def _options(self, known: Mapping[str, Any], given: Mapping[str, Any], where: str) -> dict[str, Any]:
        from ciberrato.errors import UsageError
        from ciberrato.grading.sandbox import KINDS
        from ciberrato.testing.options import merged

        usual = {name: value for name, value in self._marked.items() if name in known}
        options = merged({**known, "seed": self._seed}, usual, {"seed": self._seed}, given, where=where)
        seed, sandbox = options["seed"], options.get("sandbox", "none")
        if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
            raise UsageError(f"seed={seed!r}: a whole number, 0 or more, was expected")
        if sandbox not in KINDS:
            raise UsageError(f"sandbox={sandbox!r}: no such sandbox; choose one of {', '.join(KINDS)}")
        return options

    def _folder(self) -> Path:
        return self._temporary / f"run-{len(self.runs) + 1}"

    def _agent_folder(self, options: Mapping[str, Any]) -> Path:
        from ciberrato.errors import UsageError

        folder = self._home if options["folder"] is None else self._home / options["folder"]
        if not folder.is_dir():
            raise UsageError(f"folder={options['folder']!r}: no such folder: {folder}; check the path")
        return folder

    @_told
    def run(self, command: str | Sequence[str], **given: Any) -> AgentRun:
        """Run an agent once; see docs/test-your-agent.md."""
        from ciberrato.testing.options import RUN, agent_of, command_words, lab_of, limits_of
        from ciberrato.testing.runs import run_agent

        options = self._options(RUN, given, "ciberrato_run")
        words = command_words(command)
        agent = agent_of(options, words, self._agent_folder(options))
        pace = {name: options[name] for name in ("lockstep", "speed", "answer_limit", "sandbox")}
        lab, limits = lab_of(options, self._places), limits_of(options)
        run = run_agent(agent, lab, options["seed"], self._folder(), limits=limits, **pace)
        self.runs.append(run)
        return run

    @_told
    def simulator(self, **given: Any) -> RunningSimulator:
        """Start a simulator; see docs/test-your-agent.md."""
        from ciberrato.testing.options import WORLD, lab_of
        from ciberrato.testing.simulators import RunningSimulator

        options = self._options({**WORLD, "autostart": 1}, given, "ciberrato_simulator")
        lab = lab_of(options, self._places)
        simulator = RunningSimulator(
            lab, options["seed"], self._folder(), options, autostart=options["autostart"]
        )
        self.runs.append(simulator)
        return simulator

    @_told
    def check(
        self, command: str | Sequence[str], rows: str | Sequence[str] = (), **given: Any
    ) -> list[Judged]:
        """Check an agent with the conformance check; see docs/test-your-agent.md."""
        from ciberrato.grading.conformance.check import check_agent, rows_named
        from ciberrato.grading.conformance.report import text_report
        from ciberrato.grading.sandbox import choose
        from ciberrato.grading.workspace import stage_folder
        from ciberrato.testing.options import RUN, agent_of, command_words, lab_of, limits_of

        options = self._options({**RUN, "patience": 2.0}, given, "ciberrato_check")
        wanted = rows_named([rows] if isinstance(rows, str) else rows)
        words = command_words(command)
        staged = self._temporary / "checked"
        stage_folder(self._agent_folder(options), staged)
        try:
            judged = check_agent(
                agent_of(options, words, staged),
                lab_of(options, self._places),
                rows=wanted,
                seed=options["seed"],
                patience=options["patience"],
                limits=limits_of(options),
                sandbox=choose(options["sandbox"]),
                jobs=2,
            )
        finally:
            shutil.rmtree(staged, ignore_errors=True)
        if not all(one.passed for one in judged):
            pytest.fail(text_report(judged, failed_only=True), pytrace=False)
        return judged

    def end(self) -> None:
        """Stop all simulators."""
        for run in self.runs:
            stop = getattr(run, "stop", None)
            if stop is not None:
                stop()


@pytest.fixture
def _ciberrato_bench(
    request: pytest.FixtureRequest, ciberrato_seed: int, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[_Bench]:
    shutil.rmtree(_failures(request.node), ignore_errors=True)  # of the last time
    bench = _Bench(request, ciberrato_seed, tmp_path_factory.mktemp("ciberrato"))
    yield bench
    bench.end()


@pytest.fixture
def ciberrato_run(_ciberrato_bench: _Bench) -> Callable[..., AgentRun]:
    """Run an agent in any language: ``run = ciberrato_run("./robot -h {host}:{port}", lab="maze")``.

    Returns score, collisions, arrival, exit status, output, files, and the true poses as arrays.
    """
    return _ciberrato_bench.run


@pytest.fixture
def ciberrato_simulator(_ciberrato_bench: _Bench) -> Callable[..., RunningSimulator]:
    """Start a seeded simulator on a free port: ``simulator = ciberrato_simulator(lab="maze", seed=3)``.

    ``simulator.address`` is where robots register; it is stopped when the test ends.
    """
    return _ciberrato_bench.simulator


@pytest.fixture
def ciberrato_check(_ciberrato_bench: _Bench) -> Callable[..., list[Judged]]:
    """Check an agent on lost and late messages, Stop, silence: ``ciberrato_check("./robot -h {host}")``.

    The test fails with what was done, expected and seen, if a row fails.
    """
    return _ciberrato_bench.check


def _failures(item: pytest.Item) -> Path:
    from ciberrato.testing.failures import folder_of

    return _kept(item.config) / folder_of(item.nodeid)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Keep the files of the runs of a test that has failed, and report where."""
    report = yield
    runs = item.stash.get(_RUNS, [])
    if report.failed and runs and call.when in ("setup", "call"):
        from ciberrato.testing.failures import keep

        start = Path(item.config.invocation_params.dir)
        try:
            lines = keep(runs, _failures(item), test=item.nodeid, start=start)
        except OSError as error:
            lines = [f"nothing could be kept: {error}"]
        report.sections.append(("ciberrato", "\n".join(lines)))
    return report
