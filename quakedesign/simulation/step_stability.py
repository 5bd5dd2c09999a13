"""Whether a fixed step is short enough for a linear loop."""

from collections.abc import Iterable

from quakedesign.simulation.integrators import integrator


def amplification(poles: Iterable[complex], step: float, method: str = "dormand-prince") -> float:
    """Growth per step of the fastest growing mode [-] for poles [1/s] and a step [s]; below 1 is stable.

    For the scheme ``continuous``, where the law is part of the integrated field. A sampled law needs another test.
    """
    advance = integrator(method).advance

    def growth(pole: complex) -> float:
        return float(abs(advance(lambda _, x: pole * x, 1.0 + 0.0j, step)))

    return max(map(growth, poles))
