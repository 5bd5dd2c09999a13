"""Eigenvalues of sampled laws and loops, in floats: how they move by themselves."""

import numpy as np
from scipy.linalg import expm

from quakedesign.loop import LinearLaw, PeriodicLoop

PERIODS = 64
"""Of a course of an adversary, at least."""
_MOST_PERIODS = 512
_FORGOTTEN = 100  # a course is over when what was at first is down to the hundredth part


def own_poles(law: LinearLaw) -> np.ndarray:
    """Eigenvalues of F, the integral's first: of the law by itself, as it is while friction holds the fault."""
    poles = np.linalg.eigvals(np.array(law.update, dtype=float).reshape((len(law.states),) * 2))
    return np.asarray(poles[np.argsort(np.abs(poles - 1), kind="stable")])


def moved(flow: np.ndarray, inputs: np.ndarray, length: float) -> tuple[np.ndarray, np.ndarray]:
    """e^{Ah}, and what inputs (columns) add that are held over a time h [s]."""
    size, count = inputs.shape
    whole = np.zeros((size + count, size + count))
    whole[:size, :size], whole[:size, size:] = flow, inputs
    found = np.asarray(expm(whole * length))
    return found[:size, :size], found[:size, size:]


def periods_to_forget(radius: float) -> int:
    """How many periods a loop remembers that leaves a share of what was: until a hundredth is left, within limits."""
    pace = -np.log(np.clip(radius, 1e-9, 1 - 1e-9))
    return int(np.clip(np.ceil(np.log(_FORGOTTEN) / pace), PERIODS, _MOST_PERIODS))


def spectral_radius(loop: PeriodicLoop) -> float:
    """Largest size of an eigenvalue of a period."""
    flow, period = np.array(loop.flow, dtype=float), np.eye(len(loop.flow))
    for part in loop.segments:
        period = expm(flow * float(part.duration)) @ np.array(part.jump, dtype=float) @ period
    return float(max(abs(np.linalg.eigvals(period))))
