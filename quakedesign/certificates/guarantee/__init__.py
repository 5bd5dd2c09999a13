"""Peaks of the loop that runs, proved: `task` reads the fault, `norms` the loop, `theorem` joins them."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.certificates.guarantee.continuous import ContinuousPeaks, continuous_peaks
    from quakedesign.certificates.guarantee.fault_data import task_of
    from quakedesign.certificates.guarantee.files import read_guarantee
    from quakedesign.certificates.guarantee.slow_gain import SlowGain
    from quakedesign.certificates.guarantee.statement import Claims, Guarantee, Held, guarantee
    from quakedesign.certificates.guarantee.task import Task
    from quakedesign.certificates.guarantee.theorem import Bounds, NoGuarantee, certified_bounds

__all__ = [
    "Bounds",
    "Claims",
    "ContinuousPeaks",
    "Guarantee",
    "Held",
    "NoGuarantee",
    "SlowGain",
    "Task",
    "certified_bounds",
    "continuous_peaks",
    "guarantee",
    "read_guarantee",
    "task_of",
]

face(__name__)
