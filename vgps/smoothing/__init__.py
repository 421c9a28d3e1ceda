"""Stages C and D of Kume 2010: the map and the GPS fixes in one energy, over a window and over everything."""
