"""Small helpers for recordings, runs and notebooks."""
