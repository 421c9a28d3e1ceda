"""Experiments of the papers, and what settings, faults and recordings change."""
