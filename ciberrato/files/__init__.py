"""Documents: one module each, readers and writers."""

__all__ = [
    "atomic",
    "beliefs",
    "findings",
    "lab",
    "map_scores",
    "parameters",
    "row_findings",
    "row_pattern",
    "run_log",
    "run_records",
    "simulator_log",
    "start_grid",
    "truth",
    "vocabulary",
    "xml",
    "xml_document",
]
