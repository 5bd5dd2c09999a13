"""Riccati solutions against the examples with closed form of a public benchmark collection.

Abels and Benner (1999), CAREX: a collection of benchmark examples for continuous-time algebraic Riccati equations
(version 2.0), SLICOT Working Note 1999-14; first version Benner, Laub and Mehrmann (1995), TU Chemnitz SPC 95_22.
Example numbers are those of version 2.0. Every closed form is checked against its own equation first.
"""

from fractions import Fraction as F

import numpy as np
import pytest
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.linear.linear_problem import matrix_product, riccati_residual
from quakedesign.linear.riccati import relative_residual, solve_care


def example_1_1():
    """Laub (1979): double integrator."""
    return sp.Matrix([[0, 1], [0, 0]]), sp.diag(0, 1), sp.diag(1, 2), sp.Matrix([[2, 1], [1, 2]])


def example_1_2():
    """Laub (1979): singular Q and X."""
    Q = sp.Matrix([[9, 6], [6, 4]])
    A = sp.Matrix([[4, 3], [sp.Rational(-9, 2), sp.Rational(-7, 2)]])
    return A, sp.Matrix([[1, -1], [-1, 1]]), Q, (1 + sp.sqrt(2)) * Q


def example_2_1(d):
    """Nearly uncontrollable as d → 0."""
    s = sp.sqrt(1 + d**2)
    X = sp.Matrix([[(1 + s) / d**2, 1 / (2 + s)], [1 / (2 + s), (1 - d**2 / (2 + s) ** 2) / 4]])
    return sp.diag(1, -2), sp.diag(d**2, 0), sp.ones(2), X


def example_2_3(d):
    """A norm of A that grows with d."""
    s = sp.sqrt(1 + 2 * d)
    return sp.Matrix([[0, d], [0, 0]]), sp.diag(0, 1), sp.eye(2), sp.Matrix([[s / d, 1], [1, s]])


def example_2_4(d):
    """A closed loop that nears the imaginary axis as d → 0."""
    a = d + 1
    x1 = (2 * a + sp.sqrt(2 * a**2 + 2) + sp.sqrt(2) * d) / 2
    x2 = x1 / (x1 - a)
    return sp.Matrix([[a, 1], [1, a]]), sp.eye(2), d**2 * sp.eye(2), sp.Matrix([[x1, x2], [x2, x1]])


def example_2_5(d):
    """An indefinite Q, X constant."""
    A = sp.Matrix([[3 - d, 1], [4, 2 - d]])
    return A, sp.ones(2), sp.Matrix([[4 * d - 11, 2 * d - 5], [2 * d - 5, 2 * d - 2]]), sp.Matrix([[2, 1], [1, 1]])


def example_2_6(d):
    """X with large entries, three inputs."""
    V = sp.eye(3) - sp.Rational(2, 3) * sp.ones(3)
    X = sp.diag(d**2 + sp.sqrt(1 + d**4), 2 * d**2 + sp.sqrt(d + 4 * d**4), 3 * d**2 + d * sp.sqrt(1 + 9 * d**2))
    A, Q = d * V * sp.diag(1, 2, 3) * V, V * sp.diag(1 / d, 1, d) * V
    return A, sp.eye(3) / d, Q, V * X * V


EXAMPLES = {
    "1.1": example_1_1(),
    "1.2": example_1_2(),
    **{f"2.1 d={d}": example_2_1(sp.Rational(d)) for d in ("1", "1/1000", "1/1000000")},
    **{f"2.3 d={d}": example_2_3(sp.Rational(d)) for d in ("1", "100", "1000000")},
    **{f"2.4 d={d}": example_2_4(sp.Rational(d)) for d in ("1", "1/100")},
    **{f"2.5 d={d}": example_2_5(sp.Rational(d)) for d in ("1", "1/10")},
    **{f"2.6 d={d}": example_2_6(sp.Rational(d)) for d in ("1", "1000", "1000000")},
}


def rational(matrix):
    return tuple(tuple(F(int(v.p), int(v.q)) for v in matrix.row(i)) for i in range(matrix.rows))


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_closed_form_satisfies_its_equation(name):
    A, G, Q, X = EXAMPLES[name]
    left = (Q + A.T * X + X * A - X * G * X).evalf(80)
    assert max(abs(v) for v in left) <= sp.Float("1e-50") * max(1, max(abs(v) for v in X.evalf(80)) ** 2)
    assert X == X.T


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_solution_agrees_with_the_closed_form(name):
    A, G, Q, X = EXAMPLES[name]
    found = solve_care(*(rational(m) for m in (A, G, Q)))
    scale = [sp.sqrt(X[i, i]).evalf(60) for i in range(X.rows)]
    for i in range(X.rows):
        for j in range(X.rows):
            value = sp.Rational(found.X[i][j].numerator, found.X[i][j].denominator).evalf(60)
            assert abs(value - X[i, j].evalf(60)) <= 1e-9 * scale[i] * scale[j]
    assert found.residual <= F(1, 10**25) or name.startswith("1.2")
    assert found.residual <= F(1, 10**12)


def test_the_residual_is_computed_exactly():
    A, G, Q, X = (rational(m) for m in example_1_1())
    assert relative_residual(A, G, Q, X) == 0
    off = ((X[0][0] + F(1, 10**20), X[0][1]), X[1])
    left = riccati_residual(A, G, Q, off)
    # (AᵀE + EA − XGE − EGX − EGE) for E = ε e1e1ᵀ: ε at (1, 2) and (2, 1), nothing else, as G = e2e2ᵀ
    assert left == ((0, F(1, 10**20)), (F(1, 10**20), 0))
    assert relative_residual(A, G, Q, off) > 0


def test_a_solution_of_another_equation_has_a_large_residual():
    A, G, Q, X = (rational(m) for m in example_1_1())
    assert relative_residual(A, G, Q, tuple(tuple(2 * v for v in row) for row in X)) > F(1, 10)


def test_without_a_stabilising_solution_it_is_one_clear_message():
    # x' = 0·x + u with Q = 0: the closed loop stays on the imaginary axis
    with pytest.raises(ParameterError, match="must have a stabilising solution"):
        solve_care([[1.0, 0], [0, 1.0]], [[1.0, 0], [0, 0]], [[1.0, 0], [0, 0]])


def test_the_found_solution_stabilises():
    A, G, _, _ = EXAMPLES["2.1 d=1/1000"]
    found = solve_care(*(rational(m) for m in EXAMPLES["2.1 d=1/1000"][:3]))
    GX = np.array(matrix_product(rational(G), found.X), dtype=float)
    closed = np.array(rational(A), dtype=float) - GX
    assert np.linalg.eigvals(closed).real.max() < 0
