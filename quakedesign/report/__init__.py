"""Figures, tables and pages from designs and runs."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.report.comparison_table import Comparison as Comparison
    from quakedesign.report.comparison_table import compare as compare
    from quakedesign.report.sentences import headline as headline
    from quakedesign.studies.comparison import Entry as Entry

face(__name__)
