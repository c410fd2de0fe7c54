"""The simulated world, its robots and their states, motion and noise."""
