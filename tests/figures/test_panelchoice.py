"""Which steps get a panel."""

import numpy as np
import pytest

from agent.views.figures.panelchoice import telling_blocks, without_tail


@pytest.mark.parametrize(
    ("quiet", "blocks", "cut"),
    [
        ("", [], None),
        ("0", [0], None),
        ("1111", [0, 3], (0, 1)),
        ("00111", [0, 1, 2, 3, 4], None),  # one panel is not worth a note
        ("001111", [0, 1, 2, 5], (2, 3)),
        ("0101111111", [0, 1, 2, 3, 9], (3, 7)),
        ("0011110", [0, 1, 2, 3, 4, 5, 6], None),  # only the end is cut
    ],
)
def test_only_a_quiet_end_is_cut_and_the_note_says_which_steps(quiet, blocks, cut):
    choice = without_tail([sign == "1" for sign in quiet], "nothing new")
    assert choice.blocks == blocks
    assert choice.note == ("" if cut is None else f"steps {cut[0]} to {cut[1]} are not drawn: nothing new")


def certain(*columns):
    beliefs = np.zeros((len(columns), 1, 6))
    for belief, column in zip(beliefs, columns, strict=True):
        belief[0, column] = 1.0
    return beliefs


def test_a_step_that_is_certain_of_a_wrong_cell_is_drawn():
    beliefs = np.concatenate([np.full((1, 1, 6), 1 / 6), certain(0, 1, 2, 3, 4)])
    assert telling_blocks(beliefs).blocks == [0, 1, 5]
    truth = [None, (0, 0), (0, 1), (0, 2), (0, 3), (0, 4)]
    found = telling_blocks(beliefs, truth)
    assert found.blocks == [0, 1, 5]
    assert found.note.endswith("which is the true one")
    truth[3] = (0, 5)
    assert 3 in telling_blocks(beliefs, truth).blocks


def test_what_three_decimals_do_not_show_as_certain_is_drawn():
    beliefs = np.concatenate([np.full((1, 1, 6), 1 / 6), certain(0, 1, 2, 3, 4)])
    beliefs[4] = 0.0002
    beliefs[4, 0, 3] = 0.999
    assert telling_blocks(beliefs).blocks == [0, 1, 2, 3, 4, 5]
    beliefs[4] = np.nan
    assert 4 in telling_blocks(beliefs).blocks
