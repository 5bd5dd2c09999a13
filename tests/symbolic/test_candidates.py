"""Candidates are generated from weights and degree."""

from fractions import Fraction as F
from math import comb

import pytest
import sympy as sp

from quakedesign.symbolic import AbsolutePower, SignedPower
from quakedesign.symbolic.term_expressions import from_terms, lie_derivative, signed_monomials
from quakedesign.symbolic.terms import Term

WEIGHTS = {"e1": 3, "e2": 2, "e3": 1}
SYMBOLS = {name: sp.Symbol(name, real=True) for name in WEIGHTS}


def monomials(*products):
    return {Term(F(1), (), tuple((state, F(power), kind) for state, power, kind in p)) for p in products}


def test_degree_five_with_weights_three_two_one():
    # the ten of the generic V of the 2-DIA, in the order they are usually listed
    assert set(signed_monomials(WEIGHTS, 5, "cells")) == monomials(
        [("e1", "5/3", "a")],
        [("e1", "4/3", "s"), ("e3", "1", "s")],
        [("e1", "1", "s"), ("e2", "1", "s")],
        [("e1", "1", "s"), ("e3", "2", "s")],
        [("e2", "5/2", "a")],
        [("e2", "2", "s"), ("e3", "1", "s")],
        [("e2", "3/2", "a"), ("e3", "2", "a")],
        [("e2", "3/2", "s"), ("e3", "2", "s")],
        [("e2", "1", "s"), ("e3", "3", "s")],
        [("e3", "5", "a")],
    )
    assert len(signed_monomials(WEIGHTS, 5, "cells")) == 10


@pytest.mark.slow
@pytest.mark.parametrize("degree", [3, 4, 5, 6, 8])
def test_each_is_even_homogeneous_and_differentiable(degree):
    for term in signed_monomials(WEIGHTS, degree, "cells"):
        expression = from_terms([term], SYMBOLS)
        assert expression.subs({s: -s for s in SYMBOLS.values()}, simultaneous=True) == expression
        assert sum(power * WEIGHTS[state] for state, power, _ in term.factors) == degree
        assert lie_derivative(expression, {s: sp.Integer(1) for s in SYMBOLS.values()}) != 0


@pytest.mark.parametrize(("n", "degree"), [(1, 2), (3, 2), (4, 2), (2, 4), (3, 6)])
def test_on_the_reals_they_are_all_monomials_of_even_degree(n, degree):
    states = [f"x{i}" for i in range(n)]
    found = signed_monomials(dict.fromkeys(states, 1), degree, "reals")
    assert len(set(found)) == len(found) == comb(n + degree - 1, degree)
    assert all((kind == "s") == (power % 2 == 1) for term in found for _, power, kind in term.factors)


def test_the_lyapunov_function_of_the_2_cta_is_among_them():
    e1, e2, e3 = SYMBOLS.values()
    known = [
        AbsolutePower(e1, sp.Rational(5, 3)),
        e1 * e2,
        AbsolutePower(e2, sp.Rational(5, 2)),
        e1 * SignedPower(e3, 2),
        e2 * SignedPower(e3, 3),
        AbsolutePower(e3, 5),
    ]
    found = {from_terms([t], SYMBOLS).subs({SignedPower(e3, 1): e3}) for t in signed_monomials(WEIGHTS, 5, "cells")}
    assert all(v in found for v in known)
