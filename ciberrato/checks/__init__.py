"""Labs, start grids and parameters held against the schemas, and against what they mean together."""

__all__ = ["files", "free_space", "likeness", "schema", "telling", "things"]
