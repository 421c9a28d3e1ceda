"""Damaged files for readers."""
