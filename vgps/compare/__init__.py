"""Comparison of all GPS models on one recording with truth, as in the experiments of Kume 2010."""

from vgps.compare.methods import ALL_METHODS, METHODS, Comparison, Method, compare
from vgps.compare.page import check_outputs, comparison_to_json, write_comparison

__all__ = [
    "ALL_METHODS",
    "METHODS",
    "Comparison",
    "Method",
    "check_outputs",
    "compare",
    "comparison_to_json",
    "write_comparison",
]
