"""Peaks of the loop that runs, proved: `task` reads the fault, `norms` the loop, `theorem` joins them."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.certificates.guarantee.claims import Claims as Claims
    from quakedesign.certificates.guarantee.continuous import ContinuousPeaks as ContinuousPeaks
    from quakedesign.certificates.guarantee.continuous import continuous_peaks as continuous_peaks
    from quakedesign.certificates.guarantee.fault_data import task_of as task_of
    from quakedesign.certificates.guarantee.files import guarantee_document as guarantee_document
    from quakedesign.certificates.guarantee.files import read_guarantee as read_guarantee
    from quakedesign.certificates.guarantee.held import Held as Held
    from quakedesign.certificates.guarantee.slow_gain import SlowGain as SlowGain
    from quakedesign.certificates.guarantee.small_gain import Bounds as Bounds
    from quakedesign.certificates.guarantee.small_gain import NoGuarantee as NoGuarantee
    from quakedesign.certificates.guarantee.small_gain import certified_bounds as certified_bounds
    from quakedesign.certificates.guarantee.statement import Guarantee as Guarantee
    from quakedesign.certificates.guarantee.statement import guarantee as guarantee
    from quakedesign.certificates.guarantee.task import Task as Task

face(__name__)
