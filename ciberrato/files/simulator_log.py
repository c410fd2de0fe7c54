"""Reads the log that a simulator writes (``--log``): the real one's, and ours.

A log is one XML document: parameters, lab, start grid, and a LogInfo for each running cycle, which holds the
state after that many cycles and the actions that lead to the next one. It is read in pieces, so that long
logs need no more memory than their records; one that ends early, as of a killed simulator, as far as it goes.
"""

from __future__ import annotations

import codecs
import gzip
import re
import zlib
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from ciberrato.errors import LabError, ProtocolError, UsageError
from ciberrato.files.log_kind import GZIP_MAGIC
from ciberrato.files.xml_document import MISMATCH, end_line
from ciberrato.protocol import Actions, Measures, decode_parameters
from ciberrato.protocol.lab_text import grid_from_element, lab_from_element
from ciberrato.protocol.measures_text import measures_from_element
from ciberrato.protocol.text import required, strict_integer, strict_real
from ciberrato.protocol.xmltree import Element
from ciberrato.reprs import short_repr
from ciberrato.system.opening import open_patiently
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters
from ciberrato.world.start_grid import StartGrid

if TYPE_CHECKING:
    from lxml import etree

PIECE = 1 << 16
"""Bytes read at a time."""

_SIGN_BIT = 2**31
_DEEPEST = 8  # how deep a log is nested; one of ours is 5 deep
_NOT_UTF8 = re.compile("[\udc80-\udcff]")


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedRobot:
    """One robot in one cycle.

    Attributes
    ----------
    robot_id : int
    name : str
    state : str
        ``Running``, ``Finished``, ...
    x, y : float
        True position in units, six digits.
    direction_deg : float
        True heading in degrees.
    score : int
        Signed.
    arrival_time, returning_time, collisions : int
    collision : bool
    visited_mask : str
    actions : Actions or None
        Actions for the coming cycle, motors after clamping; None where none arrived. Requests, messages,
        and a lone VisitingLed are not in the log.
    measures : Measures
        The sensors after this cycle, all of them, whether or not the robot was sent them; without messages
        and score. The LEDs are those after the actions.
    """

    __repr__ = short_repr

    robot_id: int
    name: str
    state: str
    x: float
    y: float
    direction_deg: float
    score: int
    arrival_time: int
    returning_time: int
    collisions: int
    collision: bool
    visited_mask: str
    actions: Actions | None
    measures: Measures


@dataclass(frozen=True, slots=True, kw_only=True)
class LogRecord:
    """One cycle.

    Attributes
    ----------
    time : int
        Simulated cycles so far.
    robots : tuple of LoggedRobot
        In order of their ids.
    """

    __repr__ = short_repr

    time: int
    robots: tuple[LoggedRobot, ...]

    def robot(self, robot_id: int) -> LoggedRobot | None:
        """Return the robot of that id, if it is in the record."""
        return next((robot for robot in self.robots if robot.robot_id == robot_id), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class LogHeader:
    """Header of a log.

    Attributes
    ----------
    date : str
        As the simulator wrote it.
    parameters : Parameters
        As announced: without the line sensor's probability.
    n_beacons : int
    lab : Lab
        Numbers have six digits.
    grid : StartGrid
    """

    __repr__ = short_repr

    date: str
    parameters: Parameters
    n_beacons: int
    lab: Lab
    grid: StartGrid


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatorLog:
    """A whole log.

    Attributes
    ----------
    header : LogHeader
    records : tuple of LogRecord
        By time.
    complete : bool
        Whether the log has its end; False where the simulator was killed.
    """

    __repr__ = short_repr

    header: LogHeader
    records: tuple[LogRecord, ...]
    complete: bool

    @property
    def robot_ids(self) -> tuple[int, ...]:
        """Ids of all robots that appear, in ascending order."""
        return tuple(sorted({robot.robot_id for record in self.records for robot in record.robots}))


def read_simulator_log(path: str | Path) -> SimulatorLog:
    """Read a whole log; one that is packed with gzip is unpacked.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    SimulatorLog

    Raises
    ------
    UsageError
        If there is no such file, or it cannot be read.
    LabError
        If it is no log; names the line.
    """
    stream = LogStream(path)
    records = tuple(stream)
    return SimulatorLog(header=stream.header, records=records, complete=stream.complete)


class LogStream:
    """A log, record by record, in constant memory.

    Parameters
    ----------
    path : str or Path

    Attributes
    ----------
    header : LogHeader
        Read at once.
    complete : bool
        After the last record: whether the log has its end.

    Raises
    ------
    UsageError
        If there is no such file, or it cannot be read.
    LabError
        If it is no log; names the line. Also while the records are read.
    """

    def __init__(self, path: str | Path) -> None:
        self.complete = False
        self._parser = _LogParser(str(path))
        self._pieces = _pieces(path)
        for piece in self._pieces:
            self._parser.feed(piece)
            if self._parser.records:
                break
        self.header = self._parser.header()

    def __iter__(self) -> Iterator[LogRecord]:
        """Yield the records; once."""
        records = self._parser.records
        while records:
            yield records.popleft()
        for piece in self._pieces:
            self._parser.feed(piece)
            while records:
                yield records.popleft()
        self.complete = self._parser.finish()


def _pieces(path: str | Path) -> Iterator[bytes]:
    try:
        with _open(path) as file:
            while piece := file.read(PIECE):
                yield piece
    except FileNotFoundError:
        raise UsageError(f"{path}: no such file; check the path") from None
    except IsADirectoryError:
        raise UsageError(f"{path}: is a directory; name a log in it") from None
    except (OSError, EOFError, zlib.error) as error:
        reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
        raise UsageError(f"{path}: cannot be read ({reason}); check the file and its permissions") from None


def _open(path: str | Path) -> BinaryIO:
    with open_patiently(path) as file:
        packed = file.read(2) == GZIP_MAGIC
    return gzip.open(path) if packed else open_patiently(path)  # type: ignore[return-value]  # reads like one


class _LogParser:
    """Takes the bytes of a log in pieces, and puts its records into a queue."""

    def __init__(self, source: str) -> None:
        from lxml import etree

        self.records: deque[LogRecord] = deque()
        self._source = source
        self._date = ""
        self._parts: dict[str, Element] = {}
        self._root: etree._Element | None = None
        self._depth = 0
        self._ended = False
        # Ours is UTF-8; the real simulator writes names as Latin-1. Neither declares anything.
        self._decoder = codecs.getincrementaldecoder("utf-8")("surrogateescape")
        self._parser = etree.XMLPullParser(
            ("start", "end"), encoding="utf-8", resolve_entities=False, no_network=True
        )

    def feed(self, data: bytes) -> None:
        """Parse the next piece."""
        from lxml import etree

        text = self._decoder.decode(data)
        if not text.isascii():
            text = _NOT_UTF8.sub(lambda match: chr(ord(match[0]) - 0xDC00), text)
        try:
            self._parser.feed(text.encode())
        except etree.XMLSyntaxError:
            self._take()  # what is before the fault
            raise self._fault() from None
        self._take()

    def _take(self) -> None:
        events: Iterator[tuple[str, etree._Element]] = self._parser.read_events()  # type: ignore[assignment]
        for event, node in events:
            if event == "start":
                if self._root is None:
                    self._begin(node)
                self._depth += 1
                if self._depth > _DEEPEST:
                    raise self._error("is nested too deeply for a simulator's log", node)
                continue
            self._depth -= 1
            if self._depth == 1 and self._root is not None:
                self._part(node)
                # What hangs on the root itself is let go of when it is read, and what stood before it.
                node.clear()
                while node.getprevious() is not None:
                    del self._root[0]
            elif self._depth == 0:
                self._ended = True

    def _begin(self, root: etree._Element) -> None:
        if root.getroottree().docinfo.internalDTD is not None:
            raise self._error("has a document type, which a simulator's log has not", 1)
        if root.tag != "Log":
            raise self._error(f"begins with {root.tag}: not a simulator's log, which begins with Log", root)
        self._root = root
        self._date = str(root.get("Date", ""))

    def _part(self, node: etree._Element) -> None:
        element = _element(node)
        if element.name != "LogInfo":
            self._parts[element.name] = element
            return
        try:
            self.records.append(_record(element))
        except ProtocolError as error:
            raise self._error(f"LogInfo that begins here: {error}", node) from None

    def finish(self) -> bool:
        """Return whether the log has its end."""
        return self._ended

    def _fault(self) -> LabError:
        """Return the error for what the parser has met."""
        fault = self._parser.feed_error_log[0]
        problem, line = fault.message or "error", fault.line
        if mismatch := MISMATCH.search(problem):
            opened, began, closed = mismatch.groups()
            problem = f"mismatched tag: </{closed}> where </{opened}> of line {began} is due"
        elif self._ended:
            problem = "something follows the end of the log"
        elif "depth" in problem.lower():
            return self._error("is nested too deeply for a simulator's log", line)
        return self._error(f"is not a simulator's log ({' '.join(problem.split())})", line)

    def _error(self, problem: str, place: etree._Element | int | None = None) -> LabError:
        line = place if place is None or isinstance(place, int) else end_line(place)
        return LabError(problem, source=self._source, line=line)

    def header(self) -> LogHeader:
        """Create the header from what came before the first record."""
        missing = [name for name in ("Parameters", "Lab", "Grid") if name not in self._parts]
        if missing:
            raise self._error(f"has no {missing[0]} before its first LogInfo: not a simulator's log", 1)
        try:
            parameters, n_beacons = decode_parameters(self._parts["Parameters"].attributes)
            return LogHeader(
                date=self._date,
                parameters=parameters,
                n_beacons=n_beacons,
                lab=lab_from_element(self._parts["Lab"]),
                grid=grid_from_element(self._parts["Grid"]),
            )
        except ProtocolError as error:
            raise LabError(str(error), source=self._source) from None


def _element(node: etree._Element) -> Element:
    """Return an element of the log as one of the wire, which has the same."""
    element = Element(str(node.tag), {str(name): str(value) for name, value in node.items()})
    element.children = [_element(child) for child in node.iterchildren("*")]
    return element


def _record(element: Element) -> LogRecord:
    return LogRecord(
        time=_integer(element, "Time"),
        robots=tuple(_robot(child) for child in element.children if child.name == "Robot"),
    )


def _robot(element: Element) -> LoggedRobot:
    parts = {child.name: child for child in element.children}
    for name in ("Pos", "Scores", "Measures"):
        if name not in parts:
            raise ProtocolError(f"Robot: element {name} is missing")
    position, scores = parts["Pos"], parts["Scores"]
    score = _integer(scores, "Score")
    return LoggedRobot(
        robot_id=_integer(element, "Id"),
        name=element.attributes.get("Name", ""),
        state=required(element.attributes, "Robot", "State"),
        x=_real(position, "X"),
        y=_real(position, "Y"),
        direction_deg=_real(position, "Dir"),
        score=score - 2 * _SIGN_BIT if score >= _SIGN_BIT else score,
        arrival_time=_integer(scores, "ArrivalTime"),
        returning_time=_integer(scores, "ReturningTime"),
        collisions=_integer(scores, "Collisions"),
        collision=scores.attributes.get("Collision") == "True",
        visited_mask=scores.attributes.get("VisitedMask", ""),
        actions=_actions(parts["Action"]) if "Action" in parts else None,
        measures=measures_from_element(parts["Measures"]),
    )


def _actions(element: Element) -> Actions:
    def motor(name: str) -> float | None:
        return _real(element, name) if name in element.attributes else None

    def led(name: str) -> bool | None:
        text = element.attributes.get(name)
        return None if text is None else text == "On"

    return Actions(
        left_motor=motor("LeftMotor"),
        right_motor=motor("RightMotor"),
        end_led=led("EndLed"),
        returning_led=led("ReturningLed"),
        visiting_led=led("VisitingLed"),
    )


def _integer(element: Element, name: str) -> int:
    return strict_integer(required(element.attributes, element.name, name), f"{element.name} {name}")


def _real(element: Element, name: str) -> float:
    return strict_real(required(element.attributes, element.name, name), f"{element.name} {name}")
