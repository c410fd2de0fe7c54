"""How robots move and what stops them: wheel filter, pose update, collisions."""
