"""What there is: labs, start grids and parameters, as frozen records."""
