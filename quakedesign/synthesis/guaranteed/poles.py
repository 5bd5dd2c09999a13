"""Eigenvalues of sampled laws and loops, in floats: how they move by themselves."""

import numpy as np
from scipy.linalg import expm

from quakedesign.loop import LinearLaw, PeriodicLoop


def own_poles(law: LinearLaw) -> np.ndarray:
    """Eigenvalues of F, the integral's first: of the law by itself, as it is while friction holds the fault."""
    poles = np.linalg.eigvals(np.array(law.update, dtype=float).reshape((len(law.states),) * 2))
    return np.asarray(poles[np.argsort(np.abs(poles - 1), kind="stable")])


def spectral_radius(loop: PeriodicLoop) -> float:
    """Largest size of an eigenvalue of a period."""
    flow, period = np.array(loop.flow, dtype=float), np.eye(len(loop.flow))
    for part in loop.segments:
        period = expm(flow * float(part.duration)) @ np.array(part.jump, dtype=float) @ period
    return float(max(abs(np.linalg.eigvals(period))))
