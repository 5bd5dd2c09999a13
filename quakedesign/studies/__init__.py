"""Questions that several rooms answer together."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.studies.fault_limits import Limit as Limit
    from quakedesign.studies.fault_limits import Limits as Limits
    from quakedesign.studies.fault_limits import limits as limits
    from quakedesign.studies.objectives import FrontPoint as FrontPoint
    from quakedesign.studies.objectives import objective_front as objective_front

face(__name__)
