"""The implicit step as a sum of powers, term by term."""

from fractions import Fraction as F

import pytest
import sympy as sp

from quakedesign.errors import UnsupportedError
from quakedesign.fault import load_fault
from quakedesign.guarantees.search.compensated_search import _term, implicit_pull
from quakedesign.laws import Power, control_law
from quakedesign.laws.feed_forward import feed_forward
from quakedesign.loop.schemes.implicit import end_rate, end_slip
from quakedesign.symbolic import AbsolutePower, SignedPower

STEP, AUTHORITY = F(1, 5), F(3, 10**8)


def power(factor, exponent, argument):
    return Power(factor=(F(factor), F(factor)), exponent=F(exponent), argument=argument)


def test_linear_feedback_has_the_power_one():
    """p = −k1e1 − k2e2 − k3ξ1 − k4ξ2 with ξ1⁺ = T_s·e1⁺ and ξ2⁺ = T_s·ξ1⁺."""
    k1, k2, k3, k4 = gains = (F(7), F(5), F(3), F(2))
    found = implicit_pull(control_law("elqr").from_values(tuple(map(str, gains))), STEP, AUTHORITY)
    share = STEP * AUTHORITY
    expected = [power(share * (k1 + STEP * k3 + STEP**2 * k4), 1, "slip"), power(share * k2, 1, "rate")]
    assert sorted(found, key=lambda one: one.argument) == sorted(expected, key=lambda one: one.argument)


def test_terms_are_multiples_of_powers_of_an_end_or_of_such_a_sum():
    inner = 2 * end_rate + SignedPower(end_slip, sp.Rational(1, 3))
    assert _term(sp.Rational(3, 2) * end_slip) == power("3/2", 1, "slip")
    assert _term(SignedPower(end_rate, 0)) == power(1, 0, "rate")
    nested = _term(5 * SignedPower(inner, sp.Rational(1, 2)))
    assert (nested.factor, nested.exponent) == ((5, 5), F(1, 2))
    assert set(nested.argument) == {power(2, 1, "rate"), power(1, "1/3", "slip")}


@pytest.mark.parametrize(
    "term",
    [
        -2 * end_slip,
        -SignedPower(end_rate, sp.Rational(1, 2)),
        sp.Symbol("k") * end_slip,
        3 * AbsolutePower(end_slip, 2),
        SignedPower(end_slip, sp.sqrt(2)),
        end_slip * end_rate,
        sp.Integer(7),
        SignedPower(2 * end_slip - end_rate, 1),
    ],
)
def test_what_may_rise_or_is_no_such_power_is_refused(term):
    with pytest.raises(UnsupportedError, match="sum of signed powers with negative factors"):
        _term(term)


def test_a_feed_forward_is_refused():
    divisor = F(2353, 125000000000)
    law = control_law("cta").from_values(("7", "5", "2.3", "1.1"), scale=F(1), divisor=divisor)
    ahead = law.with_feedforward(feed_forward("nominal", load_fault("real-fault"), divisor))
    assert len(implicit_pull(law, STEP, AUTHORITY)) == 4
    with pytest.raises(UnsupportedError, match="feed-forward"):
        implicit_pull(ahead, STEP, AUTHORITY)
