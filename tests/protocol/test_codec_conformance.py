"""The conformance check of the codec: passes on the recordings, and fails where something is wrong."""

import base64
import gzip
import json
from dataclasses import replace

import pytest

from benchmarks.conformance import codec
from benchmarks.conformance.recordings import read_session
from ciberrato.protocol import Measures, decode_simulator_message, encode
from tests.recordings import GOLDEN, OWN, needs


def by_check(rows):
    table = {}
    for row in rows:
        table.setdefault(row.check, []).append(row)
    return table


def test_the_recordings_that_come_with_the_tests_pass():
    rows = by_check(codec.rows(OWN, None))
    assert all(row.passed for group in rows.values() for row in group), rows
    (simulator,) = rows["codec: simulator"]
    assert simulator.cases > 4000
    assert sum(row.cases for row in rows["codec: simulator, exception"]) == 43
    (clients,) = rows["codec: clients"]
    assert clients.cases > 2500
    assert "44 are refused as the real simulator did" in clients.note
    assert [row.cases for row in rows["codec: clients, exception"]] == [1], "the NaN motors"


@needs("CIBERRATO_GOLDEN")
def test_the_complete_recordings_pass():
    rows = by_check(codec.rows(GOLDEN, None))
    assert all(row.passed for group in rows.values() for row in group), rows
    assert rows["codec: logs"][0].cases > 1500
    assert rows["codec: grids"][0].cases == 79


def test_an_empty_folder_is_skipped_in_words(tmp_path):
    (row,) = codec.rows(tmp_path, None)
    assert row.passed
    assert row.cases == 0
    assert "skipped" in row.note


def test_a_codec_that_changes_one_digit_fails(monkeypatch):
    def one_digit_off(message):
        if isinstance(message, Measures) and message.time == 3:
            message = replace(message, time=4)
        return encode(message)

    monkeypatch.setattr(codec, "encode", one_digit_off)
    (row,) = by_check(codec.rows(OWN, None))["codec: simulator"]
    assert not row.passed
    assert "01_viewer_full_session:" in row.note


MAIN, CLIENT, ROBOT, STRANGER = 6000, 40001, 50001, 40002
REPLY = b'<Reply Status="Ok">\n\t<Parameters/>\n</Reply>\n\0'


def write_session(folder, events, output, alive=True):
    """Write a session of events (direction, from, to, bytes) in the layout of the recordings."""
    lines = [{"direction": "note", "text": "SESSION", "payload_b64": "", "from_port": None, "to_port": None}]
    lines += (
        {
            "direction": direction,
            "from_port": source,
            "to_port": target,
            "payload_b64": base64.b64encode(data).decode(),
            "text": data.decode("latin-1"),
        }
        for direction, source, target, data in events
    )
    notes = [
        f"simulator process still alive at end: {alive}",
        f"simulator stdout+stderr of the session:\n Simulator\n{output}",
    ]
    lines += ({**lines[0], "text": note} for note in notes)
    (folder / "transcripts").mkdir(parents=True, exist_ok=True)
    path = folder / "transcripts" / "99_made_up.jsonl.gz"
    with gzip.open(path, "wt", encoding="utf-8") as file:
        file.writelines(json.dumps(line) + "\n" for line in lines)
    return path


def registered(*sent):
    """A session in which a robot registers and sends these messages."""
    return [
        ("client->sim", CLIENT, MAIN, b'<Robot Id="1"/>\0'),
        ("sim->client", ROBOT, CLIENT, encode(decode_simulator_message(REPLY))),
        ("sim->client", ROBOT, CLIENT, encode(Measures(time=0))),
        *(("client->sim", CLIENT, ROBOT, data) for data in sent),
    ]


COMPLAINT = 'cbRobot::Fail parsing xml action message: "'


@pytest.mark.parametrize(
    ("sent", "output", "passed"),
    [
        ([b"<Actions/>\0"], "", True),
        ([b"<bad\0"], f'{COMPLAINT}<bad"\n', True),
        ([b"<bad\0", b"<Foo/>"], f'{COMPLAINT}<bad"\n{COMPLAINT}<Foo/>"\n', True),
        ([b"<bad\0"], "", False),
        ([b"<Actions/>\0"], f'{COMPLAINT}<Actions/>"\n', False),
        ([b"<bad\0", b"<Actions/>\0"], f'{COMPLAINT}<Actions/>"\n', False),
        ([b"<bad1\0", b"<bad2\0"], f'{COMPLAINT}<bad2"\n{COMPLAINT}<bad1"\n', False),
        ([b'<Actions LeftMotor="1" LeftMotor="2"/>\0'], "", True),
        ([b"<!DOCTYPE Actions><Actions/>\0"], "", True),
    ],
)
def test_refusals_are_held_against_the_real_simulators_complaints(tmp_path, sent, output, passed):
    write_session(tmp_path, registered(*sent), output)
    (row,) = by_check(codec.rows(tmp_path, None))["codec: clients"]
    assert row.passed is passed, row


def test_a_simulator_that_died_need_not_have_complained(tmp_path):
    events = registered(b"<bad1\0", b"<bad2\0")
    write_session(tmp_path, events, f'{COMPLAINT}<bad1"\n', alive=False)
    (row,) = by_check(codec.rows(tmp_path, None))["codec: clients"]
    assert row.passed
    write_session(tmp_path, events, f'{COMPLAINT}<bad1"\n', alive=True)
    (row,) = by_check(codec.rows(tmp_path, None))["codec: clients"]
    assert not row.passed


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b'<Measures Time="1">\n</Measures>\n\0', None),
        ('<Robot Name="é" Id="1" State="x"/>'.encode(), None),
        ('<Robot Name="é" Id="1" State="x"/>'.encode("latin-1"), codec.NOT_UTF8),
        (b'<Robot Name="<" Id="1" State="x"/>', codec.NOT_ESCAPED),
        (b'<Robot Name="<\xe9" Id="1" State="x"/>', codec.NOT_ESCAPED),
    ],
)
def test_exceptions_are_told_by_rule(data, reason):
    assert codec.exception_of(data) == reason


def test_a_datagram_that_is_xml_and_does_not_come_back_is_no_exception(tmp_path):
    odd = b'<Measures  Time="0"/>\n\0'
    write_session(tmp_path, [*registered(), ("sim->client", ROBOT, CLIENT, odd)], "")
    (row,) = by_check(codec.rows(tmp_path, None))["codec: simulator"]
    assert not row.passed


def test_ports_are_told_apart_by_the_traffic(tmp_path):
    view, panel, second = 50002, 50003, 50004
    lab = b"<Lab/>\n\0"
    events = [
        ("client->sim", CLIENT, MAIN, b"<View/>\0"),
        ("sim->client", view, CLIENT, REPLY),
        ("client->sim", STRANGER, MAIN, b"<Panel/>\0"),
        ("sim->client", panel, STRANGER, REPLY),
        *registered(b"<Actions/>\0"),
        ("client->sim", STRANGER, panel, b"<Start/>\0"),
        ("client->sim", CLIENT, view, b"<LabReq/>\0"),
        ("sim->client", view, CLIENT, lab),
        ("client->sim", CLIENT, view, b"<Reset/>\0"),
        ("sim->client", view, CLIENT, b"<Restart/>\0"),
        ("client->sim", CLIENT, ROBOT, b"too late"),
        ("client->sim", CLIENT, view, b"too late"),
        ("client->sim", CLIENT, MAIN, b"<View/>\0"),
        ("sim->client", second, CLIENT, REPLY),
        ("client->sim", CLIENT, second, b"<Start/>\0"),
    ]
    session = read_session(write_session(tmp_path, events, ""))
    assert [datagram.port for datagram in session.from_clients] == [
        *("main", "main", "main", "robot", "unread", "view", "view", "unread", "unread", "main", "view"),
    ]
    (row,) = by_check(codec.rows(tmp_path, None))["codec: clients"]
    assert row.passed
    assert "3 more went to ports that are not read" in row.note
