"""Figures, tables and pages from designs and runs."""

from quakedesign.arguments import check_arguments
from quakedesign.report.comparison import Comparison, compare
from quakedesign.report.headlines import headline
from quakedesign.studies.comparison import Entry

__all__ = ["Comparison", "Entry", "compare", "headline"]

check_arguments(__name__)
