"""Documents: one module each, readers and writers."""

__all__ = [
    "atomic",
    "beliefs",
    "lab",
    "map_scores",
    "parameters",
    "row_pattern",
    "run_log",
    "run_records",
    "simulator_log",
    "start_grid",
    "truth",
    "xml",
]
