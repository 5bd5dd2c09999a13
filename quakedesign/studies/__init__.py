"""Questions that several rooms answer together."""

from quakedesign.arguments import check_arguments
from quakedesign.studies.fault_limits import Limit, Limits, limits
from quakedesign.studies.objectives import FrontPoint, objective_front

__all__ = ["FrontPoint", "Limit", "Limits", "limits", "objective_front"]

check_arguments(__name__)
