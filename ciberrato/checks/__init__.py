"""Labs, start grids and parameters held against the schemas, and against what they mean together."""

__all__ = ["equal_places", "files", "free_space", "likeness", "schema", "telling", "things"]
