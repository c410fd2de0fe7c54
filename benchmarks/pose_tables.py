"""The pose filter's tables of a lab, computed in this process and by the process that serves an agent.

The plain reference is a sweep of one direction at a time, every face for every sensor in it, and the corners
tile by tile. Times are CPU time of one core; those of the other process are its own, its start
and imports included.
"""

from __future__ import annotations

import math
import os
import resource
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.measure import Row
from ciberrato.arrays import Floats
from ciberrato.files.lab import read_lab
from ciberrato.geometry.walls import WallMap
from ciberrato.infrared.model import HALF_APERTURE, SENSOR_OFFSET
from ciberrato.labs import find_lab
from ciberrato.localization.belief import compiled
from ciberrato.localization.tables.pose_tables import BINS, COARSE, FINE, build_tables
from ciberrato.localization.tables.reading_codes import encode
from ciberrato.localization.tables.worker import TableWorker
from ciberrato.world.lab import Lab

LABS = ("standard", "maze", "diagonals")
ANGLES = (0.0, 60.0, -60.0, 180.0)
_ROUNDS = 3
_TOUCH = 1e-9
_TARGETS = {"coarse": 0.3, "fine": 1.0}


def rows() -> Iterator[Row]:
    """Yield a row for every lab, lattice and kind of loops; rounds of all kinds take turns."""
    has_numba = compiled.load()
    loops = compiled.kernels()
    for name in LABS:
        lab = read_lab(find_lab(name))
        walls = WallMap.from_lab(lab)
        for which, resolution in (("coarse", COARSE), ("fine", FINE)):
            group = f"pose tables, {name}, {which}"
            compiled.use(None)
            tables = build_tables(lab, ANGLES, resolution)
            places = tables.lattice.representative
            best = dict.fromkeys(("plain", "numpy", "numba"), math.inf)
            for _ in range(_ROUNDS):
                best["plain"] = min(best["plain"], _time(partial(_plain_codes, walls, places)))
                for kind in ("numpy", "numba") if has_numba else ("numpy",):
                    compiled.use(loops if kind == "numba" else None)
                    seconds = _time(partial(_all_tables, lab, resolution))
                    best[kind] = min(best[kind], seconds)
            same = np.array_equal(encode(plain(walls, places)), tables.codes[0][: 2 * BINS])
            note = f"distances and codes only; codes {'equal' if same else 'NOT equal'}"
            yield Row(group=group, who="plain reference", seconds=best["plain"], reference=True, note=note)
            target = _TARGETS[which]
            size = sum(codes.nbytes for codes in tables.codes) / 1e6
            yield Row(
                group=group, who="numpy", seconds=best["numpy"], ours=True, megabytes=size, target=target
            )
            if has_numba:
                yield Row(group=group, who="numba", seconds=best["numba"], ours=True, target=target / 4.0)
            else:
                yield Row(group=group, who="numba", seconds=None, note="skipped: pip install numba")
    yield from _other_process()


def _other_process() -> Iterator[Row]:
    os.environ[compiled.VARIABLE] = "off"
    for name in LABS:
        with tempfile.TemporaryDirectory() as folder:
            worker = TableWorker(read_lab(find_lab(name)), ANGLES, folder=Path(folder))
            before = _children()
            worker.start()
            worker.wait()
            worker.join()
            note = ", ".join(f"{which} after {seconds:.2f} s" for which, seconds in worker.seconds.items())
            yield Row(
                group=f"pose tables, {name}, both, by another process from its start on",
                who="numpy",
                seconds=_children() - before,
                ours=True,
                megabytes=worker.megabytes,
                note=f"by the clock: {note}",
            )
    del os.environ[compiled.VARIABLE]


def _plain_codes(walls: WallMap, places: Floats) -> None:
    encode(plain(walls, places))


def _all_tables(lab: Lab, resolution: float) -> None:
    build_tables(lab, ANGLES, resolution).complete(lab)


def _children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _time(work: Callable[[], object]) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


def plain(walls: WallMap, places: Floats) -> Floats:
    """Compute what `ciberrato.infrared.sweep.tabulate_distances` does, direction by direction."""
    count = 2 * BINS
    table = np.full((count, len(places)), np.inf)
    angles = np.arange(count) * (2.0 * math.pi / count)
    for row, axis in zip(table, angles, strict=True):
        sensors = places + SENSOR_OFFSET * np.array([math.cos(axis), math.sin(axis)])
        for turn in (0.0, HALF_APERTURE, -HALF_APERTURE):
            np.minimum(row, _rays(walls, sensors, axis + turn), out=row)
    _apply_corners(walls, places, angles, table)
    return table


def _rays(walls: WallMap, sensors: Floats, direction: float) -> Floats:
    ray = np.array([math.cos(direction), math.sin(direction)])
    normal = np.array([-ray[1], ray[0]])
    along, across = sensors @ ray, sensors @ normal
    order = np.argsort(across, kind="stable")
    along, across = along[order], across[order]
    start_u, start_v = walls.start @ ray, walls.start @ normal
    rise = walls.end @ normal - start_v
    slope = (walls.end @ ray - start_u) / np.where(rise == 0.0, 1.0, rise)
    low = np.searchsorted(across, np.minimum(start_v, start_v + rise) - _TOUCH)
    high = np.searchsorted(across, np.maximum(start_v, start_v + rise) + _TOUCH, side="right")
    best = np.full(len(sensors), np.inf)
    for face in np.flatnonzero((np.abs(rise) > _TOUCH * walls.length) & (low < high)):
        run = slice(low[face], high[face])
        reach = start_u[face] - start_v[face] * slope[face] + across[run] * slope[face] - along[run]
        reach[reach < -_TOUCH] = np.inf
        np.minimum(best[run], reach, out=best[run])
    result = np.empty_like(best)
    result[order] = np.maximum(best, 0.0)
    return result


def _apply_corners(walls: WallMap, places: Floats, directions: Floats, table: Floats) -> None:
    offset = SENSOR_OFFSET * np.stack([np.cos(directions), np.sin(directions)])[..., np.newaxis]
    cosine, sine = np.cos(directions)[:, np.newaxis], np.sin(directions)[:, np.newaxis]
    tangent = math.tan(HALF_APERTURE)
    corners = np.unique(walls.start, axis=0)
    tile = np.floor(places).astype(np.int64)
    for key in np.unique(tile, axis=0):
        some = np.flatnonzero((tile == key).all(axis=1))
        reach = table[:, some].max() + SENSOR_OFFSET + math.sqrt(0.5) + 1e-6
        for x, y in corners[np.hypot(*(corners - key - 0.5).T) <= reach]:
            dx, dy = x - places[some, 0] - offset[0], y - places[some, 1] - offset[1]
            distance = np.sqrt(dx * dx + dy * dy)
            beside = np.abs(dy * cosine - dx * sine) > (dx * cosine + dy * sine) * tangent + _TOUCH
            distance[beside] = np.inf
            table[:, some] = np.minimum(table[:, some], distance)
