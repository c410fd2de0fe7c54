"""Memory bandwidth of one core: the bound that large beliefs run into."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.measure import Row, best_time

_WORDS = 12_000_000


def bytes_per_second() -> float:
    """Measure a product of two arrays into a third, 96 MB each: two read, one written."""
    first, second, out = np.ones(_WORDS), np.ones(_WORDS), np.zeros(_WORDS)
    return 3 * 8 * _WORDS / best_time(lambda: np.multiply(first, second, out=out), budget=1.0)


def rows() -> Iterator[Row]:
    """Yield the time for the product, and what that makes a second."""
    rate = bytes_per_second()
    moved = 3.0 * 8 * _WORDS
    yield Row(
        group="memory: product of 2 x 96 MB",
        who="numpy, one core",
        seconds=moved / rate,
        ours=True,
        megabytes=moved / 1e6,
        moved=moved,
        note=f"{rate / 1e9:.1f} GB/s",
    )
