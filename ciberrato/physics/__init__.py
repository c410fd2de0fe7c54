"""Motion of robots and its limits: wheel filter, pose update, collisions."""

__all__ = [
    "collisions",
    "kinematics",
]
