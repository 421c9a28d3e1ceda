"""GPS fixes: their regions, errors and outliers, the time offset of their clock, and the verdict on each."""
