"""Figures of the paper from the runs that they need."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

from quakedesign.report.comparison import Comparison
from quakedesign.report.paper_figures import paper_figures
from quakedesign.studies.paper_study import PaperRuns, paper_runs


class PaperStudy(PaperRuns):
    """Runs of all figures, see `PaperRuns`, and the figures themselves."""

    comparison: Comparison

    def figures(self) -> dict[str, Any]:
        """Matplotlib figures by name, drawn once."""
        return self._drawn

    @cached_property
    def _drawn(self) -> dict[str, Any]:
        return paper_figures(self)


def paper_study(comparison: Comparison, *, progress: Callable[[str, float], None] | None = None) -> PaperStudy:
    """Make the short runs that the figures of the paper need beside a comparison; see `paper_runs`."""
    return PaperStudy(**vars(paper_runs(comparison, progress=progress)))
