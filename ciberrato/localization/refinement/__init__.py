"""Particles that track a known pose finer than the lattice does."""
