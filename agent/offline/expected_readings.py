"""Expected readings of the sensors in every cell, computed in a thread of its own while the robot drives.

The control loop never waits for the thread. `ExpectedReadingsWorker.announce` tells it the announced noise
once the simulator has answered, and `ExpectedReadingsWorker.result` asks for its tables after the run.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ciberrato.errors import LabError
from ciberrato.world.coordinates import SensorAngles

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ciberrato.files.run_records import DistanceModel
    from ciberrato.world.lab import Lab, Wall
    from ciberrato.world.parameters import Parameters


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ExpectedReadings:
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
        Probability of each of them; they sum to 1.
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


def pose_error(parameters: Parameters) -> tuple[float, float, float]:
    """Return how far from the cell's centre our pilot takes the reading of a step.

    Power laws through what 100 simulated drives of 13 cells each gave at cruise 0.1, for motor noises of
    0.5 to 5 %, compass noises of 0.5 to 8 degrees and IR noises of 0.1 to 0.4: within 6 % along, 35 % for
    the others.

    Parameters
    ----------
    parameters : Parameters
        Noise levels as announced.

    Returns
    -------
    along, lateral : float
        Standard deviations in units.
    heading : float
        Standard deviation in radians.
    """
    motors = parameters.motors_noise / 1.5
    compass = max(parameters.compass_noise, 0.5) / 2.0 if parameters.compass_sensor else 2.0
    infrared = max(parameters.obstacle_noise, 0.05) / 0.1
    return (
        0.024 * motors,
        0.0154 * motors**0.4 * compass**0.25 * infrared**0.25,
        0.0140 * motors**0.55 * compass**0.3 * infrared**0.1,
    )


def pose_error_nodes(
    deviations: tuple[float, float, float], order: int = 3
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return Gauss-Hermite nodes of independent normal errors.

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


def compute_expected_readings(
    lab: Lab, angles: SensorAngles, parameters: Parameters | None = None, *, model: DistanceModel = "sensor"
) -> ExpectedReadings:
    """Compute the tables at once, in the calling thread.

    Parameters
    ----------
    lab : Lab
    angles : tuple of four float
        Mounting angles of the sensors in degrees.
    parameters : Parameters or None
        As announced; where motors have noise the readings at displaced poses are worked out too.
    model : str
        ``sensor``: the distance that the real sensor takes; ``cone``: the nearest wall point in its cone.

    Returns
    -------
    ExpectedReadings
    """
    import numpy as np

    from ciberrato.infrared.model import cell_openings, cell_readings

    east, north = cell_openings(lab)
    readings = cell_readings(lab, angles, model=model)
    free = standable_cells(lab)
    if parameters is None or parameters.motors_noise <= 0.0:
        return ExpectedReadings(
            readings=readings, east=east, north=north, free=free, offsets=np.zeros((1, 3)), weights=np.ones(1)
        )
    offsets, weights = pose_error_nodes(pose_error(parameters))
    spread = cell_readings(lab, angles, model=model, offsets=offsets)
    return ExpectedReadings(
        readings=readings, east=east, north=north, free=free, offsets=offsets, weights=weights, spread=spread
    )


def standable_cells(lab: Lab) -> NDArray[np.bool_]:
    """Return in which cell centres a robot can stand.

    Parameters
    ----------
    lab : Lab

    Returns
    -------
    ndarray of bool, shape (rows, columns)
        False where the centre is inside a wall or closer to one than the robot's radius.
    """
    import dataclasses

    from ciberrato.geometry.walls import WallMap
    from ciberrato.infrared.model import cell_centres
    from ciberrato.physics.kinematics import ROBOT_RADIUS

    x, y = cell_centres(lab)[..., 0], cell_centres(lab)[..., 1]
    free = ~WallMap.from_lab(lab).obstructs(x, y, x, y, ROBOT_RADIUS)
    # Clear of all faces a robot may still be inside a wall, if the wall is thick enough to hold it. (Lines on
    # the floor are polygons too, but a robot may stand on them.)
    thick = tuple(wall for wall in lab.walls if wall.height > 0.0 and _thickness(wall) >= 2.0 * ROBOT_RADIUS)
    return free & ~WallMap.from_lab(dataclasses.replace(lab, walls=thick)).point_in_polygons(x, y)


def _thickness(wall: Wall) -> float:
    """Return the smaller side of a wall's bounding box: it is nowhere thicker."""
    xs, ys = [x for x, _ in wall.corners], [y for _, y in wall.corners]
    return min(max(xs) - min(xs), max(ys) - min(ys))


class ExpectedReadingsWorker:
    """Works the tables out in a thread of its own.

    Parameters
    ----------
    lab : Lab
    angles : tuple of four float
        Mounting angles of the sensors in degrees.
    model : str
        As in `compute_expected_readings`.
    """

    def __init__(self, lab: Lab, angles: SensorAngles, *, model: DistanceModel = "sensor") -> None:
        self._lab = lab
        self._angles: SensorAngles = angles
        self._model: DistanceModel = model
        self._parameters: Parameters | None = None
        self._announced = threading.Event()
        self._abandoned = False
        self._tables: ExpectedReadings | None = None
        self.error: BaseException | None = None
        """Error of the thread, as soon as there is one."""
        self._thread = threading.Thread(target=self._run, name="expected readings", daemon=True)

    def start(self) -> None:
        """Start the thread; it loads numpy at once and then waits for the announcement."""
        self._thread.start()

    def announce(self, parameters: Parameters) -> None:
        """Set the noise that the simulator announced; the thread continues with it.

        Parameters
        ----------
        parameters : Parameters
        """
        self._parameters = parameters
        self._announced.set()

    def result(self) -> ExpectedReadings:
        """Wait for the tables.

        Returns
        -------
        ExpectedReadings

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

    def abandon(self) -> None:
        """Stop the thread as soon as possible, and wait for its end: its results are not needed."""
        self._abandoned = True
        self._announced.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        try:
            import ciberrato.infrared.model  # noqa: F401 (its imports cost more than the tables: not after the announcement)

            self._announced.wait()
            if self._abandoned:
                return
            self._tables = compute_expected_readings(
                self._lab, self._angles, self._parameters, model=self._model
            )
        except MemoryError:
            size = f"{self._lab.rows} x {self._lab.columns} cells"
            self.error = LabError(
                f"not enough memory for the expected readings of {size}", source=self._lab.name
            )
        except BaseException as error:
            self.error = error
