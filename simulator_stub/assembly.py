"""From the options of the command line to a server that is ready to run."""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import re
import secrets
from collections.abc import Callable, Iterator
from dataclasses import replace

from ciberrato import machine_code
from ciberrato.checks.telling import tell
from ciberrato.checks.things import start_findings, thing_findings
from ciberrato.errors import UsageError
from ciberrato.files.findings import Finding
from ciberrato.files.lab import default_lab, parse_lab_file
from ciberrato.files.parameters import parse_parameter_file
from ciberrato.files.start_grid import GridFile, default_grid, parse_grid_file
from ciberrato.files.xml import read_file
from ciberrato.labs import find_grid, find_lab, find_parameters
from ciberrato.net.address import DEFAULT_HOST
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import GridPosition, StartGrid
from simulator_stub.options import DEFAULT_ANSWER_LIMIT
from simulator_stub.recording.date import log_date
from simulator_stub.recording.log import LogFile
from simulator_stub.recording.observer import Observer
from simulator_stub.recording.reference_files import ReferenceFiles
from simulator_stub.recording.results import Results
from simulator_stub.recording.truth import TruthFile
from simulator_stub.service.audience import VIEW_LIMIT, Admission
from simulator_stub.service.kidnapping import Kidnapper, parse_kidnapping
from simulator_stub.service.pace import Lockstep, Pace, RealTime
from simulator_stub.service.ready import tell_ready
from simulator_stub.service.runs import Runs
from simulator_stub.service.server import Server, open_transports
from simulator_stub.service.session import Session
from simulator_stub.service.transports import TRANSPORTS, Transport
from simulator_stub.service.vigil import Vigil
from simulator_stub.simulation import Simulation

_REAL = r"\s*[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?\s*"
_INLINE_GRID = re.compile(rf"{_REAL},{_REAL},{_REAL}(?:;{_REAL},{_REAL},{_REAL})*;?")
_LIKE_POSES = re.compile(r"[^/\\]*[,;][^/\\]*|[\s\d.+-]*")
"""Words that are no file were probably meant as poses: with a comma or a semicolon, or of digits alone."""

Print = Callable[[str], None]


def build_server(
    options: argparse.Namespace, *, print_line: Print, notify: Print, warn: Print | None = None
) -> Server:
    """Read the files, open the ports, say so, and put everything together.

    Parameters
    ----------
    options : argparse.Namespace
        As `simulator_stub.options` parses them.
    print_line : callable
        Gets the seed and the ports, one line each.
    notify : callable
        Gets messages for people.
    warn : callable, optional
        Gets those that they have to know in any case; by default as `notify`.

    Returns
    -------
    Server

    Raises
    ------
    CiberratoError
        If a file, an option or a port cannot be used.
    """
    if options.compiled and not machine_code.available():
        raise UsageError("argument --compiled: needs numba: pip install 'ciberrato[fast]'")
    lab, grid, parameters = read_world(options, notify)
    seed = secrets.randbits(32) if options.seed is None else options.seed
    try:
        simulation = Simulation(
            lab, grid, parameters, seed, options.scoring, sensors=options.sensor, compiled=options.compiled
        )
    except ValueError as error:
        raise UsageError(f"argument --sensor: {error}") from None
    kidnapper = _kidnapper(options)
    host = DEFAULT_HOST if options.bind is None else options.bind
    losses: list[str] = []

    def lost(line: str) -> None:
        losses.append(line)
        (warn or notify)(line)

    # Ports first: the files of a simulator that already runs there must not be overwritten.
    transports = open_transports(
        [name for name in TRANSPORTS if name != "tcp" or options.tcp], host, options.port
    )
    with contextlib.ExitStack() as opened:
        for transport in transports:
            opened.callback(transport.close)
        observers: list[Observer] = []
        for observer in _observers(options, simulation, lost):
            opened.callback(observer.close)
            observers.append(observer)
        results = Results(
            seed=seed, scoring=options.scoring, path=options.result, notify=notify, lost=warn or notify
        )
        observers.append(results)
        opened.pop_all()  # all went well
    session = Session(
        simulation,
        autostart=options.autostart,
        observers=observers,
        kidnapper=kidnapper,
        restarts=not options.no_restart,
        admission=Admission(
            local_only=options.views == "local",
            own=host,
            token=options.view_token,
            limit=options.views if isinstance(options.views, int) else VIEW_LIMIT,
        ),
        notify=notify,
    )
    runs = Runs(
        session,
        results,
        seed=seed,
        count=options.runs or int(options.exit_at_end or options.exit_when_silent is not None),
        most_silent=_silent_cycles(options, parameters),
    )
    print_line(f"seed {seed}")
    _announce(transports, host, print_line)
    _tell_who_is_heard(options, host, notify)
    pace = _pace(options, session, parameters, notify)
    results.answers = session.answers
    results.dropped = lambda: (
        session.take_stock(),
        {number: client.dropped for number, client in session.robots.items()},
    )
    results.losses = losses
    if isinstance(pace, Lockstep):
        results.lockstep = pace.counts
    server = Server(session, transports, pace, runs.go_on)
    server.records_are_whole = lambda: not losses and results.current
    tell_ready(server.port, options.ready_file, options.ready_fd)
    return server


def _tell_who_is_heard(options: argparse.Namespace, host: str, notify: Print) -> None:
    """Report in one line who can reach the simulator, where that may surprise."""
    if options.bind is None:
        notify(
            "only programs on this machine can connect; for robots on the network, as in a class, add "
            "--bind 0.0.0.0 --views local"
        )
    elif not host.startswith("127.") and options.views == "all" and options.view_token is None:
        notify(
            f"all programs that reach {host} may view, start, stop, reset and remove robots; "
            "to limit this, add --views local or --view-token TEXT"
        )


def _silent_cycles(options: argparse.Namespace, parameters: Parameters) -> int | None:
    """Return the number of cycles without a message of any robot that end a run; None = any number."""
    seconds: float | None = options.exit_when_silent
    if seconds is None or math.isinf(seconds):
        return None
    return math.ceil(seconds * 1000.0 / max(parameters.cycle_time, 1))


def read_world(options: argparse.Namespace, notify: Print) -> tuple[Lab, StartGrid, Parameters]:
    """Read lab, grid and parameters; the command line wins over what the parameter file names.

    Raises
    ------
    CiberratoError
        If a file cannot be used, or with ``--strict`` if there is a warning about one.
    """
    found: list[Finding] = []
    parameters = Parameters()
    if options.param is not None:
        path = find_parameters(options.param)
        file = parse_parameter_file(read_file(path), str(path))
        parameters, found = file.parameters, [*file.findings]
    inline = options.grid is not None and _INLINE_GRID.fullmatch(options.grid)
    parameters = replace(
        parameters,
        lab_file=parameters.lab_file if options.lab is None else options.lab,
        # Poses given in place are not announced: the robots are not to know them.
        grid_file=None if inline else parameters.grid_file if options.grid is None else options.grid,
        gps=parameters.gps or options.gps,
        beacon_sensor=parameters.beacon_sensor or options.beacon,
        compass_sensor=parameters.compass_sensor or options.compass,
    )
    if parameters.lab_file is None:
        lab = default_lab()
    else:
        path = find_lab(parameters.lab_file)
        lab_file = parse_lab_file(read_file(path), str(path))
        lab = lab_file.lab
        found += [*lab_file.findings, *thing_findings(lab_file)]
    if inline:
        grid = GridFile(grid=_parse_inline(options.grid), source="--grid")
    elif parameters.grid_file is None:
        grid = GridFile(grid=default_grid(), source="built-in start grid")
    else:
        if options.grid is not None:
            _explain_poses(options.grid)
        path = find_grid(parameters.grid_file)
        grid = parse_grid_file(read_file(path), str(path))
    found += [*grid.findings, *start_findings(grid.grid, lab, grid.source, grid.lines)]
    tell(found, notify, strict=options.strict)
    return lab, grid.grid, parameters


def _explain_poses(text: str) -> None:
    """Refuse what was meant as poses, and is none."""
    if _LIKE_POSES.fullmatch(text) and not os.path.exists(text):
        raise UsageError(
            f"argument --grid: {text!r} is no file, and not X,Y,DIR[;X,Y,DIR...] (units and degrees, "
            "a semicolon between robots); write for example 1,1,0"
        )


def _parse_inline(text: str) -> StartGrid:
    poses = [[float(number) for number in pose.split(",")] for pose in text.rstrip("; ").split(";")]
    return StartGrid(
        positions=tuple(GridPosition(x=x, y=y, direction_deg=degrees) for x, y, degrees in poses)
    )


def _kidnapper(options: argparse.Namespace) -> Kidnapper | None:
    try:
        return Kidnapper([parse_kidnapping(text) for text in options.kidnap]) if options.kidnap else None
    except ValueError as error:
        raise UsageError(f"argument --kidnap: {error}") from None


def _observers(options: argparse.Namespace, simulation: Simulation, lost: Print) -> Iterator[Observer]:
    if options.truth is not None:
        yield TruthFile(options.truth, lost)
    if options.log is not None:
        yield LogFile(options.log, log_date(options.seed if options.reproducible else None), lost)
    if simulation.scoring.has_documents:
        yield ReferenceFiles(options.scoring_files, lost)


def _announce(transports: list[Transport], host: str, print_line: Print) -> None:
    for transport in transports:
        print_line(f"listening on {transport.name} {host}:{transport.port}")


def _pace(options: argparse.Namespace, session: Session, parameters: Parameters, notify: Print) -> Pace:
    period = parameters.cycle_time / 1000.0 / options.speed
    if options.lockstep:
        limit = DEFAULT_ANSWER_LIMIT if options.answer_limit is None else options.answer_limit
        adaptive = options.answer_limit is None
        return Lockstep(session, period, limit=limit, adaptive=adaptive, notify=notify, vigil=Vigil())
    return RealTime(session, period)
