"""What runs in a worker: one batch of samples, in slices, so that it can be stopped."""

import os
import signal
from multiprocessing import parent_process
from threading import Thread
from typing import TYPE_CHECKING, Any

from quakedesign.errors import SimulationError
from quakedesign.simulation.campaign.program import Program, mover

if TYPE_CHECKING:
    import numpy as np

SLICE = 200_000  # steps of all samples together between two looks at the stop sign: a fraction of a second

_stop: Any = None


def advance(program: Program, starts: "np.ndarray", steps: int) -> "np.ndarray":
    """Vectors after a number of steps, one a row; a sample that diverges ends there.

    Parameters
    ----------
    program : Program
    starts : ndarray
        Shape (samples, size).
    steps : int

    Raises
    ------
    SimulationError
        When the campaign has been interrupted.
    """
    import numpy as np

    move = mover(program)
    vectors = np.array(starts, dtype=np.float64, order="C", ndmin=2)
    slice_ = max(1, SLICE // len(vectors))
    for taken in range(0, steps, slice_):
        if _stop is not None and _stop.is_set():
            raise SimulationError("the campaign must go on. Received an interruption. Run it again to resume.")
        move(vectors, min(slice_, steps - taken))
    return vectors


def enlist(stop: Any) -> None:
    """Prepare a process of a pool: the parent handles Ctrl-C, and nobody survives the parent.

    Parameters
    ----------
    stop : multiprocessing.Event
        Set by the parent to end unfinished batches.
    """
    global _stop
    _stop = stop
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_follow_parent, daemon=True).start()


def _follow_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
