"""Landmark database, its building from a run, and the tracker that localises a camera against it."""
