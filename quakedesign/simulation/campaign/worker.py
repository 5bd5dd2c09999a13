"""What runs in a worker: one batch of samples, in slices, so that it can be interrupted."""

import numpy as np

from quakedesign.simulation.campaign.program import Program, mover

SLICE = 200_000  # steps of all samples together in one call of compiled code, which is deaf: a fraction of a second


def advance(program: Program, starts: "np.ndarray", steps: int) -> "np.ndarray":
    """Vectors after a number of steps, one a row; a sample that diverges ends there.

    Parameters
    ----------
    program : Program
    starts : ndarray
        Shape (samples, size).
    steps : int
    """
    move = mover(program)
    vectors = np.array(starts, dtype=np.float64, order="C", ndmin=2)
    slice_ = max(1, SLICE // len(vectors))
    for taken in range(0, steps, slice_):
        move(vectors, min(slice_, steps - taken))
    return vectors
