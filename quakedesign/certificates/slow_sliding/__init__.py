"""Slow sliding of a fault with rate-and-state friction, held by a law of samples: bounds for ever, proved."""

from typing import TYPE_CHECKING

from quakedesign.faces import face

if TYPE_CHECKING:
    from quakedesign.certificates.slow_sliding.cells import WHOLE, Cuts, cells, parts
    from quakedesign.certificates.slow_sliding.files import (
        parse_sliding,
        read_sliding,
        save_sliding,
        sliding_text,
    )
    from quakedesign.certificates.slow_sliding.statement import SlidingGuarantee
    from quakedesign.certificates.slow_sliding.task import SlidingTask, sliding_task
    from quakedesign.certificates.slow_sliding.theorem import SlidingClaims, cell_bounds

__all__ = [
    "WHOLE",
    "Cuts",
    "SlidingClaims",
    "SlidingGuarantee",
    "SlidingTask",
    "cell_bounds",
    "cells",
    "parse_sliding",
    "parts",
    "read_sliding",
    "save_sliding",
    "sliding_task",
    "sliding_text",
]

face(__name__)
