"""Every GPS model side by side on one recording with truth, as in the experiments of Kume 2010."""

from vgps.compare.methods import METHODS, Comparison, Method, compare
from vgps.compare.page import as_json, write_comparison

__all__ = ["METHODS", "Comparison", "Method", "as_json", "compare", "write_comparison"]
