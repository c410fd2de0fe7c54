"""What agents show is kept by source and time, in bounded memory."""

import base64

import numpy as np
import pytest

import ciberrato.viewer.overlay_store
from ciberrato.overlay import Circle, GridBelief, OverlayMessage
from ciberrato.viewer.overlay_store import MOST_SHAPES, MOST_SOURCES, OverlayStore
from ciberrato.world.lab import Lab

LAB = Lab(width=8.0, height=4.0)
WORLD = {
    "time": 9,
    "lab": LAB,
    "place_of": lambda robot, time: (5.0, 3.0) if (robot, time) == (1, 9) else None,
}


def belief(cells, **values):
    values = {"source": "a", "robot": 1} | values
    return OverlayMessage(belief=GridBelief(cells=np.array(cells, float)), **values)


def circle(name, ttl=2.0):
    return Circle(id=name, x=0.0, y=0.0, radius=1.0, ttl=ttl)


def test_a_belief_is_normalized_summed_up_and_compared_with_the_truth():
    store = OverlayStore()
    # Eight cells of 2 x 2 units; the robot is in the third column of the upper row.
    source = store.receive(belief([[0, 0, 0, 0], [0, 2, 2, 4]]), now=0.0, **WORLD)
    assert source.series() == [[9, 1.5, 0.5, 0.25]]
    document = source.belief_at(9).document()
    levels = np.frombuffer(base64.b64decode(document["cells"]), "<u2").reshape(2, 4) / 65535
    np.testing.assert_allclose(document["peak"] * levels**2, [[0, 0, 0, 0], [0, 0.25, 0.25, 0.5]], atol=2e-5)
    assert document["modes"][0][:3] == [1, 3, 0.5]


def test_the_true_cell_is_unknown_without_a_robot_or_outside_the_grid():
    store = OverlayStore()
    source = store.receive(belief([[1.0]], robot=7), now=0.0, **WORLD)
    message = OverlayMessage(
        source="b", robot=1, belief=GridBelief(cells=np.ones((1, 1)), extent=(0, 0, 2, 2))
    )
    other = store.receive(message, now=0.0, **WORLD)
    assert source.series()[0][3] is None
    assert other.series()[0][3] is None


def test_a_belief_ahead_of_the_frames_is_compared_when_its_own_frame_has_come():
    places = {9: (3.0, 3.0), 10: (3.0, 3.0), 11: (5.0, 3.0), 12: (7.0, 3.0)}

    def place_of(robot, time):
        # As the time line does it: what is not there yet is as it was last.
        return places[min(time, newest)]

    newest = 9
    store = OverlayStore()
    world = {"time": newest, "lab": LAB, "place_of": place_of}
    cells = [[0, 0, 0, 0], [0, 1, 2, 1]]
    source = store.receive(belief(cells, time=11), now=0.0, **world)
    assert source.series() == [[11, 1.5, 0.5, None]]
    assert source.belief_at(11).document()["place"] is None
    for newest in (10, 11, 12):
        version = source.version
        store.settle(newest, LAB, place_of)
        assert source.version == version + (newest == 11)
    assert source.series() == [[11, 1.5, 0.5, 0.5]]
    assert source.belief_at(11).document()["place"] == (5.0, 3.0)


def test_beliefs_are_found_by_time_however_late_they_came():
    store = OverlayStore()
    for time in (10, 30, 20, 30):
        source = store.receive(belief([[1.0, time]], time=time), now=0.0, **WORLD)
    assert [row[0] for row in source.series()] == [10, 20, 30]
    assert source.belief_at(9) is None
    assert [source.belief_at(time).time for time in (10, 19, 20, 99)] == [10, 10, 20, 30]


def test_shapes_live_until_their_time_is_over_or_they_are_removed():
    store = OverlayStore()
    drawn = (circle("short", 1.0), circle("long", 5.0), circle("ever", None))
    store.receive(OverlayMessage(source="a", shapes=drawn), now=0.0, **WORLD)

    def ids():
        return [document["id"] for document in store.shape_documents()]

    assert ids() == ["short", "long", "ever"]
    store.expire(1.0)
    assert ids() == ["long", "ever"]
    store.receive(OverlayMessage(source="a", shapes=(circle("long", 9.0),)), now=4.0, **WORLD)
    store.expire(6.0)
    assert sorted(ids()) == ["ever", "long"]
    store.receive(OverlayMessage(source="a", remove=("ever", "unknown")), now=6.0, **WORLD)
    assert ids() == ["long"]
    store.receive(OverlayMessage(source="b", clear=True), now=6.0, **WORLD)
    assert ids() == ["long"]
    store.receive(OverlayMessage(source="a", clear=True), now=6.0, **WORLD)
    assert ids() == []


def test_every_change_of_shapes_is_noticed():
    store = OverlayStore()
    versions = [store.shapes_version]
    for message in (
        OverlayMessage(source="a", shapes=(circle("c"),)),
        OverlayMessage(source="a", remove=("c",)),
        OverlayMessage(source="a", angles=(0.0, 1.0, 2.0, 3.0)),
        OverlayMessage(source="a", clear=True),
    ):
        store.receive(message, now=0.0, **WORLD)
        versions.append(store.shapes_version)
    assert versions == sorted(set(versions))


def test_sources_and_shapes_are_bounded():
    store = OverlayStore()
    for n in range(2 * MOST_SOURCES):
        store.receive(OverlayMessage(source=f"s{n}"), now=0.0, **WORLD)
    assert list(store.sources) == [f"s{n}" for n in range(MOST_SOURCES, 2 * MOST_SOURCES)]
    for n in range(10 * MOST_SHAPES):
        store.receive(OverlayMessage(source="s40", shapes=(circle(str(n), None),)), now=0.0, **WORLD)
    assert len(store.shape_documents()) == MOST_SHAPES


@pytest.mark.parametrize("sources", [1, 4])
def test_beliefs_are_bounded_by_their_bytes_and_the_newest_stay(monkeypatch, sources):
    monkeypatch.setattr(ciberrato.viewer.overlay_store, "MOST_BELIEF_BYTES", 50_000)
    store = OverlayStore()
    for time in range(400):
        for n in range(sources):
            store.receive(belief(np.ones((10, 20)), source=f"s{n}", time=time), now=0.0, **WORLD)
    kept = [belief for source in store.sources.values() for belief in source.beliefs]
    assert sum(belief.levels.nbytes for belief in kept) <= 50_000 + 400
    assert all(source.beliefs[-1].time == 399 for source in store.sources.values())
