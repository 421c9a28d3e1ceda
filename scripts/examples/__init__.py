"""Patterns for programs of your own."""
