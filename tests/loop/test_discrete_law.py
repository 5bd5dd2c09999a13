"""Laws in the signals of one sample, and their numbers apart."""

from itertools import permutations

import pytest
import sympy as sp

from quakedesign.laws import Signals
from quakedesign.loop import discrete_law
from quakedesign.loop.discrete_law import DiscreteLaw, Lifted, rate_error, slip_error
from quakedesign.symbolic import SignedPower

ONE = sp.Symbol("xi_1", real=True)


class Told:
    """A law whose pressure names all that it is told."""

    integral_units = ("m s",)

    def pressure(self, told):
        assert told == Signals(
            slip=discrete_law.slip,
            slip_rate=discrete_law.rate,
            slip_error=slip_error,
            slip_rate_error=rate_error,
            integrals=(ONE,),
            reference_acceleration=discrete_law.acceleration,
        )
        return (
            2 * told.slip_error + 3 * told.slip_rate_error + 5 * ONE + 7 * told.slip + 11 * told.reference_acceleration
        )

    def integral_rates(self, told):
        return [told.slip_error]


def test_a_law_is_told_the_signals_of_a_sample():
    law = DiscreteLaw.of(Told(), 0.0)
    assert (law.rates, law.integrals) == ((slip_error,), (ONE,))
    told = 2 * slip_error + 3 * rate_error + 5 * ONE
    assert law.pressure == told + 7 * discrete_law.slip + 11 * discrete_law.acceleration
    assert DiscreteLaw.of(None, 5.5) == DiscreteLaw(sp.Float(5.5), (), ())


def restored(lifted):
    return [e.subs(dict(zip(lifted.numbers, lifted.values, strict=True))) for e in lifted.expressions]


def law(a, b, c):
    root = SignedPower(slip_error, sp.Rational(1, 3))
    nested = SignedPower(b * rate_error + c, sp.Rational(1, 2))
    alike = a * slip_error + b * rate_error + c * ONE
    return (alike, a * slip_error + b * root * rate_error - c, nested, slip_error * rate_error - ONE, sp.Integer(0))


@pytest.mark.parametrize("given", [(sp.Rational(-5, 2), sp.sqrt(2), 4), (3, -7, sp.Rational(1, 9)), (-2, -3, -5)])
def test_numbers_are_set_apart_and_signs_stay(given):
    lifted, expected = Lifted.of(law(*given)), law(*given)
    assert all(v > 0 for v in lifted.values)
    assert not {abs(n) for e in lifted.expressions for n in e.atoms(sp.Number)} - {
        0,
        1,
        sp.Rational(1, 2),
        sp.Rational(1, 3),
    }
    point = {slip_error: 8.0, rate_error: 0.7, ONE: 0.3}
    for found, e in zip(restored(lifted), expected, strict=True):
        assert float(found.subs(point)) == pytest.approx(float(e.subs(point)), rel=1e-15, abs=1e-15)
    assert sorted(lifted.values) == sorted(float(abs(sp.sympify(v))) for v in given)


def test_expressions_do_not_depend_on_the_values_but_on_their_signs():
    one = Lifted.of(law(2, 3, 5))
    for values in permutations((sp.Rational(1, 9), sp.sqrt(5), 400, sp.pi), 3):
        assert Lifted.of(law(*values)).expressions == one.expressions
    assert one.expressions != Lifted.of(law(-2, 3, 5)).expressions
    assert Lifted.of((2 * slip_error, 2 * rate_error)).values == (2.0,)
