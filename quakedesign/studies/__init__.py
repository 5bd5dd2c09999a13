"""Questions that several rooms answer together."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.studies.fundamental_limits import Limit as Limit
    from quakedesign.studies.fundamental_limits import Limits as Limits
    from quakedesign.studies.impossible_and_proved import limits as limits
    from quakedesign.studies.peak_against_tracking import FrontPoint as FrontPoint
    from quakedesign.studies.peak_against_tracking import objective_front as objective_front

face(__name__)
