"""Measurements, experiments and tools around vgps; README.md lists them by the question they answer."""
