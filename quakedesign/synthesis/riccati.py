"""e-LQR from the Riccati equation with a bound on the uncertainty that the plant can meet (ERRATA 6, 7, 9, 10)."""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import Any

from quakedesign.certificates.linear_premises import Sectors, sectors
from quakedesign.controllers import control_law
from quakedesign.controllers.elqr import ExtendedLQR
from quakedesign.fault import Fault
from quakedesign.rationals import rational
from quakedesign.symbolic import plant
from quakedesign.symbolic.terms import Term

BANDWIDTH_TIMES_STEP = 1.5
_METHOD = "scipy"


@dataclass(frozen=True, slots=True, kw_only=True)
class RiccatiDesign:
    """u = −Kx with K, S, E in python-control's order, and the weights that gave them.

    Attributes
    ----------
    controller : ExtendedLQR
        K in SI, with exact decimals.
    lyapunov : tuple of Term
        xᵀSx in SI, exact.
    Q, S : ndarray, shape (4, 4)
        Nondimensional: time in 1/ω_n, slip in the target slip, p in target·ω_n²/b.
    R : float
    E : ndarray, shape (4,)
        Nominal closed-loop poles [1/s].
    fastest_pole : float
        Largest modulus of a pole over the vertices of the uncertainty [rad/s].
    """

    controller: ExtendedLQR
    lyapunov: tuple[Term, ...]
    Q: Any
    R: float
    S: Any
    E: Any
    fastest_pole: float


def riccati_design(fault: Fault, *, bandwidth: float | None = None) -> RiccatiDesign:
    """Solve the Riccati equation with Q = Q0 + R·W and R such that the fastest pole meets a bandwidth.

    W = diag(g1²/w, g2²/(1−w), 0, 0) bounds h² for |h| ≤ g1|x1| + g2|x2| (ERRATA 7), its split w chosen for the smallest
    trace of S. Q0 is 1 for slip, 1/100 for slip rate and 1 for the integrals in nondimensional variables.

    Parameters
    ----------
    fault : Fault
    bandwidth : float, optional
        Largest modulus of a closed-loop pole over the uncertainty [rad/s]; 1.5/T_s without.

    Returns
    -------
    RiccatiDesign
        With the nearest bandwidth that weights R from 1e-14 to 1 reach, where the wanted one is out of reach.
    """
    import numpy as np
    from scipy.optimize import brentq

    needed = sectors(fault)
    target = bandwidth if bandwidth is not None else BANDWIDTH_TIMES_STEP / fault.sampling_time
    design = _Scaled(fault, needed)

    def excess(log_weight: float) -> float:
        return float(np.log(design.fastest_pole(design.solve(10.0**log_weight)[0]) / target))

    low, high = -14.0, 0.0
    if excess(low) <= 0:
        return design.finished(10.0**low)
    if excess(high) >= 0:
        return design.finished(10.0**high)
    R = 10.0 ** float(brentq(excess, low, high, xtol=1e-6))
    return design.finished(R)


class _Scaled:
    """The design problem with time in 1/ω_n, slip in the target slip and p in target·ω_n²/b."""

    def __init__(self, fault: Fault, needed: Sectors) -> None:
        import numpy as np

        self.fault, self.needed = fault, needed
        self.pace, self.slip = fault.natural_frequency, fault.reference.target_slip
        self.pressure = self.slip * self.pace**2 / float(needed.authority)
        values = plant.plant_values(fault)
        k, eta = float(values[plant.k_hat]) / self.pace**2, float(values[plant.eta_hat]) / self.pace
        self.A = np.array([[0, 1, 0, 0], [-k, -eta, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0]], dtype=float)
        self.B = np.array([[0.0], [1.0], [0.0], [0.0]])
        self.Q0 = np.diag([1.0, 0.01, 1.0, 1.0])
        g1, g2 = (float(g) for g in needed.row_bounds)
        self.g = (g1 * self.slip / self.pressure, g2 * self.slip * self.pace / self.pressure)
        self.units = np.array([1.0, self.pace, 1 / self.pace, 1 / self.pace**2]) * self.slip

    def bound(self, split: float) -> Any:
        """W with h² ≤ xᵀWx."""
        import numpy as np

        g1, g2 = self.g
        if g1 == 0 or g2 == 0:
            return np.diag([g1**2, g2**2, 0, 0])
        return np.diag([g1**2 / split, g2**2 / (1 - split), 0, 0])

    def solve(self, R: float) -> tuple[Any, Any, Any, Any]:
        """K, S, E and Q for a weight R, with the best split of W."""
        import control
        from scipy.optimize import minimize_scalar

        def answer(split: float):
            Q = self.Q0 + R * self.bound(split)
            return (*control.lqr(self.A, self.B, Q, [[R]], method=_METHOD), Q)

        if min(self.g) == 0:
            return answer(0.5)
        best = minimize_scalar(
            lambda w: answer(w)[1].trace(), bounds=(0.01, 0.99), method="bounded", options={"xatol": 1e-4}
        )
        return answer(float(best.x))

    def fastest_pole(self, K: Any) -> float:
        """Largest modulus of a pole over the vertices of the uncertainty [rad/s]."""
        gains = [self.pressure * float(k) / u for k, u in zip(K[0], self.units, strict=True)]
        return max(abs(pole) for pole in vertex_poles(self.needed, gains))

    def finished(self, R: float) -> RiccatiDesign:
        """Return the design in SI with exact gains and an exact V."""
        K, S, E, Q = self.solve(R)
        gains = [self.pressure * float(k) / u for k, u in zip(K[0], self.units, strict=True)]
        exact = tuple(_decimal(g) for g in gains)
        law = control_law("elqr")
        return RiccatiDesign(
            controller=law.from_values(exact, feedback="error"),  # type: ignore[arg-type]
            lyapunov=_quadratic(S / (self.units[:, None] * self.units[None, :])),
            Q=Q,
            R=R,
            S=S,
            E=E * self.pace,
            fastest_pole=self.fastest_pole(K),
        )


def vertex_poles(needed: Sectors, gains: Sequence[float | Fraction]) -> list[complex]:
    """Closed-loop poles [1/s] at all vertices of the uncertainty, for gains in SI."""
    import numpy as np

    b, poles = float(needed.authority), list[complex]()
    for beta, s, w in product(needed.beta, needed.slip, needed.rate):
        feedback = [-float(beta) * b * float(k) for k in gains]
        row = [feedback[0] + float(s), feedback[1] - float(w), *feedback[2:]]
        poles += [complex(z) for z in np.linalg.eigvals(np.array([[0, 1, 0, 0], row, [1, 0, 0, 0], [0, 0, 1, 0]]))]
    return poles


def _decimal(value: float) -> Fraction:
    """Value to ten significant digits, exactly."""
    return rational(f"{value:.9e}")


def _quadratic(matrix: Any) -> tuple[Term, ...]:
    """xᵀMx as terms with exact decimals."""
    names = ("x1", "x2", "xi1", "xi2")
    terms = []
    for i, left in enumerate(names):
        terms.append(Term(rational(f"{matrix[i, i]:.11e}"), (), ((left, Fraction(2), "a"),)))
        for j in range(i + 1, 4):
            value = rational(f"{2 * matrix[i, j]:.11e}")
            if value:
                terms.append(Term(value, (), ((left, Fraction(1), "s"), (names[j], Fraction(1), "s"))))
    return tuple(terms)
