"""Polynomials on sign cells: against numbers at random points, against `cell_polynomial`, and for nested powers."""

import random
import time
from fractions import Fraction
from itertools import product

import mpmath as mp
import pytest
import sympy as sp

from quakedesign.controllers import control_law
from quakedesign.errors import CertificateError
from quakedesign.symbolic import FilippovField, SignedPower, filippov_derivative, lift
from quakedesign.symbolic.filippov import lie_derivative
from quakedesign.symbolic.lifting import is_zero_on_cells, least_weights
from quakedesign.symbolic.signed_power import AbsolutePower
from quakedesign.symbolic.term_expressions import to_terms
from quakedesign.symbolic.terms import cell_polynomial

R = sp.Rational
x, y, z = STATES = sp.symbols("x y z", real=True)
k, kappa, a = sp.symbols("k kappa a", positive=True)
d = sp.Symbol("d", real=True)


def signed(v, n):
    return mp.sign(v) * abs(v) ** n if v else mp.mpf(0)


POWERS = [{"SignedPower": signed, "AbsolutePower": lambda v, n: abs(v) ** n}, "mpmath"]

NESTED = SignedPower(SignedPower(y, R(3, 2)) + k ** R(3, 2) * x, R(1, 3))
LEVANT = (AbsolutePower(y, 3) + x**2) ** R(1, 6) * SignedPower(y + AbsolutePower(x, R(2, 3)) * SignedPower(x, 0), 0)
EXPRESSIONS = {
    "product": (AbsolutePower(x, R(5, 3)) * SignedPower(y, R(1, 2)) - 2 * x * z, {x: 3, y: 2, z: 1}),
    "2-DIA": (x * (NESTED - z) - SignedPower(x + k * SignedPower(y, R(3, 2)), 0) * z**2, {x: 3, y: 2, z: 1}),
    "third order": (-a * z * SignedPower(z + 2 * LEVANT, 0), {x: 3, y: 2, z: 1}),
    "super-twisting": ((SignedPower(x, R(1, 2)) - y) * SignedPower(SignedPower(x, R(1, 2)) - y, 0), {x: 2, y: 1}),
    "twice nested": (SignedPower(SignedPower(x + SignedPower(y, R(1, 2)), R(1, 3)) + y, R(1, 2)) * z, STATES),
    "one argument twice": (SignedPower(x - y, R(1, 2)) * x + AbsolutePower(x - y, R(3, 4)) * y, STATES),
    "root of a positive sum": ((x**2 + AbsolutePower(y, R(3, 2)) + 1) ** R(1, 4) * y, STATES),
    "not homogeneous": (SignedPower(x + y**3 + 1, R(1, 3)) ** 2 + x, STATES),
}


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_every_point_lies_in_a_cell_where_the_polynomial_is_the_expression(name):
    """At random points: the cell of the point's signs, u_i = |x_i|^{1/r_i}, w = |P|^{1/n}; 50 digits."""
    expression, weights = EXPRESSIONS[name]
    lifted = lift(expression, weights)
    cells = {tuple(c.signs.values()): c for c in lifted.cells()}
    states, numbers = list(lifted.states), random.Random(5)
    parameters = {k: R(7, 4), a: R(3)}
    with mp.workdps(50):
        for _ in range(12):
            point = [mp.mpf(numbers.uniform(-2, 2)) for _ in states]
            values = [abs(v) ** (mp.mpf(1) / lifted.weights[s]) for s, v in zip(states, point, strict=True)]
            signs = [int(mp.sign(v)) for v in point]
            for one in lifted.lifts:
                P = sp.lambdify(states, one.argument.subs(parameters), POWERS)(*point)
                signs.append(int(mp.sign(P)))
                if one.power:
                    values.append(abs(P) ** (mp.mpf(1) / one.power))
            cell = cells[tuple(signs)]
            on_cell = [
                sp.lambdify(cell.variables, e.subs(parameters), "mpmath")(*values)
                for e in (cell.polynomial, *cell.equalities, *cell.inequalities)
            ]
            direct = sp.lambdify(states, expression.subs(parameters), POWERS)(*point)
            assert abs(on_cell[0] - direct) < mp.mpf(10) ** -40
            assert all(abs(e) < mp.mpf(10) ** -40 for e in on_cell[1 : 1 + len(cell.equalities)])
            assert all(e >= 0 for e in on_cell[1 + len(cell.equalities) :])


def test_products_give_the_same_polynomials_as_the_certificates_use():
    loop = control_law("cta").loop_field()
    e1, e2, e3 = loop.field
    V = AbsolutePower(e1, R(5, 3)) + e1 * e2 / 3 + AbsolutePower(e2, R(5, 2)) + e1 * SignedPower(e3, 2) - e2 * e3**3
    numbers = dict(
        zip([*map(str, loop.gains), "beta", "d"], map(Fraction, ("7", "5", "23/10", "11/10", "1", "-1")), strict=True)
    )
    rate = lie_derivative(V, loop.field)
    terms = to_terms(rate, list(loop.field))
    weights = {s.name: r for s, r in loop.states.items()}
    cells = list(lift(rate, loop.states).cells())
    assert len(cells) == 8
    for cell, signs in zip(cells, product((1, -1), repeat=3), strict=True):
        named = dict(zip(weights, signs, strict=True))
        assert {s.name: v for s, v in cell.signs.items()} == named
        assert cell.data(numbers) == cell_polynomial(terms, weights, named, numbers)
        assert not cell.equalities
        assert not cell.inequalities


def dia():
    loop = control_law("dia").loop_field()
    gains = dict(
        zip(loop.gains, (kappa**2, sp.Symbol("k2", positive=True), sp.Symbol("k3", positive=True), 0), strict=True)
    )
    field = FilippovField(rates={s: r.subs(gains) for s, r in loop.field.items()})
    e1, e2, e3 = loop.field
    V = AbsolutePower(e1, R(5, 3)) + e1 * e2 + AbsolutePower(e2, R(5, 2)) + AbsolutePower(e3, 5)
    return loop, lift(filippov_derivative(V, field).expression, loop.states)


def test_the_nested_power_of_the_2_dia_becomes_one_cubic_equality():
    """With f1 = k_I1^{3/2}·e1: w³ = s2·y³ + s1·x³, and −V̇ is a form of degree 4 in (x, y, z, w)."""
    _, lifted = dia()
    (one,) = lifted.lifts
    (s1, u1), (s2, u2), _ = lifted.states.values()
    assert one.power == 3
    assert sp.expand(one.polynomial - (s2 * u2**3 + s1 * u1**3)) == 0
    for cell in lifted.cells():
        degrees = {
            sum(e)
            for e in cell.data(
                {"kappa": Fraction(3, 2), "k2": Fraction(5), "k3": Fraction(1), "beta": Fraction(1), "d": Fraction(0)}
            )
        }
        assert degrees == {4}
        assert {m for e in cell.equalities for m in map(sum, sp.Poly(e, *cell.variables).monoms())} == {3}


def test_cells_without_interior_are_left_out_unless_asked_for():
    _, lifted = dia()
    some, all_cells = list(lifted.cells()), list(lifted.cells(thin=True))
    assert len(all_cells) == 16
    # e1 and e2 of one sign fix that of the nested argument: 2 of 4 combinations lose one cell, for both signs of e3.
    assert len(some) == 12
    assert {c.name for c in all_cells if c.thin} == {"++--", "+++-", "--++", "---+"}


def test_a_sign_alone_becomes_an_inequality():
    lifted = lift(SignedPower(x + SignedPower(y, R(3, 2)), 0) * z, {x: 3, y: 2, z: 1})
    assert not lifted.relations
    assert lifted.lifts[0].variable is None
    assert len(list(lifted.cells())) == 12
    cell = next(c for c in lifted.cells() if c.name == "+-+-")
    u, v, w = cell.variables
    assert sp.expand(cell.inequalities[0] - (-(u**3) + v**3)) == 0
    assert cell.polynomial == -w


def test_least_weights_make_every_power_whole():
    assert least_weights(AbsolutePower(x, R(5, 3)) + SignedPower(y, R(1, 2)) * SignedPower(x, R(1, 2)), (x, y)) == {
        x: 6,
        y: 2,
    }


@pytest.mark.parametrize(
    ("expression", "weights", "complaint"),
    [
        (SignedPower(x, R(1, 3)), {x: 2}, "whole number"),
        (AbsolutePower(x, R(-1, 3)), {x: 3}, "not negative"),
        (sp.exp(x), {x: 1}, "sum of products"),
        (SignedPower(x + y, k), {x: 1, y: 1}, "rational"),
        (x * sp.Symbol("t_1", real=True) + SignedPower(x + y, 0), {x: 1, y: 1}, "Rename"),
    ],
    ids=["weight", "negative", "exponential", "symbolic exponent", "name"],
)
def test_what_has_no_polynomial_is_refused(expression, weights, complaint):
    with pytest.raises(CertificateError, match=complaint):
        lift(expression, weights)


def test_an_irrational_coefficient_is_refused_with_a_remedy():
    cell = next(iter(lift(NESTED * x, {x: 3, y: 2}).cells()))
    with pytest.raises(CertificateError, match="κ²"):
        lift(k ** R(1, 2) * x, {x: 1}).cells().__next__().data({"k": Fraction(2)})
    assert cell.data({"k": Fraction(4)}) == {(3, 0, 1): Fraction(1)}


def test_reduction_on_cells_proves_what_the_normal_form_does_not_see():
    P = x + y
    assert is_zero_on_cells(P * SignedPower(P, R(1, 3)) - AbsolutePower(P, R(4, 3)), (x, y))
    assert is_zero_on_cells(SignedPower(SignedPower(P, R(1, 3)) ** 3 + y, R(1, 3)) ** 3 - x - 2 * y, (x, y))
    assert not is_zero_on_cells(x * SignedPower(P, R(1, 3)) - AbsolutePower(P, R(4, 3)), (x, y))


def test_no_derivation_takes_more_than_two_seconds():
    start = time.process_time()
    _, lifted = dia()
    assert list(lifted.cells())
    assert time.process_time() - start < 2


def test_lifts_are_shown_as_latex():
    _, lifted = dia()
    assert "w_{1}^{3}" in lifted._repr_latex_()
    assert "=0" in next(iter(lifted.cells()))._repr_latex_()
