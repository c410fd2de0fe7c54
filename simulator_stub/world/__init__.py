"""What is simulated: the world, its robots and their states, motion and noise."""
