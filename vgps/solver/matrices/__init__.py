"""The reduced camera system as a matrix: banded, in blocks, or in submaps on disk."""
