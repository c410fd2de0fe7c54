"""The full-pose filter: position and heading in any lab, from any start, while the robot drives."""
