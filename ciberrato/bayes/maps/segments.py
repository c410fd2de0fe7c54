"""Maps of line segments, and the range of a ray to the nearest one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ciberrato.bayes.arraytypes import FloatArray
from ciberrato.bayes.checks import finite_array, where


@dataclass(frozen=True, slots=True)
class SegmentMap:
    """Walls without thickness.

    Attributes
    ----------
    segments : FloatArray, shape (n, 4)
        x and y of one end, x and y of the other.
    """

    segments: FloatArray

    def __post_init__(self) -> None:
        segments = np.array(self.segments, dtype=float)
        if (
            segments.ndim != 2
            or segments.shape[1] != 4
            or not len(segments)
            or not np.isfinite(segments).all()
        ):
            wrong = ~np.isfinite(segments)
            place = f"; entry {where(wrong)} is {segments[wrong].flat[0]}" if wrong.any() else ""
            raise ValueError(f"segments need shape (n, 4) and finite ends, not {segments.shape}{place}")
        segments.setflags(write=False)
        object.__setattr__(self, "segments", segments)

    def cast(self, x: ArrayLike, y: ArrayLike, angle: ArrayLike, max_range: float = np.inf) -> FloatArray:
        """Compute the range of rays to the nearest segment.

        Parameters
        ----------
        x, y, angle : array_like
            Origins of rays and their directions (radians), broadcast.
        max_range : float
            Given where a ray hits nothing nearer.

        Returns
        -------
        FloatArray
            The broadcast shape. A ray that runs exactly along a segment does not hit it, but those that meet
            its ends.

        Raises
        ------
        ValueError
            If a coordinate or angle is not finite, or the longest range not positive.
        """
        if not max_range > 0.0:
            raise ValueError(f"max_range must be positive, not {max_range}")
        x, y, angle = np.broadcast_arrays(
            *(
                finite_array(values, what=name)[..., np.newaxis]
                for name, values in (("x", x), ("y", y), ("angles", angle))
            )
        )
        ax, ay, bx, by = self.segments.T
        ux, uy = np.cos(angle), np.sin(angle)
        ex, ey = bx - ax, by - ay
        across = ux * ey - uy * ex
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = ((ax - x) * ey - (ay - y) * ex) / across
            along = ((ax - x) * uy - (ay - y) * ux) / across
        # Room for rounding at the ends, so that no ray slips through where two walls meet.
        hits = (across != 0.0) & (distance >= 0.0) & (along >= -1e-12) & (along <= 1.0 + 1e-12)
        return np.asarray(np.minimum(np.where(hits, distance, np.inf).min(axis=-1), max_range))
