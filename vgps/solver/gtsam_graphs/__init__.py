"""Graphs of GTSAM made of a bundle problem, and read as one."""
