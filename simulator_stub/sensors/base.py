"""Interface of sensors: measured in each cycle, delivered late if so configured, sent if asked for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar

from simulator_stub.world.noise import NoiseRoot, Stream, streams

if TYPE_CHECKING:
    from simulator_stub.world.robot import Robot
    from simulator_stub.world.world import World

Reading = TypeVar("Reading")


@dataclass(slots=True)  # not frozen: one is made in each cycle, and that takes twice as long
class Scene:
    """Surroundings of the sensors in a cycle, beside their own robot.

    Attributes
    ----------
    robots : sequence of Robot
        All robots that are not removed, after the move.
    time : int
        Simulated cycles so far.
    running : bool
        Whether this cycle is a running one: it selects the stream of random numbers.
    speakers : sequence of Robot
        The robots that say something in this cycle, in order of their ids, removed ones too.
    gps_offset : (float, float)
        Offset that the GPS adds to x and y, in units.
    """

    robots: Sequence[Robot]
    time: int
    running: bool
    speakers: Sequence[Robot] = ()
    gps_offset: tuple[float, float] = (0.0, 0.0)


class Sensor(ABC):
    """One kind of sensor on one robot.

    Subclasses set `name` and write `update` and `report`. `update` is called once in each cycle, in every
    state of the simulator, and draws its noise there; `report` fills in fields of `Measures`.

    Parameters
    ----------
    world : World
    robot : Robot
    noise : NoiseRoot
    """

    name: ClassVar[str]
    """Names the stream of random numbers; must not change, or recorded runs change."""

    def __init__(self, world: World, robot: Robot, noise: NoiseRoot) -> None:
        self.world = world
        self.noise: tuple[Stream, Stream] = streams(noise, robot.robot_id, self.name)

    @property
    def is_present(self) -> bool:
        """Whether the robot carries it at all; an absent one can still be requested."""
        return True

    @property
    def request_names(self) -> tuple[str, ...]:
        """Names in SensorRequests; empty if the sensor cannot be requested."""
        return ()

    @property
    def sent_always(self) -> bool:
        """Whether its reading is sent in every cycle, requested or not."""
        return False

    @abstractmethod
    def update(self, robot: Robot, scene: Scene) -> None:
        """Measure, and store the reading."""

    @abstractmethod
    def report(self, robot: Robot, fields: dict[str, Any]) -> None:
        """Add to the fields of this cycle's `Measures` what is to be sent."""

    def record(self, fields: dict[str, Any]) -> None:  # noqa: B027  # not every sensor is in the log
        """Add the log's fields of `Measures`: the reading, requested or not."""


class Delay(Generic[Reading]):
    """A first-in, first-out queue of readings: what comes out is `latency` cycles old.

    Parameters
    ----------
    latency : int
        Cycles, at least 0.
    empty : Reading
        Reading until the first one is old enough.
    """

    __slots__ = ("_queue",)

    def __init__(self, latency: int, empty: Reading) -> None:
        self._queue: deque[Reading] = deque([empty] * latency)

    def pass_through(self, reading: Reading) -> Reading:
        """Append a reading and return the oldest."""
        if not self._queue:
            return reading
        self._queue.append(reading)
        return self._queue.popleft()
