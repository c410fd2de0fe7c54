"""Walls as arrays: distances, lines of sight, nearest and visible faces, shortest paths, angles."""
