"""The belief over poses: its lattice, how it moves and is reweighted, what it says."""
