"""Questions that several rooms answer together."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.studies.fault_limits import Limit, Limits, limits
    from quakedesign.studies.objectives import FrontPoint, objective_front

__all__ = ["FrontPoint", "Limit", "Limits", "limits", "objective_front"]

face(__name__)
