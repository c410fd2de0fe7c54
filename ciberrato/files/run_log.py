"""The log of an agent's run: JSON Lines, a line a cycle, written as the run goes on and read back afterwards.

The first line describes the run (`RunHeader` of `ciberrato.files.run_records`), each following one a Measures
message and what the agent made of it (`Cycle`). Every line is handed to the operating system as soon as it
is complete, so that a killed agent leaves a log that is good to its last full line. Numbers are written with
all their digits: what is read back equals what was written.
"""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import json
import os
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from ciberrato.errors import LabError
from ciberrato.files.run_records import FORMAT_VERSION, Cycle, DistanceModel, Preset, RecordedRun, RunHeader
from ciberrato.system.opening import open_patiently
from ciberrato.world.parameters import Parameters

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

FORMAT = "ciberrato-run"
_TOLD = 5
SALVAGE_HINT = "; --salvage reads what there is"


class RunWriter:
    """Writes a log of whole lines; each is flushed as soon as it is complete.

    A disk that is full ends nothing: lines wait in memory and are written, in order, as soon as there is
    room.

    Parameters
    ----------
    path : Path
        Log file; what it held is lost.
    header : RunHeader

    Raises
    ------
    OSError
        If the file cannot be opened.
    """

    def __init__(self, path: Path, header: RunHeader) -> None:
        self._file = path.open("wb", buffering=0)
        self._end = 0
        self._waiting: deque[bytes] = deque()
        self.fault: str | None = None
        """Reason for lines that were kept waiting, in words of the system; None if none was."""
        self._write({"format": FORMAT, **_fields(header)})

    @property
    def missing(self) -> int:
        """Number of lines that are not in the file."""
        return len(self._waiting)

    def write(self, cycle: Cycle) -> None:
        """Append one cycle."""
        self._write({name: value for name, value in _fields(cycle).items() if value is not None})

    def close(self) -> None:
        """Close the file; more calls do no harm."""
        if not self._file.closed:
            self._work_off()
            self._file.close()

    def __enter__(self) -> RunWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _write(self, document: dict[str, Any]) -> None:
        self._waiting.append(json.dumps(document, separators=(",", ":")).encode() + b"\n")
        self._work_off()

    def _work_off(self) -> None:
        try:
            while self._waiting:
                # One system call a line, unbuffered. If the disk is full a part of it may be in the file.
                line = self._waiting[0]
                written = self._file.write(line) or 0
                if written < len(line):
                    written += self._file.write(line[written:]) or 0  # says why
                if written < len(line):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                self._end += written
                self._waiting.popleft()
        except OSError as error:
            self.fault = error.strerror or str(error)
            with contextlib.suppress(OSError):  # a pipe cannot be cut
                self._file.truncate(self._end)
                self._file.seek(self._end)


def read_run(path: Path, *, salvage: Callable[[str], None] | None = None) -> RecordedRun:
    """Read a log.

    A last line that is not complete (the agent was killed while writing it) is left out.

    Parameters
    ----------
    path : Path
    salvage : callable, optional
        Told of every line that cannot be read, which is then left out; steps that are missing are taken for
        steps without readings. Without it they are errors.

    Returns
    -------
    RecordedRun

    Raises
    ------
    LabError
        If the file cannot be read, or a line is not what it should be; with the line's number.
    """
    source = str(path)
    try:
        with open_patiently(path) as file:
            data = file.read()
    except OSError as error:
        raise LabError(f"cannot read the log: {error.strerror or error}", source=source) from error
    lines = data.split(b"\n")
    lines.pop()  # empty after a complete last line, else the torn one
    if not lines:
        raise LabError("no complete line; this is not the log of a run", source=source)
    header = parse_header(lines[0], source)
    cycles: list[Cycle] = []
    due, torn = 0, 0
    for number, line in enumerate(lines[1:], start=2):
        try:
            cycle = parse_cycle(line, source, number)
            late = cycle.step is not None and cycle.step < due
            if late or (cycle.step is not None and cycle.step > due and salvage is None):
                problem = f"step {cycle.step} where step {due} was due{SALVAGE_HINT}"
                raise LabError(problem, source=source, line=number)
        except LabError as error:
            if salvage is None:
                raise
            torn += 1
            if torn <= _TOLD:
                salvage(f"{str(error).removesuffix(SALVAGE_HINT)}; the line is left out")
            continue
        if cycle.step is not None:
            if cycle.step > due and salvage is not None:
                salvage(f"{source}:{number}: steps {due} to {cycle.step - 1} are missing")
                cycles += without_readings(cycle, range(due, cycle.step))
            due = cycle.step + 1
        cycles.append(cycle)
    if torn > _TOLD and salvage is not None:
        salvage(f"{source}: {torn} lines are left out in all")
    return RecordedRun(header, tuple(cycles))


def without_readings(next_one: Cycle, steps: range) -> list[Cycle]:
    """Return cycles that stand for steps of which nothing is known but that they were."""
    nothing = (None, None, None, None)
    return [
        Cycle(time=next_one.time, start=True, stop=False, infrared=nothing, step=step, readings=nothing)
        for step in steps
    ]


def _fields(record: RunHeader | Cycle) -> dict[str, Any]:
    """Return the record's fields by name; parameters become an object."""
    fields = {field.name: getattr(record, field.name) for field in dataclasses.fields(record)}
    if isinstance(record, RunHeader):
        fields["parameters"] = dataclasses.asdict(record.parameters)
    return fields


def _refuse(name: str) -> float:
    raise ValueError(f"{name} is not a number of JSON")


def _read_object(line: bytes, source: str, number: int) -> dict[str, Any]:
    try:
        document = json.loads(line, parse_constant=_refuse)
    except ValueError as error:
        raise LabError(f"not a line of JSON: {error}{SALVAGE_HINT}", source=source, line=number) from error
    except RecursionError as error:
        raise LabError("JSON nested too deeply", source=source, line=number) from error
    if not isinstance(document, dict):
        raise LabError("a JSON object was expected", source=source, line=number)
    return document


def parse_header(line: bytes, source: str) -> RunHeader:
    """Read the first line of a log.

    Parameters
    ----------
    line : bytes
        Complete, without its end.
    source : str
        Name for error messages.

    Returns
    -------
    RunHeader

    Raises
    ------
    LabError
        If it is not the first line of a log.
    """
    document = _read_object(line, source, 1)
    if document.pop("format", None) != FORMAT:
        raise LabError(f'the first line does not say "format":"{FORMAT}"', source=source, line=1)
    if document.get("format_version") != FORMAT_VERSION:
        raise LabError(
            f"format version {document.get('format_version')!r}; this program reads {FORMAT_VERSION}",
            source=source,
            line=1,
        )
    parameters = document.get("parameters")
    if not isinstance(parameters, dict):
        raise LabError("parameters: an object was expected", source=source, line=1)
    document["parameters"] = _build(Parameters, parameters, source, 1)
    header = _build(RunHeader, document, source, 1)
    assert isinstance(header, RunHeader)
    return header


def parse_cycle(line: bytes, source: str, number: int) -> Cycle:
    """Read one of the further lines of a log.

    Parameters
    ----------
    line : bytes
        Complete, without its end.
    source : str
        Name for error messages.
    number : int
        The line's number.

    Returns
    -------
    Cycle

    Raises
    ------
    LabError
        If it is not a cycle.
    """
    cycle = _build(Cycle, _read_object(line, source, number), source, number)
    assert isinstance(cycle, Cycle)
    return cycle


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _is_array(value: Any, length: int, *, gaps: bool = False) -> bool:
    return (
        isinstance(value, (list, tuple))
        and len(value) == length
        and all(_is_number(item) or (gaps and item is None) for item in value)
    )


# By annotation; annotations are text because of the __future__ import.
_CHECKS: dict[str, Callable[[Any], bool]] = {
    "int": lambda value: isinstance(value, int) and not isinstance(value, bool),
    "float": _is_number,
    "bool": lambda value: isinstance(value, bool),
    "str": lambda value: isinstance(value, str),
    "Preset": lambda value: value in get_args(Preset),
    "DistanceModel": lambda value: value in get_args(DistanceModel),
    "Parameters": lambda value: isinstance(value, Parameters),
    "Readings": lambda value: _is_array(value, 4, gaps=True),
    "tuple[bool, bool, bool]": lambda value: (
        isinstance(value, list) and len(value) == 3 and all(isinstance(item, bool) for item in value)
    ),
    "tuple[float, float]": lambda value: _is_array(value, 2),
    "tuple[float, float, float]": lambda value: _is_array(value, 3),
    "tuple[float, float, float, float]": lambda value: _is_array(value, 4),
    "tuple[tuple[int, int, float], ...]": lambda value: (
        isinstance(value, list)
        and all(_is_array(cell, 3) and all(isinstance(place, int) for place in cell[:2]) for cell in value)
    ),
    "tuple[tuple[float, float, float, float], ...]": lambda value: (
        isinstance(value, list) and all(_is_array(mode, 4) for mode in value)
    ),
}


def _build(
    kind: type[RunHeader | Cycle | Parameters], values: dict[str, Any], source: str, number: int
) -> RunHeader | Cycle | Parameters:
    """Create a record; check that every value is known and of the right type."""
    fields = {field.name: field for field in dataclasses.fields(kind)}
    for name, value in values.items():
        if name not in fields:
            raise LabError(f"unknown entry {name!r}", source=source, line=number)
        wanted = str(fields[name].type)
        if wanted.endswith(" | None") and value is None:
            continue
        if not _CHECKS[wanted.removesuffix(" | None")](value):
            raise LabError(f"{name}: {wanted} was expected", source=source, line=number)
        if isinstance(value, list):
            values[name] = tuple(tuple(item) if isinstance(item, list) else item for item in value)
    missing = [
        name
        for name, field in fields.items()
        if name not in values
        and field.default is dataclasses.MISSING
        and field.default_factory is dataclasses.MISSING
    ]
    if missing:
        raise LabError(f"{missing[0]} is missing", source=source, line=number)
    try:
        return kind(**values)
    except ValueError as error:  # a number of the right type, but none that can be: a probability of 2
        raise LabError(str(error), source=source, line=number) from None
