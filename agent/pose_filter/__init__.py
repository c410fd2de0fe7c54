"""Where the robot is and where it looks: a histogram filter over (x, y, heading), run while it drives."""
