"""The agent: drives a robot from left to right through a known lab and works out in which cell it began."""
