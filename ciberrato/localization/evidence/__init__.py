"""What the other sensors and the start say: compass, collisions, ground, GPS, beacons, symmetry, start."""
