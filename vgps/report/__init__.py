"""A run as one HTML page for people: what came out, how far to trust it, and why."""

from vgps.report.page import write_report

__all__ = ["write_report"]
