"""Stage D, Kume 2010: everything optimised at once."""
