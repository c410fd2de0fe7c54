"""Labs, start grids and parameters held against the schemas, and against what they mean together."""
