"""Slow sliding of a fault with rate-and-state friction, held by a law of samples: bounds for ever, proved."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.certificates.slow_sliding.cells import WHOLE as WHOLE
    from quakedesign.certificates.slow_sliding.cells import Cuts as Cuts
    from quakedesign.certificates.slow_sliding.cells import cells as cells
    from quakedesign.certificates.slow_sliding.cells import parts as parts
    from quakedesign.certificates.slow_sliding.fault_data import sliding_task as sliding_task
    from quakedesign.certificates.slow_sliding.small_gain import SlidingClaims as SlidingClaims
    from quakedesign.certificates.slow_sliding.small_gain import cell_bounds as cell_bounds
    from quakedesign.certificates.slow_sliding.statement import SlidingGuarantee as SlidingGuarantee
    from quakedesign.certificates.slow_sliding.task import SlidingTask as SlidingTask

face(__name__)
