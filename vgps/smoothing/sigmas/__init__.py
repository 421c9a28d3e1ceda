"""Standard deviations of the poses."""
