"""Every recorded datagram through our codec: what the real simulator sent, and what clients sent to it.

What the simulator sent must come back to the byte. Whether a client's datagram is a message is decided by the
real simulator's own complaints, which each session holds, and by its silence.
"""

from __future__ import annotations

import gzip
import json
import re
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from xml.sax.saxutils import quoteattr

from benchmarks.conformance import Finding
from benchmarks.conformance.recordings import Datagram, Session, seed_runs, sessions
from ciberrato.errors import ProtocolError, UsageError
from ciberrato.protocol import (
    ACTIONS_LIMIT,
    REGISTRATION_LIMIT,
    ClientMessage,
    Measures,
    decode_actions,
    decode_parameters,
    decode_registration,
    decode_simulator_message,
    decode_view_command,
    encode,
    encode_parameters,
    measures_to_xml,
)
from ciberrato.protocol.xmltree import parse_document

NOT_UTF8 = "the name or text goes out as Latin-1 bytes; we read them, and send UTF-8"
NOT_ESCAPED = "the name or text goes out unescaped, so it is no XML; we refuse it, and escape what we send"

DELIBERATE = {
    "is not a motor command": "NaN motors, which make the robot's pose invalid for good, are refused",
    "is not a finite number": "angles and heights that are not finite are refused",
    "duplicate attribute": "an attribute that comes twice is no XML (the real parser takes the first)",
    "DOCTYPE": "document types are refused, for the entities they may define",
    "is not supported": "declared encodings other than UTF-8, ASCII and Latin-1 are refused",
}
"""Messages that our decoders refuse and the real simulator takes: a part of the complaint, and why."""

_COMPLAINTS = {
    "main": "Fail parsing xml message\n",
    "robot": 'cbRobot::Fail parsing xml action message: "',
    "view": "cbView::Fail parsing xml view message\n",
}
"""Begin of each complaint on its line; the first two go on with the message."""

_DECODERS: dict[str, Callable[[bytes], ClientMessage]] = {
    "main": decode_registration,
    "robot": decode_actions,
    "view": decode_view_command,
}


def rows(golden: Path, labs: Path | None) -> Iterator[Finding]:
    """Yield the rows of this check."""
    del labs
    recordings = [*sessions(golden), *seed_runs(golden)]
    if not recordings:
        yield Finding("codec", 0, None, True, "skipped: neither transcripts nor seed_runs here")
    else:
        yield from _simulator_rows(recordings)
        yield from _client_rows(recordings)
    yield from _document_rows(golden)


# --- what the simulator sent -----------------------------------------------------------------------


def _simulator_rows(recordings: list[Session]) -> Iterator[Finding]:
    cases = wrong = 0
    first_wrong = ""
    exceptions: dict[str, Counter[str]] = {NOT_UTF8: Counter(), NOT_ESCAPED: Counter()}
    for session in recordings:
        for datagram in session.from_simulator:
            cases += 1
            reason = exception_of(datagram.data)
            if reason is not None:
                exceptions[reason][session.name] += 1
                good = _exception_holds(datagram.data, reason)
            else:
                good = _comes_back(datagram.data)
            if not good:
                wrong += 1
                first_wrong = first_wrong or datagram.source
    special = sum(counter.total() for counter in exceptions.values())
    note = f"{cases - special} come back to the byte, {special} are not XML (listed below)"
    yield Finding(
        "codec: simulator", cases, None, wrong == 0, f"{wrong} wrong, first {first_wrong}" if wrong else note
    )
    for reason, counter in exceptions.items():
        if counter:
            yield Finding(
                "codec: simulator, exception", counter.total(), None, True, f"{reason} ({_places(counter)})"
            )


def exception_of(data: bytes) -> str | None:
    """Return why a simulator's datagram is not XML, by a parser that is not ours; None where it is."""
    from lxml import etree

    text = data.partition(b"\0")[0]
    try:
        text.decode("utf-8")
        reason = NOT_ESCAPED
    except UnicodeDecodeError:
        text = text.decode("latin-1").encode("utf-8")
        reason = NOT_UTF8
    try:
        etree.fromstring(text, etree.XMLParser(resolve_entities=False))
    except etree.XMLSyntaxError:
        return NOT_ESCAPED
    return reason if reason == NOT_UTF8 else None


def _comes_back(data: bytes) -> bool:
    try:
        return encode(decode_simulator_message(data)) == data
    except ProtocolError:
        return False


def _exception_holds(data: bytes, reason: str) -> bool:
    """Check that the exception is one for the stated reason alone: repaired, the datagram comes back."""
    if reason == NOT_UTF8:
        try:
            return encode(decode_simulator_message(data)) == data.decode("latin-1").encode("utf-8")
        except ProtocolError:
            return False
    try:
        decode_simulator_message(data)
    except ProtocolError:
        pass
    else:
        return False
    name = re.match(r'<Robot Name="(.*)" Id="', data.decode("utf-8", "replace"), re.DOTALL)
    if name is None:
        return True  # a message's text: where it ends cannot be told
    escaped = quoteattr(name[1], {'"': "&quot;"})
    return _comes_back(data.replace(f'"{name[1]}"'.encode(), escaped.encode(), 1))


# --- what clients sent -------------------------------------------------------------------------------


def _client_rows(recordings: list[Session]) -> Iterator[Finding]:
    cases = refused = unread = wrong = 0
    first_wrong = ""
    deliberate: dict[str, Counter[str]] = {}
    for session in recordings:
        for port, decode in _DECODERS.items():
            ours = []
            for datagram in session.from_clients:
                if datagram.port != port:
                    continue
                cases += 1
                try:
                    message = decode(datagram.data)
                except ProtocolError as error:
                    reason = next((why for part, why in DELIBERATE.items() if part in str(error)), None)
                    if reason is None:
                        ours.append(datagram)
                    else:
                        deliberate.setdefault(reason, Counter())[session.name] += 1
                else:
                    if not _means_the_same(decode, message):
                        wrong += 1
                        first_wrong = first_wrong or f"{datagram.source}: encoded and decoded it differs"
            refused += len(ours)
            problem = _disagreement(session, port, ours)
            if problem:
                wrong += 1
                first_wrong = first_wrong or f"{session.name}, {port} port: {problem}"
        unread += sum(datagram.port == "unread" for datagram in session.from_clients)
        for datagram in session.from_clients:
            if datagram.port == "unread":
                _survives(datagram)
    special = sum(counter.total() for counter in deliberate.values())
    note = (
        f"{cases - refused - special} are messages, {refused} are refused as the real simulator did,"
        f" {special} on purpose (listed below); {unread} more went to ports that are not read"
    )
    yield Finding(
        "codec: clients", cases, None, wrong == 0, f"{wrong} wrong, first {first_wrong}" if wrong else note
    )
    for reason, counter in deliberate.items():
        yield Finding(
            "codec: clients, exception", counter.total(), None, True, f"{reason} ({_places(counter)})"
        )


def _means_the_same(decode: Callable[[bytes], ClientMessage], message: ClientMessage) -> bool:
    try:
        return decode(encode(message)) == message
    except UsageError:
        return True  # in our words it would be longer than a simulator reads


def _disagreement(session: Session, port: str, refused: list[Datagram]) -> str:
    """Compare what we refuse with what the real simulator complained of; empty if they agree."""
    # The recorder's first line gives each line of the program a newline in front.
    output, complaint = session.output, "\n" + _COMPLAINTS[port]
    complaints = len(re.findall("^" + re.escape(_COMPLAINTS[port]), output, re.MULTILINE))
    if session.died and complaints < len(refused):
        refused = refused[:complaints]  # it did not live to read the others
    if complaints != len(refused):
        sources = ", ".join(datagram.source for datagram in refused) or "none"
        return f"the real simulator refused {complaints} datagrams, we refuse {len(refused)} ({sources})"
    if port == "view":
        return ""  # the complaint does not quote the message
    # The quotations must be those of the datagrams that we refuse, in the same order.
    limit = REGISTRATION_LIMIT if port == "main" else ACTIONS_LIMIT
    place = 0
    for datagram in refused:
        text = datagram.data[:limit].partition(b"\0")[0].decode("latin-1")
        text = re.split("[^\x00-\x7f]", text)[0]  # what it prints for other bytes is a matter of its terminal
        place = output.find(complaint + text, place)
        if place < 0:
            return f"{datagram.source}: we refuse it, the real simulator did not complain of it"
        place += len(complaint)
    return ""


def _survives(datagram: Datagram) -> None:
    for decode in _DECODERS.values():
        try:
            decode(datagram.data)
        except ProtocolError:
            continue


# --- the same texts in other documents ---------------------------------------------------------------


def _document_rows(golden: Path) -> Iterator[Finding]:
    grids = golden / "ir" / "grids.jsonl.gz"
    if grids.exists():
        texts = [record["to_xml"] for record in _records(grids) if record["parse_ok"]]
        wrong = sum(not _comes_back(text.encode() + b"\0") for text in texts)
        yield Finding(
            "codec: grids",
            len(texts),
            None,
            wrong == 0,
            f"{wrong} wrong" if wrong else "come back to the byte",
        )
    quirks = golden / "ir" / "param_quirks.jsonl.gz"
    if quirks.exists():
        texts = [record["to_xml"] for record in _records(quirks) if record["parse_ok"]]
        wrong = sum(not _parameters_come_back(text) for text in texts)
        yield Finding(
            "codec: parameters",
            len(texts),
            None,
            wrong == 0,
            f"{wrong} wrong" if wrong else "come back to the byte",
        )
    logs = sorted((golden / "logs").glob("*/sim.log.gz"))
    if logs:
        cases = wrong = 0
        for path in logs:
            with gzip.open(path, "rt", encoding="latin-1", newline="") as file:
                log = file.read()
            for good in _log_pieces(log):
                cases += 1
                wrong += not good
        yield Finding(
            "codec: logs",
            cases,
            None,
            wrong == 0,
            f"{wrong} wrong" if wrong else "elements come back to the byte",
        )


def _log_pieces(log: str) -> Iterator[bool]:
    """Write again what a log shares with the wire: Parameters, Lab, Grid, and the Measures."""
    for text in re.findall(r"^<Parameters .*?/>\n", log, re.DOTALL | re.MULTILINE):
        yield _parameters_come_back(text)
    for text in re.findall(r"^<(?:Lab|Grid)\b.*?</(?:Lab|Grid)>\n", log, re.DOTALL | re.MULTILINE):
        yield _comes_back(text.encode() + b"\0")
    for text in re.findall(r"^<Measures .*?</Measures>\n", log, re.DOTALL | re.MULTILINE):
        measures = decode_simulator_message(text.encode())
        yield isinstance(measures, Measures) and measures_to_xml(measures, log=True) == text


def _parameters_come_back(text: str) -> bool:
    parameters, n_beacons = decode_parameters(
        parse_document(text.encode(), invalid_bytes="latin-1").attributes
    )
    return encode_parameters(parameters, n_beacons) == text


def _records(path: Path) -> Iterator[dict[str, str]]:
    with gzip.open(path, "rt", encoding="utf-8") as lines:
        for line in lines:
            yield json.loads(line)


def _places(counter: Counter[str]) -> str:
    return ", ".join(f"{name}: {count}" for name, count in sorted(counter.items()))
