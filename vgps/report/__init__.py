"""A run as one HTML page: warnings first, then the result, then the evidence for it.

The page needs no other file and no network. Its size is bounded: long runs are plotted as pixels, and long
tables end with a reference to ``gps.csv``.
"""

from vgps.report.page import write_report

__all__ = ["write_report"]
