"""Faults of a GPS receiver against GPS models."""
