"""Markov localization on grids: state spaces, motion models, sensor models, the filter, summaries.

Everything here is numpy; nothing here knows which robot or world it serves. Chapters and tables in docstrings
are those of Thrun, Burgard, Fox: Probabilistic Robotics (MIT Press, 2005).

Models are imported from their own modules: `ciberrato.bayes.motion`, `.sensors`, `.maps`.
"""

from __future__ import annotations

from ciberrato.bayes.filtering import Update, predict, update, update_by_likelihood
from ciberrato.bayes.gridfilter import GridFilter
from ciberrato.bayes.logbelief import LogBelief
from ciberrato.bayes.markovfilter import MarkovFilter
from ciberrato.bayes.recovery import ImpossiblePolicy, ImpossibleReadingError
from ciberrato.bayes.selective import SelectiveFilter
from ciberrato.bayes.spaces import Axis, StateSpace
from ciberrato.bayes.summaries import (
    credible_set,
    entropy_bits,
    marginal,
    modes,
    moments,
    most_likely_cell,
    most_likely_cells,
)

__all__ = [
    "Axis",
    "GridFilter",
    "ImpossiblePolicy",
    "ImpossibleReadingError",
    "LogBelief",
    "MarkovFilter",
    "SelectiveFilter",
    "StateSpace",
    "Update",
    "credible_set",
    "entropy_bits",
    "marginal",
    "modes",
    "moments",
    "most_likely_cell",
    "most_likely_cells",
    "predict",
    "update",
    "update_by_likelihood",
]
