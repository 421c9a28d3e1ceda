"""Stages A and B of Kume 2010: pose each frame by its features, and map the features."""
