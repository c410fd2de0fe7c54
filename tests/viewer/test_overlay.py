"""The overlay protocol: every message survives the wire, everything else is refused by name."""

import contextlib
import json
import socket
import string

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ciberrato.errors import ProtocolError
from ciberrato.net.overlay import OverlayClient
from ciberrato.overlay import (
    MOST_BYTES,
    MOST_CELLS,
    MOST_SHAPES,
    Arrow,
    Circle,
    Ellipse,
    GridBelief,
    Line,
    OverlayMessage,
    Polygon,
    PoseMark,
    Text,
    decode_overlay,
    encode_overlay,
)

coordinates = st.floats(-1e6, 1e6)
lengths = st.floats(0, 1e6)
names = st.text(string.ascii_letters + string.digits + " äé<&'\"", min_size=1, max_size=20)
points = st.lists(st.tuples(coordinates, coordinates), min_size=2, max_size=5).map(tuple)
common = {
    "id": names,
    "color": st.none() | st.from_regex(r"#[0-9a-f]{6}", fullmatch=True),
    "label": st.just("") | names,
    "ttl": st.none() | st.floats(0.001, 1e6),
}
place = {"x": coordinates, "y": coordinates}
shapes = st.one_of(
    st.builds(Circle, **common, **place, radius=lengths),
    st.builds(Line, **common, points=points),
    st.builds(Polygon, **common, points=points),
    st.builds(Arrow, **common, **place, direction=coordinates, length=lengths),
    st.builds(Ellipse, **common, **place, radii=st.tuples(lengths, lengths), direction=coordinates),
    st.builds(Text, **common, **place, text=names),
    st.builds(PoseMark, **common, **place, direction=coordinates),
)


@settings(max_examples=60, deadline=None)
@given(
    source=names,
    robot=st.none() | st.integers(0, 99),
    time=st.none() | st.integers(0, 10**6),
    angles=st.none() | st.tuples(*[st.floats(-360, 360)] * 4),
    drawn=st.lists(shapes, max_size=4).map(tuple),
    remove=st.lists(names, max_size=3).map(tuple),
    clear=st.booleans(),
)
def test_every_message_survives_the_wire(source, robot, time, angles, drawn, remove, clear):
    message = OverlayMessage(
        source=source, robot=robot, time=time, angles=angles, shapes=drawn, remove=remove, clear=clear
    )
    read = decode_overlay(encode_overlay(message))
    for name in ("source", "robot", "time", "angles", "shapes", "remove", "clear"):
        assert getattr(read, name) == getattr(message, name), name


@pytest.mark.parametrize(("shape", "accuracy"), [((7, 14), 1e-5), ((1, 1), 1e-5), ((100, 120), 1e-7)])
def test_a_belief_survives_the_wire_as_numbers_or_base64(shape, accuracy):
    cells = np.random.default_rng(1).random(shape) + 0.01
    cells /= cells.sum()
    extent = (0.0, 1.0, 20.0, 10.5)
    data = encode_overlay(OverlayMessage(source="a", belief=GridBelief(cells=cells, extent=extent)))
    assert len(data) <= MOST_BYTES
    read = decode_overlay(data).belief
    assert read.extent == extent
    np.testing.assert_allclose(read.cells, cells, rtol=accuracy)


def test_the_format_is_what_the_manual_shows():
    message = OverlayMessage(
        source="santos",
        robot=1,
        time=12,
        belief=GridBelief(cells=np.array([[0.25, 0.75]])),
        shapes=(Circle(id="goal", x=3.0, y=5.0, radius=0.5),),
    )
    assert json.loads(encode_overlay(message)) == {
        "overlay": 1,
        "source": "santos",
        "robot": 1,
        "time": 12,
        "belief": {"rows": 1, "columns": 2, "cells": [0.25, 0.75]},
        "shapes": [{"kind": "circle", "id": "goal", "x": 3.0, "y": 5.0, "radius": 0.5, "ttl": 2.0}],
    }


def datagram(**entries):
    return json.dumps({"overlay": 1, "source": "a"} | entries).encode()


def belief(**entries):
    return datagram(belief={"rows": 1, "columns": 2, "cells": [0.5, 0.5]} | entries)


def shape(**entries):
    return datagram(shapes=[{"kind": "circle", "id": "c", "x": 0, "y": 0, "radius": 1} | entries])


@pytest.mark.parametrize(
    ("data", "named"),
    [
        (b"", "JSON"),
        (b"\xff\xfe", "JSON"),
        (b"[" * 50_000, "JSON"),
        (b"x" * (MOST_BYTES + 1), "bytes"),
        (b'{"overlay":1,"source":"a","time":NaN}', "JSON"),
        (b'"overlay"', "overlay"),
        (b'{"overlay":2,"source":"a"}', "overlay"),
        (b'{"overlay":1}', "source"),
        (datagram(source=""), "source"),
        (datagram(source="a\nb"), "source"),
        (datagram(source="x" * 300), "source"),
        (datagram(robot=-1), "robot"),
        (datagram(robot=True), "robot"),
        (datagram(time=1.5), "time"),
        (datagram(angles=[0, 90]), "angles"),
        (datagram(remove="c"), "remove"),
        (datagram(belief=[]), "belief"),
        (belief(rows=0), "belief"),
        (belief(rows=10**9, columns=10**9), "belief"),
        (belief(rows=MOST_CELLS), "belief"),
        (belief(cells=[0.5]), "cells"),
        (belief(cells=[0.5, -0.5]), "belief"),
        (belief(cells=[0, 0]), "belief"),
        (belief(cells=[0.5, "x"]), "cells"),
        (belief(cells_base64="###"), "base64"),
        (belief(cells_base64="AAAA"), "float32"),
        (belief(cells_base64=7), "base64"),
        (belief(cells_base64="AADAfwAAwH8="), "finite"),
        (belief(extent=[4, 0, 2, 2]), "extent"),
        (datagram(shapes={}), "shapes"),
        (datagram(shapes=[1]), "shapes"),
        (datagram(shapes=[{}] * (MOST_SHAPES + 1)), "shapes"),
        (shape(kind="script"), "kind"),
        (shape(x="0"), "x"),
        (shape(x=1e300), "x"),
        (shape(radius=-1), "radius"),
        (shape(color="red;x"), "color"),
        (shape(ttl=0), "ttl"),
        (shape(kind="line", points=[[0, 0]]), "points"),
        (shape(kind="line"), "points"),
        (shape(kind="text", text="x" * 300), "text"),
        (shape(kind="ellipse", radii=[1, -1]), "radii"),
    ],
)
def test_what_is_no_overlay_is_refused_by_name(data, named):
    with pytest.raises(ProtocolError, match=named):
        decode_overlay(data)


KEYS = ["overlay", "source", "belief", "rows", "columns", "cells", "shapes", "kind", "points", "x"]
leaves = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)


def nested(inner):
    return st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(KEYS), inner, max_size=4)


@settings(max_examples=200, deadline=None)
@given(st.dictionaries(st.sampled_from(KEYS), st.recursive(leaves, nested, max_leaves=12), max_size=6))
def test_any_json_is_read_or_refused(document):
    data = json.dumps({"overlay": 1, "source": "a"} | document).encode()
    with contextlib.suppress(ProtocolError):
        decode_overlay(data)


def test_what_a_viewer_would_refuse_is_not_sent():
    with pytest.raises(ProtocolError, match="belief"):
        encode_overlay(OverlayMessage(source="a", belief=GridBelief(cells=np.zeros((2, 2)))))
    with pytest.raises(ProtocolError, match="JSON"):
        encode_overlay(OverlayMessage(source="a", shapes=(Circle(id="c", x=float("nan"), y=0, radius=1),)))
    with pytest.raises(ProtocolError, match="dimensions"):
        encode_overlay(OverlayMessage(source="a", belief=GridBelief(cells=np.ones(3))))


def test_the_client_sends_the_longest_message_and_does_not_mind_that_nobody_listens():
    message = OverlayMessage(source="a", belief=GridBelief(cells=np.random.default_rng(1).random((100, 120))))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(300)
        with OverlayClient(port=receiver.getsockname()[1]) as client:
            client.send(message)
            data = receiver.recv(65536)
            assert decode_overlay(data).belief.cells.shape == (100, 120)
            receiver.close()
            for _ in range(3):
                client.send(message)
