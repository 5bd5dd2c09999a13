"""Questions that several rooms answer together."""

from quakedesign.arguments import check_arguments
from quakedesign.studies.fault_limits import Limit, Limits, limits

__all__ = ["Limit", "Limits", "limits"]

check_arguments(__name__)
