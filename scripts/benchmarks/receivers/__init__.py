"""Accuracy against the better of fixes and Gaussian, over recordings, receivers' errors and seeds."""
