"""Figures, tables and pages from designs and runs."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.report.comparison_table import Comparison as Comparison
    from quakedesign.report.comparison_table import compare as compare
    from quakedesign.report.figures import stability_map as stability_map
    from quakedesign.report.gain_map_drawing import gain_map_figure as gain_map_figure
    from quakedesign.report.identification_page import identification_figure as identification_figure
    from quakedesign.report.limits_table import limits_lines as limits_lines
    from quakedesign.report.plain import scale_lines as scale_lines
    from quakedesign.report.sentences import headline as headline
    from quakedesign.report.sentences import verdict_lines as verdict_lines
    from quakedesign.studies.comparison import Entry as Entry

face(__name__)
