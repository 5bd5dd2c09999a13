"""Figures, tables and pages from designs and runs."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.report.comparison import Comparison, compare
    from quakedesign.report.headlines import headline
    from quakedesign.studies.comparison import Entry

__all__ = ["Comparison", "Entry", "compare", "headline"]

face(__name__)
