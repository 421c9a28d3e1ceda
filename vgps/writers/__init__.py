"""A Solution in, a file out: the run folder, and what a run is exported to."""
