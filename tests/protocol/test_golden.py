"""What the real simulator and real clients sent."""

import gzip
import json
from pathlib import Path

from lxml import etree

from ciberrato.errors import ProtocolError
from ciberrato.protocol import (
    Acceptance,
    Measures,
    RobotStatus,
    decode_parameters,
    decode_simulator_message,
    encode,
    encode_parameters,
)
from ciberrato.protocol.xmltree import parse_document
from ciberrato.world.parameters import Parameters

GOLDEN = Path(__file__).parents[1] / "data" / "golden"


def test_what_the_real_simulator_sent_comes_back_to_the_byte(recorded_from_simulator):
    different, refused = [], []
    for data in recorded_from_simulator:
        try:
            same = encode(decode_simulator_message(data)) == data
        except ProtocolError:
            refused.append(data)
        else:
            if not same:
                different.append(data)
    assert len(recorded_from_simulator) > 2000
    # The known ones: names as Latin-1 and names not escaped.
    assert different
    assert refused
    assert all(data.startswith('<Robot Name="ç" Id="6"'.encode("latin-1")) for data in different)
    assert all(data.startswith(b'<Robot Name="<a&"b" Id="7"') for data in refused)


def test_latin_1_names_are_read_and_sent_as_utf_8(recorded_from_simulator):
    names = {
        decode_simulator_message(data).name
        for data in recorded_from_simulator
        if data.startswith(b"<Robot") and b"\xe7" in data
    }
    assert names == {"ç"}


def test_a_second_parser_reads_the_same_values_from_what_the_real_simulator_sent(recorded_from_simulator):
    """Compare with lxml and XPath on every Measures and status that is XML."""
    compared = 0
    for data in recorded_from_simulator:
        try:
            root = etree.fromstring(data[:-1])
        except etree.XMLSyntaxError:
            continue
        message = decode_simulator_message(data)
        if isinstance(message, Measures):
            compared += 1
            compass = root.xpath("string(Sensors/@Compass)")
            assert str(message.time) == root.get("Time")
            assert f"{message.compass:g}" == compass if compass else message.compass is None
            for sensor, reading in enumerate(message.infrared):
                value = root.xpath(f"string(Sensors/IRSensor[@Id={sensor}]/@Value)")
                assert reading == float(value) if value else reading is None
            assert message.line == root.xpath("string(Sensors/LineSensor/@Value)")
            assert ["On" if led else "Off" for led in (message.start, message.stop)] == [
                root.xpath("string(Buttons/@Start)"),
                root.xpath("string(Buttons/@Stop)"),
            ]
            assert ["On" if led else "Off" for led in _leds(message)] == list(
                root.find("Leds").attrib.values()
            )
            assert [m.text for m in message.messages] == root.xpath("Sensors/Message/text()")
            assert [m.sender for m in message.messages] == [
                int(v) for v in root.xpath("Sensors/Message/@From")
            ]
            assert len(message.beacons) == int(root.xpath("count(Sensors/BeaconSensor)"))
            gps = root.find("Sensors/GPS")
            assert message.gps == (None if gps is None else (float(gps.get("X")), float(gps.get("Y"))))
        elif isinstance(message, RobotStatus) and "nan" not in data.decode("latin-1"):
            compared += 1
            assert message.name == root.get("Name")
            assert message.state == root.get("State")
            assert message.score % 2**32 == int(root.get("Score"))
            assert (message.x, message.y, message.direction_deg) == tuple(
                float(v) for v in root.xpath("Position/@X | Position/@Y | Position/@Dir")
            )
    assert compared > 2000


def _leds(message):
    return message.end_led, message.returning_led, message.visiting_led


def test_the_default_parameters_are_those_of_the_real_simulator(recorded_from_simulator):
    replies = [
        data
        for data, place in recorded_from_simulator.items()
        if place.startswith("09d") and b"<Reply" in data
    ]
    assert len(replies) == 1
    assert len(replies[0]) == 742
    assert encode(Acceptance(parameters=Parameters(), n_beacons=1)) == replies[0]


def test_parameter_texts_of_the_real_parser_come_back():
    path = GOLDEN / "ir" / "param_quirks.jsonl.gz"
    with gzip.open(path, "rt", encoding="utf-8") as lines:
        texts = [record["to_xml"] for record in map(json.loads, lines) if record["parse_ok"]]
    assert len(texts) > 10
    for text in texts:
        parameters, n_beacons = decode_parameters(parse_document(text.encode(), invalid_bytes="?").attributes)
        assert encode_parameters(parameters, n_beacons) == text
