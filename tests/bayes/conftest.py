"""Machine code of large grids, for tests that compare it with numpy."""

from __future__ import annotations

import pytest

from ciberrato.bayes import compiled


@pytest.fixture(scope="module")
def loops():
    pytest.importorskip("numba")
    before = compiled.kernels(1)
    assert compiled.load()
    module = compiled.kernels(1)
    compiled.use(None)
    yield module
    compiled.use(before)
