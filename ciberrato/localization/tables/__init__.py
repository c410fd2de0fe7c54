"""Expected IR readings at every pose of a lattice: tables, their cache, and the process that builds them."""
