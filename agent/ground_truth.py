"""What the sensors would read in every cell, worked out in a thread of its own while the robot drives.

The control loop never waits for the thread. It is told the announced noise (`GroundTruthWorker.announce`)
once the simulator has answered, and asked for its tables (`GroundTruthWorker.result`) when the run is over.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ciberrato.lab import Lab
    from ciberrato.parameters import Parameters

DistanceModel = Literal["sensor", "cone"]
Angles = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GroundTruth:
    """Ideal readings and open ways of every cell of a lab. Row 0 is the bottom row.

    Attributes
    ----------
    readings : ndarray, shape (rows, columns, 4)
        Noise-free, unrounded readings of the four sensors at the cell centres, heading 0.
    east : ndarray of bool, shape (rows, columns - 1)
        Whether no wall stops a straight drive from the cell to the one on its right.
    north : ndarray of bool, shape (rows - 1, columns)
        The same to the one above.
    free : ndarray of bool, shape (rows, columns)
        Whether a robot can stand in the cell's centre.
    offsets : ndarray, shape (K, 3)
        Pose errors that a robot may have when it takes the reading of a step: ahead and to the left of the
        cell's centre in units, heading in radians.
    weights : ndarray, shape (K,)
        How likely each of them is; they sum to 1.
    spread : ndarray, shape (K, rows, columns, 4), or None
        Readings at the cell centres displaced by each pose error; None where motors have no noise.
    """

    readings: NDArray[np.float64]
    east: NDArray[np.bool_]
    north: NDArray[np.bool_]
    free: NDArray[np.bool_]
    offsets: NDArray[np.float64]
    weights: NDArray[np.float64]
    spread: NDArray[np.float64] | None = None


def pose_error(motors_noise: float) -> tuple[float, float, float]:
    """How far off the cell's centre a step's reading is taken.

    Parameters
    ----------
    motors_noise : float
        MotorsNoise as announced, in percent.

    Returns
    -------
    along, lateral : float
        Standard deviations in units.
    heading : float
        Standard deviation in radians.
    """
    return (0.03, 0.01 * motors_noise, 0.01 * motors_noise)


def pose_error_nodes(
    deviations: tuple[float, float, float], order: int = 3
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Gauss-Hermite nodes of independent normal errors.

    Parameters
    ----------
    deviations : (float, float, float)
        Standard deviations along, lateral and of the heading.
    order : int
        Nodes an axis; ``order`` nodes integrate polynomials of degree ``2 order - 1`` exactly.

    Returns
    -------
    offsets : ndarray, shape (order ** 3, 3)
        In the units of `deviations`.
    weights : ndarray, shape (order ** 3,)
    """
    import numpy as np

    nodes, weights = np.polynomial.hermite_e.hermegauss(order)
    weights = weights / weights.sum()
    grids = np.meshgrid(*(nodes * deviation for deviation in deviations), indexing="ij")
    products = np.einsum("i,j,k->ijk", weights, weights, weights)
    return np.stack(grids, axis=-1).reshape(-1, 3), products.ravel()


def compute_ground_truth(
    lab: Lab, angles: Angles, *, motors_noise: float = 0.0, model: DistanceModel = "sensor"
) -> GroundTruth:
    """Work out the tables at once, in the calling thread.

    Parameters
    ----------
    lab : Lab
    angles : tuple of four float
        Mounting angles of the sensors in degrees.
    motors_noise : float
        MotorsNoise as announced, in percent; above 0 the readings at displaced poses are worked out too.
    model : str
        ``sensor``: the distance that the real sensor takes; ``cone``: the nearest wall point in its cone.

    Returns
    -------
    GroundTruth
    """
    import numpy as np

    from ciberrato.infrared import cell_openings, cell_readings

    east, north = cell_openings(lab)
    readings = cell_readings(lab, angles, model=model)
    free = standing_room(lab)
    if motors_noise <= 0.0:
        return GroundTruth(
            readings=readings, east=east, north=north, free=free, offsets=np.zeros((1, 3)), weights=np.ones(1)
        )
    offsets, weights = pose_error_nodes(pose_error(motors_noise))
    spread = cell_readings(lab, angles, model=model, offsets=offsets)
    return GroundTruth(
        readings=readings, east=east, north=north, free=free, offsets=offsets, weights=weights, spread=spread
    )


def standing_room(lab: Lab) -> NDArray[np.bool_]:
    """Tell in which cell centres a robot can stand.

    Parameters
    ----------
    lab : Lab

    Returns
    -------
    ndarray of bool, shape (rows, columns)
        False where the centre is inside a wall or closer to one than the robot's radius.
    """
    import dataclasses

    from ciberrato.geometry import WallMap
    from ciberrato.infrared import cell_centres
    from ciberrato.kinematics import ROBOT_RADIUS

    # Lines on the floor are polygons too, but a robot may stand on them.
    obstacles = tuple(wall for wall in lab.walls if wall.height > 0.0)
    walls = WallMap.from_lab(dataclasses.replace(lab, walls=obstacles))
    x, y = cell_centres(lab)[..., 0], cell_centres(lab)[..., 1]
    return (walls.distance(x, y) >= ROBOT_RADIUS) & ~walls.inside_polygons(x, y)


class GroundTruthWorker:
    """Works the tables out in a thread of its own.

    Parameters
    ----------
    lab : Lab
    angles : tuple of four float
        Mounting angles of the sensors in degrees.
    model : str
        As in `compute_ground_truth`.
    """

    def __init__(self, lab: Lab, angles: Angles, *, model: DistanceModel = "sensor") -> None:
        self._lab = lab
        self._angles: Angles = angles
        self._model: DistanceModel = model
        self._motors_noise = 0.0
        self._announced = threading.Event()
        self._tables: GroundTruth | None = None
        self.error: BaseException | None = None
        """What went wrong, as soon as it has."""
        self._thread = threading.Thread(target=self._run, name="ground truth", daemon=True)

    def start(self) -> None:
        """Start the thread; it loads numpy at once and then waits for the announcement."""
        self._thread.start()

    def announce(self, parameters: Parameters) -> None:
        """Say what noise the simulator announced; the thread goes on from there.

        Parameters
        ----------
        parameters : Parameters
        """
        self._motors_noise = parameters.motors_noise
        self._announced.set()

    def result(self) -> GroundTruth:
        """Wait for the tables.

        Returns
        -------
        GroundTruth

        Raises
        ------
        Exception
            Whatever stopped the thread.
        """
        self._announced.set()
        self._thread.join()
        if self.error is not None:
            raise self.error
        assert self._tables is not None
        return self._tables

    def _run(self) -> None:
        try:
            import ciberrato.infrared  # noqa: F401 (its imports cost more than the tables: not after the announcement)

            self._announced.wait()
            self._tables = compute_ground_truth(
                self._lab, self._angles, motors_noise=self._motors_noise, model=self._model
            )
        except BaseException as error:
            self.error = error
