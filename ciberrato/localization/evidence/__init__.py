"""Evidence of the other sensors and the start: compass, collisions, ground, GPS, beacons, symmetry, start."""
