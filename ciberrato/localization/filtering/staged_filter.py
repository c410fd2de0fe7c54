"""Coarse first, fine later, particles in the end: the filter that keeps within a cycle's time.

It begins on the coarse lattice; the fine one takes over as soon as few states are left, particles refine the
estimate while the pose is known, and challengers doubt it now and then. If the robot turns out to be
elsewhere, everything is possible again on the coarse lattice.
"""

from __future__ import annotations

import numpy as np

from ciberrato.localization.evidence.map_fit import MapFit
from ciberrato.localization.evidence.start_prior import StartPrior
from ciberrato.localization.evidence.symmetry import PoseScore
from ciberrato.localization.filtering.challenge import Challenge
from ciberrato.localization.filtering.grid_filter import GridFilter, beacon_sense
from ciberrato.localization.filtering.stage import FineStage
from ciberrato.localization.records import FilterSettings
from ciberrato.localization.refinement.refiner import Refinement
from ciberrato.localization.tables.pose_tables import PoseTables
from ciberrato.localization.tables.tiled import TiledTables
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters

COARSE_SETTINGS = FilterSettings()


def staged_filter(
    lab: Lab,
    coarse: PoseTables,
    fine: PoseTables | TiledTables | None,
    parameters: Parameters,
    settings: FilterSettings | None = None,
    *,
    start: str | StartPrior = "anywhere",
    generator: np.random.Generator | None = None,
) -> GridFilter:
    """Return a filter with all its parts.

    Parameters
    ----------
    lab : Lab
    coarse : PoseTables
    fine : PoseTables or TiledTables or None
        May come later, as `tables` of the filter's fine stage.
    parameters : Parameters
        As announced.
    settings : FilterSettings, optional
        On the fine lattice.
    start : str or StartPrior
        See `GridFilter`.
    generator : numpy.random.Generator, optional
        For the particles that refine the estimate; the default is always the same one.

    Returns
    -------
    GridFilter
    """
    noises = parameters.obstacle_noise, parameters.compass_noise

    def challenger() -> GridFilter:
        return GridFilter(lab, coarse, parameters, COARSE_SETTINGS)

    return GridFilter(
        lab,
        coarse,
        parameters,
        COARSE_SETTINGS,
        start=start,
        fine=FineStage(fine, settings or FilterSettings()),
        refinement=Refinement(lab, coarse.angles, parameters, generator or np.random.default_rng(0)),
        challenge=Challenge(
            challenger, PoseScore(lab, coarse.angles, *noises, beacon_sense(lab, parameters))
        ),
        map_fit=MapFit(),
    )
