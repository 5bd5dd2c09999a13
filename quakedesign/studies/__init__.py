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
    from quakedesign.studies.runs import natural_run as natural_run
    from quakedesign.studies.scaling import scale_answer as scale_answer

face(__name__)
