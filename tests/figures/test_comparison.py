"""How two belief files differ."""

import math

import numpy as np
import pytest

from agent.offline.comparison import compare_beliefs, comparison_table, jensen_shannon
from ciberrato.errors import UsageError


def test_divergence_by_the_definition():
    p, q = np.array([[0.5, 0.5, 0.0]]), np.array([[0.25, 0.25, 0.5]])
    m = [0.375, 0.375, 0.25]
    kl_p = 2 * 0.5 * math.log2(0.5 / m[0])
    kl_q = 2 * 0.25 * math.log2(0.25 / m[0]) + 0.5 * math.log2(0.5 / m[2])
    assert jensen_shannon(p, q) == pytest.approx((kl_p + kl_q) / 2)
    assert jensen_shannon(p, p) == 0
    assert jensen_shannon(np.array([1.0, 0]), np.array([0, 1.0])) == 1
    assert math.isnan(jensen_shannon(np.array([math.nan, 0]), p[0, :2]))


def test_where_and_by_how_much():
    first = np.array([[[0.25, 0.25], [0.25, 0.25]], [[0.5, 0.5], [0, 0]], [[1, 0], [0, 0]]])
    second = first[:2].copy()
    second[1] = [[0.5, 0.2], [0.3, 0]]
    found = compare_beliefs(first, second)
    np.testing.assert_allclose(found.greatest, [0, 0.3])
    assert found.cells[1] in {(0, 1), (1, 0)}
    assert found.surplus == (1, 0)
    lines = comparison_table(found).splitlines()
    assert lines[1].split()[:2] == ["prior", "0.000"]
    assert lines[2].split()[1] == "0.300"
    assert lines[3] == "1 more block only in the first file"


def test_undefined_blocks_have_no_difference():
    first = np.full((1, 2, 2), 0.25)
    found = compare_beliefs(first, np.full((1, 2, 2), np.nan))
    assert np.isnan(found.greatest).all()
    assert "nan" in comparison_table(found)


def test_files_of_different_labs_are_refused():
    with pytest.raises(UsageError, match="2 x 2 and 1 x 4 cells"):
        compare_beliefs(np.full((1, 2, 2), 0.25), np.full((1, 1, 4), 0.25))
