"""A headless, seeded CiberRato simulator that speaks the wire protocol of the real one."""
