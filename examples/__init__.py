"""The classic localization problems, each solved with `ciberrato.bayes`, with numbers and figures.

`python -m examples` lists them.
"""

from __future__ import annotations

PROBLEMS = {
    "grid": "examples.ciberrato_grid",
    "lecture": "examples.lecture",
    "road": "examples.road",
    "hallway": "examples.hallway",
    "poses": "examples.pose_grid",
    "museum": "examples.museum",
}
"""Name on the command line: module, with `TITLE` and `run(output, seed)`, which prints and writes figures."""
