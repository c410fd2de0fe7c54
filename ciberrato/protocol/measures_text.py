"""Measures, both ways: the message of every cycle, so both have a short way for the usual layout."""

from __future__ import annotations

import functools
import re
from dataclasses import fields
from itertools import product
from typing import Any

from ciberrato.errors import UsageError
from ciberrato.protocol.drafts import MeasuresDraft
from ciberrato.protocol.messages import (
    BeaconReading,
    HeardMessage,
    Measures,
    OtherReading,
    ScoreReading,
    SensorElement,
)
from ciberrato.protocol.text import attribute, cdata, general, required, shown, strict_integer, strict_real
from ciberrato.protocol.xmltree import Element

_USUAL = """\
<Measures Time="%d">
\t<Sensors Collision="%s" Compass="%g" Ground="%d">
\t\t<IRSensor Id="0" Value="%g"/>
\t\t<IRSensor Id="1" Value="%g"/>
\t\t<IRSensor Id="2" Value="%g"/>
\t\t<IRSensor Id="3" Value="%g"/>
%s\t</Sensors>
\t<Leds EndLed="%s" ReturningLed="%s" VisitingLed="%s"/>
\t<Buttons Start="%s" Stop="%s"/>
</Measures>
"""
_HEAD, _TAIL = _USUAL.split("%s\t</Sensors>")
_HEAD += '\t\t<LineSensor Value="%s" />\n'
TAILS = {
    switches: "\t</Sensors>" + _TAIL % tuple("On" if switch else "Off" for switch in switches) + "\0"
    for switches in product((False, True), repeat=5)
}
"""The end of the usual message, by LEDs and buttons: off before on, the last one changing fastest."""
HEAD_PIECES = tuple(re.split("%[dgs]", _HEAD))
"""Its beginning without time, collision, compass, ground, IR sensors 0 to 3 and line."""

# The layout that simulators send, to the byte. Whatever differs goes through the XML parser.
_COUNT = rb"([0-9]{1,18})"
_INTEGER = rb"(-?[0-9]{1,18})"
_REAL = rb"(-?[0-9]{1,18}(?:\.[0-9]{1,18})?(?:e[+-][0-9]{1,3})?)"
_SWITCH = rb'"(On|Off)"'
_LAYOUT = (
    rb'<Measures Time="' + _COUNT + rb'">\n'
    rb'\t<Sensors(?: Collision="(Yes|No)")?'
    rb'(?: Compass="' + _REAL + rb'")?(?: Ground="' + _INTEGER + rb'")?>\n'
    + b"".join(
        rb'(?:\t\t<IRSensor Id="%d" Value="' % sensor + _REAL + rb'"/>\n)?' for sensor in range(4)
    )
    + rb'((?:\t\t<BeaconSensor Id="[0-9]{1,9}" Value="(?:NotVisible|-?[0-9]{1,9})"/>\n)*)'
    rb'(?:\t\t<GPS X="' + _REAL + rb'" Y="' + _REAL + rb'" />\n)?'
    rb'(?:\t\t<LineSensor Value="([01]{7})" />\n)?'
    rb'(?:\t\t<Score Score="' + _INTEGER + rb'" ArrivalTime="' + _INTEGER + rb'" ReturningTime="' + _INTEGER
    + rb'" Collisions="' + _INTEGER + rb'" Collision="(True|False)" VisitedMask="([0-9]*)" />\n)?'
    rb"\t</Sensors>\n"
    rb"\t<Leds EndLed=" + _SWITCH + rb" ReturningLed=" + _SWITCH + rb" VisitingLed=" + _SWITCH + rb"/>\n"
    rb"\t<Buttons Start=" + _SWITCH + rb" Stop=" + _SWITCH + rb"/>\n"
    rb"</Measures>\n?(?:\0|\Z)"
)  # fmt: skip
_NAME = re.compile(r"[^\W\d][\w.:-]*")
_BEACON = re.compile(rb'Id="([0-9]+)" Value="([^"]+)"')

_ELEMENTS: dict[str, SensorElement] = {
    field.name: field.metadata["element"] for field in fields(Measures) if "element" in field.metadata
}
"""By the field of `Measures`, in the order in which they are written."""
_FIELDS = {name: field for field, (name, _) in _ELEMENTS.items()}
_ADDED = _ELEMENTS.keys() - {"gps", "line"}
"""Of sensors that the layouts above do not know: messages with them go through the XML parser."""


@functools.cache
def _layout() -> re.Pattern[bytes]:
    return re.compile(_LAYOUT)  # when the first message has come, not before a program registers


def measures_from_layout(data: bytes) -> Measures | None:
    """Read Measures in the exact layout of the simulators; None where it differs in any byte."""
    match = _layout().match(data)
    if match is None:
        return None
    (
        time, collision, compass, ground, ir0, ir1, ir2, ir3, beacons, gps_x, gps_y, line,
        score, arrival, returning, collisions, colliding, mask,
        end_led, returning_led, visiting_led, start, stop,
    ) = match.groups()  # fmt: skip
    draft: Any = MeasuresDraft()
    draft.time = int(time)
    draft.start = start == b"On"
    draft.stop = stop == b"On"
    draft.end_led = end_led == b"On"
    draft.returning_led = returning_led == b"On"
    draft.visiting_led = visiting_led == b"On"
    draft.collision = None if collision is None else collision == b"Yes"
    draft.compass = None if compass is None else float(compass)
    draft.ground = None if ground is None else int(ground)
    draft.infrared = (
        None if ir0 is None else float(ir0),
        None if ir1 is None else float(ir1),
        None if ir2 is None else float(ir2),
        None if ir3 is None else float(ir3),
    )
    draft.beacons = _beacons_from_layout(beacons) if beacons else ()
    draft.gps = None if gps_x is None else (float(gps_x), float(gps_y))
    draft.line = None if line is None else line.decode("ascii")
    draft.messages = ()
    draft.score = None
    if score is not None:
        draft.score = ScoreReading(
            score=int(score),
            arrival_time=int(arrival),
            returning_time=int(returning),
            collisions=int(collisions),
            collision=colliding == b"True",
            visited_mask=mask.decode("ascii"),
        )
    measures: Measures = draft.finish()
    return measures


def _beacons_from_layout(lines: bytes) -> tuple[BeaconReading, ...]:
    return tuple(
        BeaconReading(beacon=int(beacon), bearing=None if value == b"NotVisible" else float(value))
        for beacon, value in _BEACON.findall(lines)
    )


def measures_from_element(root: Element) -> Measures:
    """Read Measures from its element.

    Sensors, LEDs and buttons may be missing; attributes that are not known do not matter, nor do IR sensors
    beyond the fourth; elements that are not known are kept in `Measures.others`. What is there must be
    complete, as the strictest of the real clients wants it.

    Raises
    ------
    ProtocolError
        Naming element and attribute.
    """
    attributes: dict[str, str] = {}
    infrared: list[float | None] = [None, None, None, None]
    beacons: list[BeaconReading] = []
    heard: list[HeardMessage] = []
    unknown: list[OtherReading] = []
    others: dict[str, Any] = {}
    score: ScoreReading | None = None
    leds = buttons = None
    for part in root.children:
        if part.name == "Leds":
            leds = part.attributes
        elif part.name == "Buttons":
            buttons = part.attributes
        elif part.name == "Sensors":
            attributes = part.attributes
            for sensor in part.children:
                values = sensor.attributes
                if sensor.name == "IRSensor":
                    index = strict_integer(required(values, "IRSensor", "Id"), "IRSensor Id")
                    reading = strict_real(required(values, "IRSensor", "Value"), "IRSensor Value")
                    if 0 <= index < 4:
                        infrared[index] = reading
                elif sensor.name == "BeaconSensor":
                    beacons.append(_beacon(values))
                elif sensor.name in _FIELDS:
                    field = _FIELDS[sensor.name]
                    others[field] = _read(_ELEMENTS[field], values)
                elif sensor.name == "Message":
                    sender = strict_integer(required(values, "Message", "From"), "Message From")
                    heard.append(HeardMessage(sender=sender, text=sensor.text))
                elif sensor.name == "Score":
                    score = _score(values)
                else:
                    unknown.append(OtherReading(name=sensor.name, values=tuple(values.items())))
    collision, compass, ground = (attributes.get(name) for name in ("Collision", "Compass", "Ground"))
    return Measures(
        time=strict_integer(required(root.attributes, "Measures", "Time"), "Measures Time"),
        start=buttons is not None and required(buttons, "Buttons", "Start") == "On",
        stop=buttons is not None and required(buttons, "Buttons", "Stop") == "On",
        end_led=leds is not None and required(leds, "Leds", "EndLed") == "On",
        returning_led=leds is not None and required(leds, "Leds", "ReturningLed") == "On",
        visiting_led=leds is not None and required(leds, "Leds", "VisitingLed") == "On",
        collision=None if collision is None else collision == "Yes",
        compass=None if compass is None else strict_real(compass, "Sensors Compass"),
        ground=None if ground is None else strict_integer(ground, "Sensors Ground"),
        infrared=(infrared[0], infrared[1], infrared[2], infrared[3]),
        beacons=tuple(beacons),
        messages=tuple(heard),
        score=score,
        others=tuple(unknown),
        **others,
    )


def _beacon(values: dict[str, str]) -> BeaconReading:
    value = required(values, "BeaconSensor", "Value")
    return BeaconReading(
        beacon=strict_integer(required(values, "BeaconSensor", "Id"), "BeaconSensor Id"),
        bearing=None if value == "NotVisible" else strict_real(value, "BeaconSensor Value"),
    )


def _read(element: SensorElement, values: dict[str, str]) -> Any:
    """Read the attributes of a sensor's element, each by its kind."""
    read = []
    called, attributes = element
    for name, kind in attributes.items():
        text, place = required(values, called, name), f"{called} {name}"
        read.append(text if kind is str else (strict_integer if kind is int else strict_real)(text, place))
    return read[0] if len(read) == 1 else tuple(read)


def _write(element: SensorElement, reading: Any) -> str:
    """Write a sensor's element."""
    called, attributes = element
    values = (reading,) if len(attributes) == 1 else reading
    written = "".join(
        f' {name}="{attribute(value, f"{called} {name}") if kind is str else general(value)}"'
        for (name, kind), value in zip(attributes.items(), values, strict=True)
    )
    return f"\t\t<{called}{written} />\n"


def _score(values: dict[str, str]) -> ScoreReading:
    return ScoreReading(
        score=strict_integer(values.get("Score", "0"), "Score Score"),
        arrival_time=strict_integer(values.get("ArrivalTime", "0"), "Score ArrivalTime"),
        returning_time=strict_integer(values.get("ReturningTime", "0"), "Score ReturningTime"),
        collisions=strict_integer(values.get("Collisions", "0"), "Score Collisions"),
        collision=values.get("Collision") == "True",
        visited_mask=values.get("VisitedMask", ""),
    )


def usual_measures(
    time: int,
    collision: bool,
    compass: float,
    ground: int,
    infrared: tuple[float, ...],
    line: str,
    switches: tuple[bool, ...],
) -> bytes | None:
    """Write the usual datagram from the readings themselves: what `encode` makes of the same `Measures`.

    Parameters
    ----------
    time : int
    collision : bool
    compass : float
    ground : int
    infrared : tuple of four float
    line : str
        Characters 0 and 1.
    switches : tuple of five bool
        LEDs (end, returning, visiting) and buttons (start, stop).

    Returns
    -------
    bytes or None
        None where a number is NaN, which takes a longer path.
    """
    ir0, ir1, ir2, ir3 = infrared
    text = _HEAD % (time, "Yes" if collision else "No", compass, ground, ir0, ir1, ir2, ir3, line)
    return None if "nan" in text else (text + TAILS[switches]).encode()


def measures_to_xml(measures: Measures, *, log: bool = False) -> str:
    """Write Measures as the real simulator does.

    Parameters
    ----------
    measures : Measures
    log : bool
        The form of the log document: Compass before Collision, and neither messages nor score.

    Returns
    -------
    str
        From ``<Measures`` to the newline after ``</Measures>``; real numbers with six significant digits.

    Raises
    ------
    UsageError
        If a text cannot be written in XML.
    """
    m = measures
    ir0, ir1, ir2, ir3 = m.infrared
    if (
        m.collision is not None and m.compass is not None and m.ground is not None
        and ir0 is not None and ir1 is not None and ir2 is not None and ir3 is not None
        and not log
    ):  # fmt: skip
        if (
            m.line is not None and not _ADDED and not m.beacons
            and m.gps is None and not m.messages and m.score is None and not m.others
        ):  # fmt: skip
            others = f'\t\t<LineSensor Value="{attribute(m.line, "LineSensor Value")}" />\n'
        else:
            others = _other_sensors(m, log=False)
        text = _USUAL % (
            m.time,
            "Yes" if m.collision else "No",
            m.compass,
            m.ground,
            ir0,
            ir1,
            ir2,
            ir3,
            others,
            "On" if m.end_led else "Off",
            "On" if m.returning_led else "Off",
            "On" if m.visiting_led else "Off",
            "On" if m.start else "Off",
            "On" if m.stop else "Off",
        )
        if "nan" not in text:
            return text
    return _unusual(m, log=log)


def _unusual(m: Measures, *, log: bool) -> str:
    """Write whatever sensors there are, and NaN with its sign."""
    collision = "" if m.collision is None else f' Collision="{"Yes" if m.collision else "No"}"'
    compass = "" if m.compass is None else f' Compass="{general(m.compass)}"'
    ground = "" if m.ground is None else f' Ground="{m.ground:d}"'
    infrared = "".join(
        f'\t\t<IRSensor Id="{sensor}" Value="{general(value)}"/>\n'
        for sensor, value in enumerate(m.infrared)
        if value is not None
    )
    return (
        f'<Measures Time="{m.time:d}">\n'
        f"\t<Sensors{compass + collision if log else collision + compass}{ground}>\n"
        f"{infrared}{_other_sensors(m, log=log)}"
        "\t</Sensors>\n"
        f'\t<Leds EndLed="{_on(m.end_led)}" ReturningLed="{_on(m.returning_led)}"'
        f' VisitingLed="{_on(m.visiting_led)}"/>\n'
        f'\t<Buttons Start="{_on(m.start)}" Stop="{_on(m.stop)}"/>\n'
        "</Measures>\n"
    )


def _other_sensors(m: Measures, *, log: bool) -> str:
    """Write what stands between the IR sensors and the end of Sensors."""
    lines = [
        f'\t\t<BeaconSensor Id="{reading.beacon:d}"'
        f' Value="{"NotVisible" if reading.bearing is None else general(reading.bearing)}"/>\n'
        for reading in m.beacons
    ]
    for name, element in _ELEMENTS.items():
        reading = getattr(m, name)
        if reading is not None:
            lines.append(_write(element, reading))
    for other in m.others:
        if not _NAME.fullmatch(other.name):
            raise UsageError(f"{shown(other.name)!r} cannot be the name of a sensor's element")
        written = "".join(f' {key}="{attribute(text, f"{other.name} {key}")}"' for key, text in other.values)
        lines.append(f"\t\t<{other.name}{written} />\n")
    if log:
        return "".join(lines)
    lines += (
        f'\t\t<Message From="{message.sender:d}">{cdata(message.text, "Message")}</Message>\n'
        for message in m.messages
    )
    if m.score is not None:
        s = m.score
        lines.append(
            f'\t\t<Score Score="{s.score:d}" ArrivalTime="{s.arrival_time:d}"'
            f' ReturningTime="{s.returning_time:d}" Collisions="{s.collisions:d}"'
            f' Collision="{"True" if s.collision else "False"}"'
            f' VisitedMask="{attribute(s.visited_mask, "Score VisitedMask")}" />\n'
        )
    return "".join(lines)


def _on(switch: bool) -> str:
    return "On" if switch else "Off"
