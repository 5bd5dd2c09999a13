"""Continuous algebraic Riccati equations: proposed by python-control, refined with exact residuals."""

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from scipy.linalg import solve_continuous_lyapunov

from quakedesign.errors import ParameterError
from quakedesign.synthesis.linear.plant import rational_matrices as matrices
from quakedesign.synthesis.linear.plant.rational_matrices import (
    Matrix,
    exact,
    floats,
    frobenius,
    product,
    riccati_residual,
    rounded,
    times,
)

METHOD = "scipy"
_STEPS = 12
_ENOUGH = Fraction(1, 10**30)


@dataclass(frozen=True, slots=True, kw_only=True)
class RiccatiSolution:
    """X of Q + AᵀX + XA − XGX = 0 in rationals, with what is left of the equation.

    Attributes
    ----------
    X : Matrix
        Symmetric, n × n.
    residual : Fraction
        Rigorous bound on ‖Q + AᵀX + XA − XGX‖ relative to ‖Q‖ + 2‖AᵀX‖ + ‖XGX‖, Frobenius norms, in the scaled
        states in which X has a unit diagonal.
    """

    X: Matrix
    residual: Fraction


def solve_care(a: Any, g: Any, q: Any) -> RiccatiSolution:
    """Stabilising solution of Q + AᵀX + XA − XGX = 0.

    python-control's `care` (method "scipy") proposes X, first in the given states, then in states scaled by powers
    of two to a unit diagonal of X. Newton's method (Kleinman 1968, IEEE Trans. Autom. Control 13, 114) with residuals
    in rational arithmetic then removes the rounding, so that only the conditioning of the data is left.

    Parameters
    ----------
    a, g, q : matrix (n × n) of Fraction or float
        Entries are taken exactly; G = BR⁻¹Bᵀ.

    Raises
    ------
    ParameterError
        When no stabilising solution is found.
    """
    A, G, Q = (_rational(m) for m in (a, g, q))
    units = tuple(Fraction(1) for _ in A)
    for _ in range(3):
        proposal = _propose(*_scaled(A, G, Q, units))
        sizes = [max(float(proposal[i, i]), 1e-300) for i in range(len(A))]
        change = [Fraction(2) ** round(-math.log2(s) / 2) for s in sizes]
        units = tuple(u * c for u, c in zip(units, change, strict=True))
    scaled = _scaled(A, G, Q, units)
    X, residual = _refined(*scaled, _propose(*scaled))
    back = tuple(tuple(v / u / w for v, w in zip(row, units, strict=True)) for u, row in zip(units, X, strict=True))
    return RiccatiSolution(X=back, residual=residual)


def _rational(matrix: Any) -> Matrix:
    return tuple(tuple(v if isinstance(v, Fraction) else Fraction(float(v)) for v in row) for row in matrix)


def _scaled(a: Matrix, g: Matrix, q: Matrix, units: Any) -> tuple[Matrix, Matrix, Matrix]:
    """Data in states y with x = diag(units)·y."""

    def change(m: Matrix, left: int, right: int) -> Matrix:
        return tuple(
            tuple(v * u**left * w**right for v, w in zip(row, units, strict=True))
            for u, row in zip(units, m, strict=True)
        )

    return change(a, -1, 1), change(g, -1, -1), change(q, 1, 1)


def _propose(a: Matrix, g: Matrix, q: Matrix) -> Any:
    """Floating-point X from python-control, with BR⁻¹Bᵀ = G by its eigenvalues."""
    import control

    A, G, Q = map(floats, (a, g, q))
    values, vectors = np.linalg.eigh(G)
    kept = np.abs(values) > 1e-15 * np.abs(values).max()
    try:
        solution = control.care(A, vectors[:, kept], Q, np.diag(1 / values[kept]), method=METHOD)[0]
    except (np.linalg.LinAlgError, ValueError, control.ControlArgument) as error:
        raise ParameterError(
            f"the Riccati equation has no stabilising solution that can be found ({error}). A stabilisable pair and a "
            "Q that sees every mode on the imaginary axis are expected. Change Q0."
        ) from None
    return np.asarray(solution)


def _refined(a: Matrix, g: Matrix, q: Matrix, proposal: Any) -> tuple[Matrix, Fraction]:
    """Newton steps, Lyapunov equations in floating point, residuals exact; the best X and its relative residual."""
    best = rounded(proposal, 100)
    least = relative_residual(a, g, q, best)
    closed = floats(matrices.total(a, times(-1, product(g, best))))
    for _ in range(_STEPS):
        if least < _ENOUGH:
            break
        left = floats(riccati_residual(a, g, q, best))
        step = solve_continuous_lyapunov(closed.T, -(left + left.T) / 2)
        tried = rounded(matrices.total(best, exact((step + step.T) / 2)), 150)
        residual = relative_residual(a, g, q, tried)
        if residual >= least:
            break
        best, least = tried, residual
    return best, least


def relative_residual(a: Matrix, g: Matrix, q: Matrix, x: Matrix) -> Fraction:
    """Rigorous bound on ‖Q + AᵀX + XA − XGX‖/(‖Q‖ + 2‖AᵀX‖ + ‖XGX‖) in Frobenius norms, rational."""
    parts = frobenius(q) + 2 * frobenius(product(matrices.transpose(a), x)) + frobenius(product(x, g, x))
    low = parts * Fraction(999_999, 1_000_000)  # each norm is an upper bound, tight to far less than this
    return frobenius(riccati_residual(a, g, q, x)) / low if low else Fraction(0)
