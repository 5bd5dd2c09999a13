"""Figures, tables and pages from designs and runs."""

from quakedesign.report.comparison import Comparison, Entry, compare, headline

__all__ = ["Comparison", "Entry", "compare", "headline"]
