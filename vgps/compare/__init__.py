"""Every GPS model side by side on one recording with truth, as in the experiments of Kume 2010."""

from vgps.compare.methods import METHODS, Comparison, Method, compare
from vgps.compare.page import as_json, check_outputs, write_comparison

__all__ = ["METHODS", "Comparison", "Method", "as_json", "check_outputs", "compare", "write_comparison"]
