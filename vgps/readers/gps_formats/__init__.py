"""Formats of GPS logs: each module reads one into a ``RawLog``, which ``fixes.py`` defines."""
