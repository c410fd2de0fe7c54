"""What the robots of a batch are told."""

from __future__ import annotations

from dataclasses import dataclass

from ciberrato.arrays import Booleans, Floats, Integers


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchReadings:
    """The readings of one cycle, world by world.

    Attributes
    ----------
    time : array of int, shape (worlds,)
        Simulated cycles so far in each world.
    over : array of bool, shape (worlds,)
        Where SimTime is reached: the robot stands still from then on, and its sensors go on.
    infrared : array, shape (worlds, 4)
        Readings of the IR sensors, about 1/distance.
    compass : array, shape (worlds,)
        Degrees.
    ground : array of int, shape (worlds,)
        Number of the target that the robot is in, -1 for none.
    collision : array of bool, shape (worlds,)
    line : array of bool, shape (worlds, 7), or None
        Elements of the line sensor, leftmost first; None if the batch has none.
    gps : array, shape (worlds, 2), or None
        x and y with an offset, in units; None if the parameters give no GPS.
    beacons : array, shape (worlds, beacons), or None
        Bearings in degrees, nan where a beacon is hidden, and behind those that the world's lab has; None if
        the parameters give no sensors for them.
    score : array of int, shape (worlds,), or None
        After this cycle has been counted; None if the batch counts none.
    """

    time: Integers
    over: Booleans
    infrared: Floats
    compass: Floats
    ground: Integers
    collision: Booleans
    line: Booleans | None = None
    gps: Floats | None = None
    beacons: Floats | None = None
    score: Integers | None = None
