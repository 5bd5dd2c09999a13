"""Questions that several rooms answer together."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.studies.comparison import Entry as Entry
    from quakedesign.studies.paper import FrontPoint as FrontPoint
    from quakedesign.studies.paper import objective_front as objective_front
    from quakedesign.studies.performance_limits import Limit as Limit
    from quakedesign.studies.performance_limits import Limits as Limits
    from quakedesign.studies.performance_limits import limits as limits

face(__name__)
