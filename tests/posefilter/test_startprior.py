from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from ciberrato.errors import UsageError
from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.evidence.start_prior import StartPrior, begin_with, check_start, parse_start
from ciberrato.localization.evidence.symmetry import Turn
from ciberrato.localization.filtering.grid_filter import GridFilter
from ciberrato.world.parameters import Parameters

DEFAULT = Parameters(sim_time=0)


@pytest.mark.parametrize(
    ("text", "prior"),
    [
        ("anywhere", StartPrior()),
        ("centres", StartPrior(centres=True)),
        ("centres:0", StartPrior(centres=True, heading_deg=0.0)),
        ("centres:-92.5", StartPrior(centres=True, heading_deg=-92.5)),
        ("3,4.5", StartPrior(place=(3.0, 4.5))),
        ("3,4.5,180", StartPrior(place=(3.0, 4.5), heading_deg=180.0)),
    ],
)
def test_what_is_known_of_the_start_is_read(text, prior):
    assert parse_start(text) == prior


@pytest.mark.parametrize(
    "text",
    ["", "center", "centres:", "centres:x", "centres:1,2", "3", "1,2,3,4", "nan,2", "1,inf", "anywhere:0"],
)
def test_nonsense_is_one_clear_line(text):
    with pytest.raises(UsageError) as caught:
        parse_start(text)
    assert "centres:DEGREES" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_start_outside_the_lab_or_in_a_wall_is_refused(small_lab):
    check_start(parse_start("1,1"), small_lab)
    check_start(parse_start("centres"), small_lab)
    for text, what in (
        ("9,1", "outside the lab"),
        ("1,-1", "outside"),
        ("5.5,3.8", "wall"),
        ("0.1,3", "wall"),
    ):
        with pytest.raises(UsageError, match=what):
            check_start(parse_start(text), small_lab)


def test_centres_with_a_heading_are_centres_with_that_heading(small_lab, coarse_tables):
    for degrees in (0.0, 92.0, -33.3):
        belief = GridFilter(small_lab, coarse_tables, DEFAULT, start=f"centres:{degrees}").belief
        assert belief.states == 11  # one of the twelve centres is inside the block
        (row,) = set(belief.bin.tolist())
        off = math.remainder(belief.headings()[row] - math.radians(degrees), 2.0 * math.pi)
        assert off == pytest.approx(0.0, abs=1e-12)
        assert abs(belief.heading_offset) <= belief.bin_width / 2.0 + 1e-12


def test_a_known_start_is_known_to_a_square_and_a_bin(small_lab, coarse_tables):
    start = StartPrior(place=(3.1, 4.7), heading_deg=47.0)
    pose_filter = GridFilter(small_lab, coarse_tables, DEFAULT, start=start)
    found, belief = pose_filter.estimate(), pose_filter.belief
    assert math.hypot(found.x - 3.1, found.y - 4.7) < 0.05
    assert math.degrees(found.heading) == pytest.approx(47.0, abs=1.0)
    weights, lattice = belief.square_weights(), belief.lattice
    spread = math.sqrt(weights @ (lattice.x - 3.1) ** 2)
    assert spread == pytest.approx(lattice.resolution, rel=0.3)
    anyhow = GridFilter(small_lab, coarse_tables, DEFAULT, start="3.1,4.7").belief
    assert anyhow.bin_weights() == pytest.approx(1.0 / 72.0)
    assert anyhow.square_weights() == pytest.approx(weights, abs=1e-6)


def test_a_start_without_any_free_pose_is_an_error(coarse_tables):
    with pytest.raises(UsageError, match="no free pose"):
        begin_with(PoseBelief(coarse_tables.lattice), StartPrior(place=(30.0, 4.0)))


def test_a_known_start_rules_the_images_of_a_symmetric_lab_out(small_lab, coarse_tables):
    half = Turn(4.0, 3.0, math.pi)
    assert not parse_start("centres").excludes(half)
    assert not parse_start("4,3").excludes(half)  # turned about itself
    assert parse_start("1,1").excludes(half)
    assert parse_start("centres:0").excludes(half)
    symmetric = dataclasses.replace(coarse_tables, _turns=[[half]])
    shares = []
    for start in ("centres", "centres:0"):
        pose_filter = GridFilter(small_lab, symmetric, DEFAULT, start=start)
        lone = np.array([0])
        pose_filter.belief.set_states(lone, lone)
        shares.append(pose_filter.estimate().probability)
    assert shares == [pytest.approx(0.5), pytest.approx(1.0)]
