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
from ciberrato.localization.tables.pose_tables import BINS, COARSE, PoseTables
from ciberrato.localization.tables.reading_codes import ReadingCodes
from ciberrato.localization.tables.tiled import TiledTables, Tiling
from ciberrato.world.lab import Lab
from ciberrato.world.parameters import Parameters

FEW = 4000
"""States of the coarse belief that the fine lattice takes over."""
_LEAST = 1e-12
TILES_A_MESSAGE = 2
"""Most tiles of tables computed for a message."""
_AHEAD, _COMPUTED = 0.6, 1.6
"""Units around a belief, beyond what it needs: reach of a new part of the lab; where tiles are computed."""


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

    def renew(self, tables: PoseTables) -> None:
        """Change to tables of another part of the lab, of the same resolution, with all states in it."""
        self.tables = tables
        self.belief.renumber(tables.lattice)
        self.ground = GroundSensor(self.lab, self.belief)

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

    def log_evidence(self, step: FilterStep, codes: ReadingCodes) -> float | None:
        """Return how likely the readings of a step are under the belief, before they are weighed.

        Parameters
        ----------
        step : FilterStep
        codes : ReadingCodes
            Likelihoods of readings; those of two beliefs are comparable if they have the same ones.

        Returns
        -------
        float
            Natural logarithm of the likelihood of IR sensors and compass together, up to a constant of the
            readings. None without readings, and of a belief over very many states, which is no list.
        """
        belief = self.belief
        if belief.dense is not None:
            return None
        total = np.zeros(belief.states)
        taken = [(sensor, reading) for sensor, reading in enumerate(step.infrared) if reading is not None]
        for sensor, reading in taken[: len(self.tables.sensors)]:
            expected = self.tables.view(sensor, belief.heading_offset)[belief.bin, belief.square]
            total += codes.log_likelihood(reading)[expected]
        if step.compass is not None:
            total += compass_log_likelihood(belief, step.compass, self.parameters.compass_noise)[belief.bin]
        elif not taken:
            return None
        most = float(total.max())
        return most + math.log(max(float(belief.weight @ np.exp(total - most)), _LEAST))


class FineStage:
    """The stage that follows the first one, when its tables are there and few states are left.

    With `TiledTables` the stage is on the part of the lab around its states, which follows them. Where they
    lie in too many places, or come to places whose tables are not there yet, the first stage goes on.

    Parameters
    ----------
    tables : PoseTables or TiledTables or None
        Tables of the fine lattice; None: they come later, to be set.
    settings : FilterSettings
    """

    def __init__(self, tables: PoseTables | TiledTables | None, settings: FilterSettings) -> None:
        self.tables = tables
        self.settings = settings
        self._part: Tiling = frozenset()
        self._left = TILES_A_MESSAGE

    def after(self, stage: Stage) -> Stage | None:
        """Return the fine stage with the belief of the coarse one, if it is time to go over to it."""
        belief, tables = stage.belief, self.tables
        if tables is None or belief.dense is not None or belief.states > FEW:
            return None
        if isinstance(tables, TiledTables):
            part = tables.around(belief, _AHEAD + belief.lattice.resolution)
            if part is None or not self._fetch(tables, part, last=True):
                return None
            self._part = part
            tables = tables.part(part)
        fine = Stage(stage.lab, tables, stage.parameters, self.settings, uniform=False)
        transfer(belief, fine.belief)
        return fine

    def make_room(self, stage: Stage, way: float, motions: int) -> bool:
        """Move the fine stage's part of the lab, so that it reaches as far as a belief may come.

        Parameters
        ----------
        stage : Stage
            The fine one.
        way : float
            Units that the robot may drive now, back and forth added up.
        motions : int
            Number of cycles in which it does so.

        Returns
        -------
        bool
            Whether that could be done; if not, the belief must go back to the first stage.
        """
        tables, belief = self.tables, stage.belief
        if not isinstance(tables, TiledTables):
            return True
        if belief.dense is not None:
            return False  # nothing was left of it
        # Beside the way, a cycle may spread states to the next square, and to the offset of the next heading.
        reach = way + (4 + 2 * motions) * tables.resolution
        needed = tables.around(belief, reach)
        if needed is None:
            return False
        if needed <= self._part:
            return True
        wide = tables.around(belief, reach + _AHEAD)
        if wide is not None and tables.missing(wide) == 0:
            needed = wide
        if not self._fetch(tables, needed):
            return False
        self._part = needed
        stage.renew(tables.part(needed))
        return True

    def look_ahead(self, stage: Stage) -> None:
        """Compute some of the tables around the fine stage's belief, before it comes there."""
        if isinstance(self.tables, TiledTables) and stage.belief.dense is None:
            around = self.tables.around(stage.belief, _COMPUTED)
            if around is not None:
                self._fetch(self.tables, around, last=True)

    def _fetch(self, tables: TiledTables, tiles: Tiling, *, last: bool = False) -> bool:
        """Compute what is missing of some tiles within the message's ration; `last`: it is over then."""
        before = tables.computed
        complete = tables.fetch(tiles, self._left)
        self._left = TILES_A_MESSAGE if last else self._left - (tables.computed - before)
        return complete


def common_codes(parameters: Parameters, settings: FilterSettings) -> ReadingCodes:
    """Return likelihoods of readings, of squares of the coarse lattice, by which stages can be compared."""
    return ReadingCodes(
        noise=parameters.obstacle_noise,
        place=settings.place_spread * COARSE,
        turn=settings.turn_spread * 2.0 * math.pi / BINS,
        outlier=settings.outlier,
    )


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
    chosen = lattice.squares_at(all_x, all_y).reshape(len(bins), -1)
    share = np.repeat(weights[:, np.newaxis] / parts**2, parts**2, axis=1)
    target.set_weighted(
        np.repeat(bins, parts**2), chosen.ravel(), share.ravel(), heading_offset=source.heading_offset
    )
