"""Whether the readings fit the map at all, which no comparison of poses within one map can show.

A filter with a wrong map is soon certain of the pose that explains the readings least badly. So the readings
are held against what they could be at best: the misfit of a reading is the natural logarithm of the
likelihood that it has where the map explains it best, over the likelihood that it has under the belief before
it. In the right map it is small whatever the noise; in a wrong one readings come that the belief leaves to
the outliers of the sensor model, again and again.

Misfits above what is usual are summed up, and the sum is held at 0 from below: a one-sided CUSUM (Page, 1954)
of the model's log evidence against its expectation (Thrun, Burgard, Fox, *Probabilistic Robotics*, section
6.3.4, on readings that a map does not hold).
"""

from __future__ import annotations

USUAL = 0.65
"""Misfit of a reading that counts for nothing: above the mean of all right maps, below that of wrong ones."""
DOUBT = 15.0
"""Sum at which the map is called wrong; `python -m benchmarks.wrong_map` shows how often that is so."""


class MapFit:
    """Sums up how badly readings fit a map.

    Attributes
    ----------
    level : float
        The sum, in natural logarithms a reading.
    worst : float
        The greatest that it has been.
    readings : int
        Moments that counted.
    since : int or None
        Time (simulated cycles) at which the map was first found not to fit; None: it fits so far.
    """

    def __init__(self) -> None:
        self.level = self.worst = 0.0
        self.readings = 0
        self.since: int | None = None

    def observe(self, misfit: float, weight: float, time: int) -> None:
        """Update with the mean misfit of the readings at one moment.

        Parameters
        ----------
        misfit : float
            See the module's text.
        weight : float
            From 0 to 1: how much of the moment is new. A robot that stands repeats one error.
        time : int
            Simulated cycles.
        """
        self.readings += 1
        self.level = max(self.level + weight * (misfit - USUAL), 0.0)
        self.worst = max(self.worst, self.level)
        if self.since is None and self.level > DOUBT:
            self.since = time
