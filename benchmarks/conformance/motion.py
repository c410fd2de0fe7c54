"""Noise-free motion: filters, poses and collisions, cycle by cycle, against the real simulator's."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.conformance import Finding
from benchmarks.conformance.files import read_named_lab, table
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import distances_at, ideal_reading, other_robot_distance, round_reading
from ciberrato.physics.collisions import resolve_collisions, settle
from ciberrato.physics.kinematics import advance, clamp_power, filter_wheels
from ciberrato.protocol import DEFAULT_SENSOR_ANGLES
from ciberrato.world.coordinates import Pose

TOLERANCE = 1e-9
_AXES = tuple(angle / 180.0 * math.pi for angle in DEFAULT_SENSOR_ANGLES)
_MOTION = (
    ("left_in", "right_in"),
    ("left_out", "right_out"),
    ("x", "y", "dir_rad"),
    ("next_x", "next_y", "next_dir_rad"),
)
_IDEAL = ("ir0_ideal", "ir1_ideal", "ir2_ideal", "ir3_ideal")
_IR = ("ir0", "ir1", "ir2", "ir3")


def rows(golden: Path, labs: Path | None) -> Iterator[Finding]:
    """Yield the rows of this check."""
    scenarios = golden / "physics" / "scenarios.json"
    if not scenarios.is_file():
        yield Finding("motion", 0, None, True, "not recorded here")
        return
    content = json.loads(scenarios.read_text(encoding="utf-8"))
    yield from _traces(golden / "physics" / "direct", content, labs, _Direct)
    yield from _traces(golden / "physics" / "network", content, labs, _Network)
    yield from _noisy_motors(golden / "noise" / "m2_motor_direct_seed12345.csv.gz")


@dataclass(slots=True)
class Drive:
    """Robots driven by the rules of the library alone: motors, poses, collisions; no sensors, no noise.

    Attributes
    ----------
    walls : WallMap
    poses, wanted : list of (x, y, heading)
        Poses of the robots, and the poses that they would have without collisions.
    inputs, outputs : list of (left, right)
        Motor commands as clamped, and powers as filtered.
    wall, robot : list of bool
        Whether they collide in this cycle.
    collisions : list of int
        Number of collisions that began.
    """

    walls: WallMap
    poses: list[Pose]
    wanted: list[Pose] = field(init=False)
    inputs: list[tuple[float, float]] = field(init=False)
    outputs: list[tuple[float, float]] = field(init=False)
    wall: list[bool] = field(init=False)
    robot: list[bool] = field(init=False)
    collisions: list[int] = field(init=False)

    def __post_init__(self) -> None:
        count = len(self.poses)
        self.wanted = list(self.poses)
        self.inputs = [(0.0, 0.0)] * count
        self.outputs = [(0.0, 0.0)] * count
        self.wall, self.robot, self.collisions = [False] * count, [False] * count, [0] * count

    def step(self, commands: Sequence[tuple[float, float] | None]) -> None:
        """Advance by one cycle.

        Parameters
        ----------
        commands : sequence of (left, right) or None
            New commands of each robot; None = the old ones hold.
        """
        before = [wall or robot for wall, robot in zip(self.wall, self.robot, strict=True)]
        for number, command in enumerate(commands):
            if command is not None:
                self.inputs[number] = (clamp_power(command[0]), clamp_power(command[1]))
            left, right = self.outputs[number] = filter_wheels(self.inputs[number], self.outputs[number])
            self.wanted[number] = advance(*self.poses[number], left, right)
        speeds = [(left + right) / 2.0 for left, right in self.outputs]
        self.wall, self.robot = resolve_collisions(self.walls, self.poses, self.wanted, speeds)
        for number, began in enumerate(before):
            collides = self.wall[number] or self.robot[number]
            self.poses[number] = settle(self.poses[number], self.wanted[number], collides)
            self.collisions[number] += collides and not began

    def ideal_readings(self, number: int) -> list[float]:
        """Compute the IR readings of a robot before noise and rounding."""
        x, y, heading = self.poses[number]
        directions = [heading + axis for axis in _AXES]
        distances = distances_at(self.walls, x, y, directions)
        for other, (other_x, other_y, _) in enumerate(self.poses):
            if other != number:
                distances = [
                    min(distance, other_robot_distance(x, y, direction, other_x, other_y))
                    for distance, direction in zip(distances, directions, strict=True)
                ]
        return [ideal_reading(distance) for distance in distances]


@dataclass(slots=True)
class _Comparison:
    """Collects what one trace shows."""

    rows: int = 0
    difference: float = 0.0
    infrared: float = 0.0
    collisions: int = 0
    unlike: int = 0
    first: str = ""

    def note_first(self, place: str) -> None:
        self.unlike += 1
        self.first = self.first or place


class _Direct:
    """Traces in full precision."""

    folder = "direct"
    tolerance = TOLERANCE

    @staticmethod
    def compare(drive: Drive, number: int, row: dict[str, str], found: _Comparison, place: str) -> None:
        ours = (drive.inputs[number], drive.outputs[number], drive.poses[number], drive.wanted[number])
        difference = max(
            abs(value - float(row[column]))
            for values, columns in zip(ours, _MOTION, strict=True)
            for value, column in zip(values, columns, strict=True)
        )
        x, y, _ = drive.wanted[number]
        distance = float(drive.walls.distance(x, y))
        difference = max(difference, abs(distance - float(row["wall_distance_at_next"])))
        found.difference = max(found.difference, difference)
        ideal = drive.ideal_readings(number)
        infrared = max(abs(value - float(row[column])) for value, column in zip(ideal, _IDEAL, strict=True))
        found.infrared = max(found.infrared, infrared)
        rounded = [round_reading(value) for value in ideal]
        flags = (drive.wall[number], drive.robot[number], drive.collisions[number])
        if (
            difference > TOLERANCE
            or infrared > TOLERANCE
            or flags != (row["collide_wall"] == "1", row["collide_robot"] == "1", int(row["collisions"]))
            or rounded != [float(row[column]) for column in _IR]
        ):
            found.note_first(place)


class _Network:
    """Traces over the network: six significant digits, which must be the same text."""

    folder = "network"
    tolerance = 0.0

    @staticmethod
    def compare(drive: Drive, number: int, row: dict[str, str], found: _Comparison, place: str) -> None:
        x, y, heading = drive.poses[number]
        collides = drive.wall[number] or drive.robot[number]
        ours = [f"{value:g}" for value in (x, y, heading * 180.0 / math.pi)]
        ours += [str(collides), str(drive.collisions[number]), "Yes" if collides else "No"]
        ours += [f"{round_reading(value):g}" for value in drive.ideal_readings(number)]
        columns = ("x", "y", "dir_deg", "collision", "collisions", "m_collision", *_IR)
        if ours != [row[column] for column in columns]:
            found.note_first(place)


def _traces(
    folder: Path, scenarios: dict[str, dict[str, object]], labs: Path | None, kind: type[_Direct | _Network]
) -> Iterator[Finding]:
    found = _Comparison()
    driven = missing = 0
    for name, scenario in scenarios.items():
        path = folder / f"{name}.csv.gz"
        if not path.is_file():
            continue
        lab = read_named_lab(str(scenario["lab"]), labs)
        if lab is None:
            missing += 1
            continue
        driven += 1
        _follow(name, WallMap.from_lab(lab), scenario["start_poses_x_y_dirdeg"], table(path), found, kind)
    note = f"{driven} scenarios, {found.collisions} collisions"
    note += f"; {missing} whose labs are not here" if missing else ""
    note += f"; {found.unlike} rows unlike, first {found.first}" if found.first else ""
    check = f"motion: {kind.folder}"
    if kind is _Direct:
        yield Finding(check, found.rows, found.difference, found.unlike == 0, note)
        yield Finding(
            f"infrared: {kind.folder} traces",
            4 * found.rows,
            found.infrared,
            found.infrared <= TOLERANCE,
            "1/distance on the way, other robots included",
        )
    else:
        yield Finding(check, found.rows, None, found.unlike == 0, note + "; text as sent: pose, flags, IR")


def _follow(
    name: str,
    walls: WallMap,
    starts: object,
    trace: list[dict[str, str]],
    found: _Comparison,
    kind: type[_Direct | _Network],
) -> None:
    assert isinstance(starts, list)
    drive = Drive(walls=walls, poses=[(x, y, math.radians(direction)) for x, y, direction in starts])
    count = len(starts)
    for cycle in range(0, len(trace), count):
        now = trace[cycle : cycle + count]
        if cycle > 0:
            drive.step(
                [
                    (float(row["left_cmd"]), float(row["right_cmd"])) if row["left_cmd"] else None
                    for row in now
                ]
            )
        for number, row in enumerate(now):
            found.rows += 1
            kind.compare(drive, number, row, found, f"{name}, time {row['time']}, robot {number + 1}")
    found.collisions += sum(drive.collisions)


def _noisy_motors(path: Path) -> Iterator[Finding]:
    """Check that the pose follows from the noisy powers as recorded; the noise itself does not matter."""
    check = "motion: noisy motors"
    if not path.is_file():
        yield Finding(check, 0, None, True, "not recorded here")
        return
    pose: Pose | None = None
    difference = 0.0
    trace = table(path)
    for row in trace:
        here = (float(row["x"]), float(row["y"]), float(row["dir_rad"]))
        if pose is not None:
            pose = advance(*pose, float(row["left_out"]), float(row["right_out"]))
            difference = max(difference, *(abs(a - b) for a, b in zip(pose, here, strict=True)))
        else:
            pose = here
    yield Finding(check, len(trace), difference, difference <= TOLERANCE, "poses from the recorded powers")
