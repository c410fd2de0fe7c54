"""The IR sensor: its model, and the distance to the nearest wall in its cone.

The distance has one reference and four faster variants. All follow the rule of `model.sensor_distances` (the
nearest point of a wall within 30 degrees of the axis, by the rays on the two edges and the axis, and
corners). Tests hold `cone_scalar`, `cone_arrays` and `cone_compiled` equal to the last bit, `cone_pairs` and
`sweep` to them within rounding (1e-12), and all of them against recordings of the real simulator.

==================  =========================================================================================
module              what it is for
==================  =========================================================================================
`on_face`           the real simulator's own arithmetic, angle by angle: decides where a sensor is on a wall
`cone_pairs`        the reference for arrays: any places, no index needed (expected readings of a lab's cells)
`cone_scalar`       one robot, plain Python over `ciberrato.geometry.visible_faces` (a simulation's step)
`cone_arrays`       many robots at once, numpy over `face_tables` (the batch without numba, particles)
`cone_compiled`     the same in machine code by numba, for loops that call it (the batch, the pose filter)
`sweep`             evenly spaced directions at all places of a lattice (tables of the pose filter)
`sweep_plan`        what `sweep` prepares: faces turned into all directions, what a tile of places can see
==================  =========================================================================================
"""

__all__ = [
    "cone_arrays",
    "cone_compiled",
    "cone_pairs",
    "cone_scalar",
    "face_tables",
    "model",
    "on_face",
    "sweep",
    "sweep_plan",
]
