"""Nested powers as polynomial conditions on cells."""

from dataclasses import replace
from fractions import Fraction as F

import pytest
import sympy as sp

from quakedesign.errors import CertificateError
from quakedesign.laws import LoopField
from quakedesign.lyapunov import Loop, loop_of
from quakedesign.lyapunov.exact.certificate import _same_field
from quakedesign.lyapunov.exact.obligations import Obligations
from quakedesign.symbolic.signed_power import AbsolutePower, SignedPower
from quakedesign.symbolic.terms import Term

V = (Term(F(1), (), (("x", F(2), "a"),)),)


def loop(lifts, field, states=("x",)):
    weights = dict.fromkeys(states, 1)
    return Loop(
        law="own", gains={}, constants={}, states=weights, domain="cells", uncertain={}, field=field, lifts=lifts
    )


def power(name, exponent="1", kind="s", factor=1):
    return Term(F(factor), (), ((name, F(exponent), kind),))


def test_an_argument_that_is_zero_on_an_open_set_is_refused():
    """n = x, m = ⌈n⌋ − x ≡ 0: a multiplier that holds m's variable would prove anything."""
    bad = loop({"n": (power("x"),), "m": (power("n"), power("x", factor=-1))}, {"x": (power("x"), power("m"))})
    with pytest.raises(CertificateError, match="vanish on an open set"):
        _ = Obligations(bad, V).cells


def test_a_nested_argument_with_a_state_of_its_own_is_accepted():
    field = {"x": (power("m", factor=-1),), "y": (power("y", factor=-1),)}
    good = loop({"n": (power("x"),), "m": (power("n"), power("y"))}, field, ("x", "y"))
    assert Obligations(good, V).variables == 4


def test_a_lift_without_use_and_one_of_no_degree_are_refused():
    with pytest.raises(CertificateError, match="does not occur in the field"):
        _ = Obligations(loop({"n": (power("x"),)}, {"x": (power("x"),)}), V).cells
    mixed = loop({"n": (power("x"), power("x", "2", "a"))}, {"x": (power("n", factor=-1),)})
    with pytest.raises(CertificateError, match="no single positive degree"):
        _ = Obligations(mixed, V).cells


def test_cells_without_interior_are_left_out():
    """⌈x + y⌋ with x, y > 0 cannot be negative: of eight cells two have an interior only with one sign each."""
    field = {"x": (power("n", factor=-1),), "y": (power("y", factor=-1),)}
    cells = Obligations(loop({"n": (power("x"), power("y"))}, field, ("x", "y")), V).cells
    assert [cell.name for cell in cells] == ["+++", "+-+", "+--", "-++", "-+-", "---"]


# ---------------------------------------------------------------- what needs no lift, and what no lift helps

X, Y = sp.symbols("x y", real=True)
HALF = sp.Rational(1, 2)


def loop_with(more):
    """Super-twisting whose first rate has another power."""
    field = {X: Y - 3 * SignedPower(X, HALF) - more, Y: -2 * SignedPower(X, 0)}
    model = LoopField(states={X: 2, Y: 1}, field=field, gains=(), constants=(), uncertain=(), domain="cells")
    return loop_of("own", model, gains={}, uncertain={})


@pytest.mark.parametrize(
    "redundant",
    [
        SignedPower(X, HALF) * SignedPower(X**2, 0),
        SignedPower(X**3, sp.Rational(1, 6)),
        SignedPower(X, 0) * AbsolutePower(X**2, sp.Rational(1, 4)),
        X / AbsolutePower(X, HALF),
        X / sp.sqrt(sp.Abs(X)),
        SignedPower(X, HALF) * SignedPower(X * Y, 0) ** 2,
        SignedPower(X, HALF) * SignedPower(X + Y * AbsolutePower(Y, 1), 0) ** 2,
    ],
)
def test_redundant_signs_and_powers_leave_no_lift(redundant):
    assert loop_with(redundant) == loop_with(SignedPower(X, HALF))


def test_a_sign_of_a_product_is_the_product_of_signs():
    assert loop_with(SignedPower(X * Y, 0) * Y) == loop_with(SignedPower(X, 0) * AbsolutePower(Y, 1))


@pytest.mark.parametrize(
    ("rate", "power"),
    [(X / AbsolutePower(Y, 1), r"\|y\|\^\(-1\)"), (SignedPower(X, -HALF) * Y, r"⌈x⌋\^\(-1/2\)")],
)
def test_a_rate_that_is_unbounded_at_the_origin_is_refused_with_the_reason(rate, power):
    with pytest.raises(CertificateError, match=rf"every rate must be bounded.*{power}.*with a larger exponent"):
        loop_with(rate)


def test_a_lift_inside_another_stays():
    inner = SignedPower(X + Y * AbsolutePower(Y, 1), HALF)
    assert len(loop_with(SignedPower(inner + Y, 1)).lifts) == 1
    assert len(loop_with(SignedPower(SignedPower(inner + Y, 2) + X, HALF) * SignedPower(X - Y, 0) ** 2).lifts) == 3


def test_other_arguments_of_lifts_are_another_field():
    inner = SignedPower(X + Y * AbsolutePower(Y, 1), HALF)
    field = {X: Y - 3 * inner, Y: -2 * SignedPower(X, 0)}
    model = LoopField(states={X: 2, Y: 1}, field=field, gains=(), constants=(), uncertain=(), domain="cells")
    known = loop_of("own", model, gains={}, uncertain={})
    _same_field(known, model)
    ((name, terms),) = known.lifts.items()
    for other in (terms[:1], tuple(replace(term, coefficient=2 * term.coefficient) for term in terms)):
        with pytest.raises(CertificateError, match="the field in the certificate differs from that of own"):
            _same_field(replace(known, lifts={name: other}), model)
