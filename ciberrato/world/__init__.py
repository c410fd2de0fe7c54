"""Labs, start grids and parameters, as frozen records."""

__all__ = [
    "coordinates",
    "lab",
    "parameter_names",
    "parameters",
    "start_grid",
]
