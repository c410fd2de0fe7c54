"""Random labs of a course: made by the generator of ``ciberrato-lab new --random``, the same everywhere."""

from __future__ import annotations

import hashlib
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ciberrato.errors import CiberratoError
from ciberrato.grading.cache import cache_folder
from ciberrato.grading.fields import Fields
from ciberrato.labtool.making import Order, random_lab
from ciberrato.version import __version__


def random_files(table: Fields, position: int) -> tuple[Path, Path] | None:
    """Create the lab that an entry ``random = { ... }`` describes.

    Parameters
    ----------
    table : Fields
        The entry: ``seed``, and the options of ``ciberrato-lab new --random`` by their names.
    position : int
        Position of the robot in the start grid, which has at least as many.

    Returns
    -------
    lab, grid : Path
        In the cache; None if something is wrong, which is noted in the table's faults.
    """
    size = re.fullmatch(r"([0-9]{1,4})x([0-9]{1,4})", table.text("size", "14x7"))
    if size is None:
        table.fault("size: COLUMNSxROWS was expected, like 14x7")
    if not table.has("seed"):
        table.fault("seed: is missing; it says which lab it is")
    seed = table.number("seed", 0, least=0, most=2**63 - 1, whole=True)
    default = Order()
    shares = {
        name: table.number(name, getattr(default, name), least=0.0, most=1.0)
        for name in ("loops", "dead_ends", "polygons")
    }
    counts = {
        name: int(table.number(name, least, least=least, most=255, whole=True) or least)
        for name, least in (("starts", position), ("targets", 1))
    }
    symmetric = table.truth("symmetric")
    faults = table.count
    table.end()
    if size is None or table.count > faults or not table.has("seed"):
        return None
    values: dict[str, Any] = {**shares, **counts}
    order = Order(rows=int(size[2]), columns=int(size[1]), symmetric=symmetric, **values)
    text = f"{__version__} {sorted(asdict(order).items())} {seed}"
    place = cache_folder() / "labs" / hashlib.sha256(text.encode()).hexdigest()[:24]
    lab, grid = (place / f"random_{kind}.xml" for kind in ("lab", "grid"))
    if not (lab.is_file() and grid.is_file()):
        from ciberrato.files.atomic import replace_file

        try:
            made = random_lab(order, int(seed or 0))
            place.mkdir(parents=True, exist_ok=True)
            for path, contents in ((lab, made.lab_xml), (grid, made.grid_xml)):
                replace_file(path, contents.encode())
        except (CiberratoError, OSError) as error:
            table.fault(str(error))
            return None
    return lab, grid
