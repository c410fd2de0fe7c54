"""The belief on one lattice, with the sensor models for its squares; and going over to a finer one.

While much is possible the belief is kept on the coarse lattice, whose states are a fifth as many. As soon as
few states are left, their weight is spread over the squares of the fine lattice that they cover, and the
filter goes on from there.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ciberrato.localization.belief.pose_belief import PoseBelief
from ciberrato.localization.belief.reweight import Factor, multiply
from ciberrato.localization.evidence.beacons import BeaconSense
from ciberrato.localization.evidence.other_sensors import GroundSensor, compass_log_likelihood
from ciberrato.localization.records import FilterSettings, FilterStep
from ciberrato.localization.tables.pose_tables import BINS, PoseTables
from ciberrato.localization.tables.reading_codes import ReadingCodes
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters

FEW = 4000
"""States of the coarse belief that the fine lattice takes over."""
_LEAST = 1e-12


class Stage:
    """A belief on one lattice.

    Parameters
    ----------
    lab : Lab
    tables : PoseTables
        The lattice, and the expected readings on it.
    parameters : Parameters
        As announced.
    settings : FilterSettings
    uniform : bool
        Whether to begin with every free pose; otherwise with none, to be set.
    """

    def __init__(
        self,
        lab: Lab,
        tables: PoseTables,
        parameters: Parameters,
        settings: FilterSettings,
        *,
        uniform: bool = True,
    ) -> None:
        self.lab = lab
        self.tables = tables
        self.parameters = parameters
        self.settings = settings
        self.belief = PoseBelief(tables.lattice, BINS, prune=settings.prune, uniform=uniform)
        self.ground = GroundSensor(lab, self.belief)
        """The sensor that detects targets."""
        self._codes = ReadingCodes(
            noise=parameters.obstacle_noise,
            place=settings.place_spread * tables.lattice.resolution,
            turn=settings.turn_spread * self.belief.bin_width,
            outlier=settings.outlier,
        )
        self._exact_codes = ReadingCodes(
            noise=parameters.obstacle_noise, place=0.0, turn=0.0, outlier=settings.outlier
        )

    def weigh(
        self, step: FilterStep, beacons: BeaconSense | None, *, exact: bool
    ) -> tuple[float, float] | None:
        """Multiply the belief by the likelihood of what IR sensors, compass and beacons say; normalize it.

        Parameters
        ----------
        step : FilterStep
        beacons : BeaconSense or None
            None: beacons are not used.
        exact : bool
            Whether the robot is known to be on a node: then the likelihood is the node's, not its square's.

        Returns
        -------
        evidence : float
            Sum of the weights before they were normalized: the tempered likelihood of the readings.
        elsewhere : float
            Natural logarithm of that which is to be expected of a pose anywhere.

        Of a step without readings None is returned.
        """
        belief, exponent = self.belief, step.exponent
        codes = self._exact_codes if exact else self._codes
        elsewhere = 0.0
        factors: list[Factor] = []
        for sensor, reading in enumerate(step.infrared[: len(self.tables.sensors)]):
            if reading is None:
                continue
            table = np.exp(exponent * codes.log_likelihood(reading))
            shares = self.tables.code_shares[self.tables.sensors[sensor][0]]
            elsewhere += math.log(float(shares @ table))
            factors.append((self.tables.view(sensor, belief.heading_offset), table.astype(np.float32)))
        by_bin: NDArray[np.float32] | None = None
        if step.compass is not None:
            log_likelihood = compass_log_likelihood(belief, step.compass, self.parameters.compass_noise)
            tempered = np.exp(exponent * log_likelihood)
            elsewhere += math.log(float(tempered.mean()))
            by_bin = tempered.astype(np.float32)
        multiply(belief, factors, by_bin)
        told = None
        if beacons is not None:
            told = beacons.weigh(belief, step.beacons, exponent)
            elsewhere += told or 0.0
        if not factors and by_bin is None and told is None:
            return None
        return belief.normalize(), elsewhere

    def misfit(self, step: FilterStep) -> float | None:
        """Return how badly the IR readings of a step fit the belief, before they are weighed.

        Parameters
        ----------
        step : FilterStep

        Returns
        -------
        float or None
            Mean over the readings, see `ciberrato.localization.evidence.map_fit`; None without readings, and
            of a belief over very many states, which anything fits.
        """
        belief = self.belief
        if belief.dense is not None or belief.states > FEW:
            return None
        total, count = 0.0, 0
        for sensor, reading in enumerate(step.infrared[: len(self.tables.sensors)]):
            if reading is not None:
                table = np.exp(self._codes.log_likelihood(reading))
                codes = self.tables.view(sensor, belief.heading_offset)[belief.bin, belief.square]
                total -= math.log(max(float(belief.weight @ table[codes]), _LEAST))
                count += 1
        return total / count if count else None


class FineStage:
    """The stage that follows the first one, when its tables are there and few states are left.

    Parameters
    ----------
    tables : PoseTables or None
        Tables of the fine lattice; None: they come later, to be set.
    settings : FilterSettings
    """

    def __init__(self, tables: PoseTables | None, settings: FilterSettings) -> None:
        self.tables = tables
        self.settings = settings

    def after(self, stage: Stage) -> Stage | None:
        """Return the fine stage with the belief of the coarse one, if it is time to go over to it."""
        belief = stage.belief
        if self.tables is None or belief.dense is not None or belief.states > FEW:
            return None
        fine = Stage(stage.lab, self.tables, stage.parameters, self.settings, uniform=False)
        transfer(belief, fine.belief)
        return fine


def transfer(source: PoseBelief, target: PoseBelief) -> None:
    """Spread a list of states over the squares of another lattice that they cover.

    Parameters
    ----------
    source, target : PoseBelief
        With equal bins; the source is a list. The target forgets what it held.
    """
    lattice = target.lattice
    bins, squares, weights = source.listed()
    x, y = source.places(bins, squares)
    parts = 3 if source.lattice.resolution > lattice.resolution else 1
    shifts = (np.arange(parts) - (parts - 1) / 2.0) / parts * source.lattice.resolution
    all_x = (x[:, np.newaxis, np.newaxis] + shifts).repeat(parts, axis=1)
    all_y = (y[:, np.newaxis, np.newaxis] + shifts[:, np.newaxis]).repeat(parts, axis=2)
    column = np.round((all_x - lattice.origin[0]) / lattice.resolution).astype(np.int64)
    row = np.round((all_y - lattice.origin[1]) / lattice.resolution).astype(np.int64)
    column, row = np.clip(column, 0, lattice.nx - 1), np.clip(row, 0, lattice.ny - 1)
    chosen = lattice.index[row * lattice.nx + column].reshape(len(bins), -1)
    share = np.repeat(weights[:, np.newaxis] / parts**2, parts**2, axis=1)
    target.set_weighted(
        np.repeat(bins, parts**2), chosen.ravel(), share.ravel(), heading_offset=source.heading_offset
    )
