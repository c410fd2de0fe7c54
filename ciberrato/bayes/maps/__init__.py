"""Maps in which ranges can be computed: occupancy grids and line segments."""
