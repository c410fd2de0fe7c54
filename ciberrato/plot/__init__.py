"""Plots of labs, sensors, beliefs, runs and evaluations: each draws into axes and returns them.

Every function takes ``ax``, matplotlib's axes to draw in; without it a new figure is made by pyplot, with its
legend or colour bar (``legend=True`` adds them to axes of your own). Lengths are units of the lab, scales
of maps are equal along x and y, colours are told apart by colour-blind readers, too. matplotlib is loaded
when the first plot is drawn.

Examples
--------
>>> from ciberrato import find_lab, plot, read_lab
>>> ax = plot.lab(read_lab(find_lab("maze")))  # doctest: +SKIP
>>> ax.figure.savefig("maze.png")  # doctest: +SKIP
"""

from ciberrato.plot.beliefs import cells, poses
from ciberrato.plot.curves import entropies, probabilities, series
from ciberrato.plot.labs import cones, lab, readings
from ciberrato.plot.outcomes import (
    calibration,
    collisions,
    place_errors,
    times_to_localize,
    truth_probabilities,
)
from ciberrato.plot.tracks import track

__all__ = [
    "calibration",
    "cells",
    "collisions",
    "cones",
    "entropies",
    "lab",
    "place_errors",
    "poses",
    "probabilities",
    "readings",
    "series",
    "times_to_localize",
    "track",
    "truth_probabilities",
]
