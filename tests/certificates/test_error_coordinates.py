"""The loop in error coordinates against a change of coordinates of matrices, in exact numbers."""

from fractions import Fraction as F

import pytest
import sympy as sp

from quakedesign.certificates.error_coordinates import STATES, in_error_coordinates
from quakedesign.controllers import LoopField, model_of
from quakedesign.errors import CertificateError
from quakedesign.synthesis.linear.plant.polytope import ErrorLoop

GAINS = {"k1": F(7), "k2": F(5, 2), "k3": F(11, 3), "k4": F(13)}
VALUES = {**GAINS, "b": F(3, 5), "beta": F(6, 5), "s": F(2), "w": F(1, 7)}


def matrix(model):
    """Jacobian of a loop with numbers for everything else."""
    rows = sp.Matrix([model.field[state] for state in model.states]).jacobian(list(model.states))
    return rows.subs({s: sp.Rational(VALUES[str(s)].numerator, VALUES[str(s)].denominator) for s in rows.free_symbols})


def test_it_is_the_law_after_a_change_of_coordinates():
    law = model_of("elqr")[1]
    k3, k4 = (sp.Rational(VALUES[k].numerator, VALUES[k].denominator) for k in ("k3", "k4"))
    change = sp.Matrix([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, k3, k4], [0, 0, k4, 0]])
    moved = in_error_coordinates(law)
    assert [str(s) for s in moved.states] == list(STATES)
    assert matrix(moved) * change == change * matrix(law)


def test_it_is_the_error_loop_of_the_synthesis():
    v = VALUES
    point = {n: (v[n], v[n]) for n in ("beta", "s", "w")}
    loop = ErrorLoop(
        gains=tuple(GAINS.values()),
        authority=v["b"],
        beta=point["beta"],
        slip=point["s"],
        rate=point["w"],
    )
    mine = matrix(in_error_coordinates(model_of("elqr")[1]))
    assert [[F(int(c.p), int(c.q)) for c in mine.row(i)] for i in range(4)] == [
        list(row) for row in loop.matrix(v["beta"], v["s"], v["w"])
    ]


def linear(field, states="x1 x2 xi1"):
    symbols = sp.symbols(states, real=True)
    gains = sp.symbols("k1 k2 k3", real=True)
    return LoopField(
        states=dict.fromkeys(symbols, 1), field=dict(zip(symbols, field(*symbols, *gains), strict=True)), gains=gains,
        constants=(), uncertain=(), domain="reals",
    )  # fmt: skip


def test_one_integral_gives_three_states():
    moved = in_error_coordinates(linear(lambda x1, x2, xi, k1, k2, k3: (x2, -k1 * x1 - k2 * x2 - k3 * xi, x1)))
    assert [str(s) for s in moved.states] == ["e1", "e2", "zeta"]
    e1, e2, zeta = moved.states
    k1, k2, k3 = moved.gains
    assert [sp.expand(moved.field[s]) for s in moved.states] == [e2, -k1 * e1 - k2 * e2 - zeta, k3 * e1]


def test_loops_of_another_form_are_refused():
    with pytest.raises(CertificateError, match="slip rate as its second state"):
        in_error_coordinates(linear(lambda x1, x2, xi, *k: (2 * x2, -x1 - x2 - k[2] * xi, x1)))
    with pytest.raises(CertificateError, match="at most two integrals"):
        in_error_coordinates(linear(lambda x1, x2, xi, *k: (x2, -x1 - x2 - k[2] * xi, x1 - xi)))
    with pytest.raises(CertificateError, match="linear"):
        in_error_coordinates(model_of("cta")[1])


def test_a_loop_without_integrals_is_its_own_error_loop():
    moved = in_error_coordinates(linear(lambda x1, x2, k1, k2, k3: (x2, -k1 * x1 - k2 * x2), "x1 x2"))
    e1, e2 = moved.states
    k1, k2, _ = moved.gains
    assert [str(e1), str(e2)] == ["e1", "e2"]
    assert [sp.expand(moved.field[s]) for s in (e1, e2)] == [e2, -k1 * e1 - k2 * e2]


def test_integrals_act_through_one_control():
    both = linear(lambda x1, x2, a, b, k1, k2, k3: (x2, -x1 - 2 * k1 * a - 2 * k2 * b, x1, a), "x1 x2 xi1 xi2")
    moved = in_error_coordinates(both)
    e1, e2, zeta, chi = moved.states
    k1, k2, _ = moved.gains
    assert [sp.expand(moved.field[s]) for s in moved.states] == [e2, -e1 - 2 * zeta, k1 * e1 + chi, k2 * e1]
    apart = linear(lambda x1, x2, a, b, k1, k2, k3: (x2, -x1 - k1 * a - 2 * k2 * b, x1, a), "x1 x2 xi1 xi2")
    with pytest.raises(CertificateError, match="one control"):
        in_error_coordinates(apart)


def test_an_integral_of_an_integral_may_act_alone():
    moved = in_error_coordinates(
        linear(lambda x1, x2, a, b, k1, k2, k3: (x2, -x1 - 3 * k1 * a, b, x1), "x1 x2 xi1 xi2")
    )
    e1, e2, zeta, chi = moved.states
    k1, *_ = moved.gains
    assert [sp.expand(moved.field[s]) for s in moved.states] == [e2, -e1 - 3 * zeta, chi, k1 * e1]
