"""Progress, time per stage, threads and memory: what every run needs besides the method."""
