"""Figures, tables and pages from designs and runs."""

from quakedesign.arguments import check_arguments
from quakedesign.studies.comparison import Comparison, Entry, compare, headline

__all__ = ["Comparison", "Entry", "compare", "headline"]

check_arguments(__name__)
