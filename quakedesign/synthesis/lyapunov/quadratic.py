"""Quadratic Lyapunov functions as matrices, in floating point: proposals, no proofs."""

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from scipy.linalg import eigh

from quakedesign.certificates import Loop
from quakedesign.certificates.obligations import Obligations
from quakedesign.sos import Polynomial
from quakedesign.symbolic.terms import Term
from quakedesign.synthesis.lyapunov.balancing import below


def quadratic_terms(states: Sequence[str], coefficient: Callable[[int, int], Fraction]) -> tuple[Term, ...]:
    """Σ c_ij·x_i·x_j over i ≤ j as terms, without zeros."""
    squares = ((left, Fraction(2), "a") for left in states)
    return tuple(
        Term(value, (), (square,) if i == j else ((left, Fraction(1), "s"), (right, Fraction(1), "s")))
        for i, (left, square) in enumerate(zip(states, squares, strict=True))
        for j, right in enumerate(states)
        if i <= j and (value := coefficient(i, j))
    )


def quadratic_matrix(loop: Loop, lyapunov: tuple[Term, ...]) -> Any:
    """Matrix of a quadratic V, as floats (n × n)."""
    return _matrix(next(iter(Obligations(loop, lyapunov).function()))[1], len(loop.states))


def _matrix(polynomial: Polynomial, size: int) -> Any:
    full = np.zeros((size, size))
    for exponents, c in polynomial.items():
        i, *rest = [k for k, e in enumerate(exponents) for _ in range(e)]
        full[i, rest[0]] += float(c) / 2
        full[rest[0], i] += float(c) / 2
    return full


def quadratic_margin(loop: Loop, lyapunov: tuple[Term, ...]) -> Fraction:
    """Lower bound on the smallest eigenvalue of a quadratic V, 1/trace of the inverse; a proposal, not a proof."""
    V = quadratic_matrix(loop, lyapunov)
    scale = 1 / np.sqrt(np.abs(np.diag(V)))
    inverse = np.linalg.inv(scale[:, None] * V * scale[None, :]) * scale[:, None] * scale[None, :]
    return below(float(1 / np.trace(inverse)))


def quadratic_rate(loop: Loop, lyapunov: tuple[Term, ...]) -> float:
    """Largest a with V' ≤ −2aV at every vertex, for a quadratic V; floating point, may be negative."""
    obligations = Obligations(loop, lyapunov)
    size = len(loop.states)
    V = quadratic_matrix(loop, lyapunov)
    diagonal = np.diag(1 / np.sqrt(np.abs(np.diag(V))))
    try:
        return min(
            float(
                eigh(diagonal @ _matrix(one.polynomial, size) @ diagonal, diagonal @ V @ diagonal, eigvals_only=True)[0]
            )
            / 2
            for _, one in obligations.decrease("rate")
        )
    except np.linalg.LinAlgError:
        return -1.0
