"""Walls as arrays: distances, lines of sight, nearest and visible faces, shortest paths, angles."""

__all__ = [
    "angles",
    "nearest_faces",
    "shortest_paths",
    "visible_faces",
    "walls",
]
