"""How robots move and what stops them: wheel filter, pose update, collisions."""

__all__ = [
    "collisions",
    "kinematics",
]
