"""Peaks of the loop that runs, proved: `task` reads the fault, `norms` the loop, `theorem` joins them."""

from quakedesign.arguments import check_arguments
from quakedesign.certificates.guarantee.continuous import ContinuousPeaks, continuous_peaks
from quakedesign.certificates.guarantee.statement import Claims, Guarantee, Held, guarantee
from quakedesign.certificates.guarantee.task import Task, task_of
from quakedesign.certificates.guarantee.theorem import Bounds, NoGuarantee, certified_bounds

__all__ = [
    "Bounds",
    "Claims",
    "ContinuousPeaks",
    "Guarantee",
    "Held",
    "NoGuarantee",
    "Task",
    "certified_bounds",
    "continuous_peaks",
    "guarantee",
    "task_of",
]

check_arguments(__name__)
