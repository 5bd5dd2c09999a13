"""Signed powers: values, derivatives, kinks, notation."""

import mpmath
import pytest
import sympy as sp

from quakedesign.errors import KinkError
from quakedesign.symbolic import AbsolutePower, SignedPower, off_kinks
from quakedesign.symbolic.casadi_printer import to_numpy

x, y = sp.symbols("x y", real=True)
EXPONENTS = [sp.Rational(a) for a in ("1/3", "1/2", "2/3", "1", "4/3", "3/2", "5/3", "2", "5/2", "3")]
POINTS = [sp.Rational(a) for a in ("-7/2", "-1", "-1/1000", "1/50", "1", "22/7")]


def signed(value, exponent):
    return mpmath.sign(value) * abs(value) ** exponent


def absolute(value, exponent):
    return abs(value) ** exponent


def rational(value):
    return mpmath.mpf(int(value.p)) / int(value.q)


def close(ours, oracle, digits):
    return abs(mpmath.mpf(str(sp.N(ours, 50))) - oracle) <= abs(oracle) * mpmath.mpf(10) ** -digits


@pytest.mark.parametrize("a", EXPONENTS, ids=str)
@pytest.mark.parametrize(("kind", "oracle"), [(SignedPower, signed), (AbsolutePower, absolute)])
def test_values_and_derivatives_against_finite_differences(kind, oracle, a):
    with mpmath.workdps(50), off_kinks():
        slope = sp.diff(kind(x, a), x)
        for at in POINTS:
            assert close(kind(at, a), oracle(rational(at), rational(a)), 45)
            numeric = mpmath.diff(lambda v: oracle(v, rational(a)), rational(at), h=mpmath.mpf(10) ** -25)
            assert close(slope.subs(x, at), numeric, 20)


def test_the_chain_rule_through_a_nested_power():
    inner = SignedPower(y, sp.Rational(3, 2)) + 2 * x
    with mpmath.workdps(50), off_kinks():
        slope = sp.diff(SignedPower(inner, sp.Rational(1, 3)), y).subs({x: sp.Rational(-3, 5), y: sp.Rational(-7, 10)})
        third, ends = mpmath.mpf(1) / 3, mpmath.mpf(-3) / 5
        numeric = mpmath.diff(lambda v: signed(signed(v, 1.5) + 2 * ends, third), mpmath.mpf(-7) / 10, h=1e-25)
        assert close(slope, numeric, 20)


@pytest.mark.parametrize("a", ["0", "1/3", "1/2", "2/3"])
def test_a_signed_power_below_one_has_a_kink(a):
    with pytest.raises(KinkError, match=r"not continuous where x = 0. Use `with off_kinks"):
        sp.diff(SignedPower(x, sp.Rational(a)), x)


@pytest.mark.parametrize("a", ["1/2", "1"])
def test_an_absolute_power_up_to_one_has_a_kink(a):
    with pytest.raises(KinkError):
        sp.diff(AbsolutePower(x, sp.Rational(a)), x)


def test_smooth_powers_need_no_permission():
    assert sp.diff(SignedPower(x, sp.Rational(3, 2)), x) == sp.Rational(3, 2) * AbsolutePower(x, sp.Rational(1, 2))
    assert sp.diff(AbsolutePower(x, sp.Rational(5, 3)), x) == sp.Rational(5, 3) * SignedPower(x, sp.Rational(2, 3))
    assert sp.diff(SignedPower(x, 1), x) == 1


def test_an_exponent_that_may_be_below_one_counts_as_a_kink():
    with pytest.raises(KinkError):
        sp.diff(SignedPower(x, sp.Symbol("a", positive=True)), x)


def test_the_exponent_cannot_be_differentiated():
    a = sp.Symbol("a", positive=True)
    with pytest.raises(KinkError, match="cannot be differentiated with respect to its exponent"):
        sp.diff(SignedPower(x, a), a)


def test_permission_ends_with_the_block_even_after_an_error():
    with pytest.raises(ZeroDivisionError), off_kinks():
        raise ZeroDivisionError
    with pytest.raises(KinkError):
        sp.diff(SignedPower(x, 0), x)


@pytest.mark.parametrize("a", ["0", "1/2", "2"])
def test_parity(a):
    a = sp.Rational(a)
    assert SignedPower(-x, a) == -SignedPower(x, a)
    assert AbsolutePower(-x, a) == AbsolutePower(x, a)
    assert SignedPower(y - x, a) == -SignedPower(x - y, a)


def test_at_zero():
    assert [SignedPower(0, a) for a in EXPONENTS] == [0] * len(EXPONENTS)
    assert SignedPower(0, 0) == 0
    assert AbsolutePower(0, sp.Rational(1, 2)) == 0
    assert AbsolutePower(0, 0) == 1


def test_a_negative_power_has_no_value_at_zero():
    with off_kinks():
        steep, jumping = sp.diff(SignedPower(x, sp.Rational(1, 3)), x), sp.diff(AbsolutePower(x, sp.Rational(1, 3)), x)
    assert not steep.subs(x, 0).is_Number
    assert not jumping.subs(x, 0).is_Number


def test_simplifications():
    positive = sp.Symbol("q", positive=True)
    assert SignedPower(positive, sp.Rational(1, 2)) == AbsolutePower(positive, sp.Rational(1, 2)) == sp.sqrt(positive)
    assert SignedPower(x, 1) == x
    assert SignedPower(-8, sp.Rational(1, 3)) == -2
    assert AbsolutePower(-8, sp.Rational(1, 3)) == 2


def test_notation():
    assert sp.latex(SignedPower(x, sp.Rational(1, 3))) == r"\left\lceil x\right\rfloor^{\frac{1}{3}}"
    assert sp.latex(AbsolutePower(x, sp.Rational(5, 2))) == r"\left|x\right|^{\frac{5}{2}}"
    assert sp.latex(SignedPower(x, 0) ** 2) == r"\left(\left\lceil x\right\rfloor^{0}\right)^{2}"


@pytest.mark.parametrize("a", ["0", "1/3", "3/2"])
def test_numpy_form(a):
    numpy = pytest.importorskip("numpy")
    points = numpy.array([-2.0, -1e-3, 0.0, 0.5])
    (found,) = to_numpy([SignedPower(x, sp.Rational(a))], {x: points})
    oracle = [float(signed(mpmath.mpf(v), mpmath.mpf(int(sp.Rational(a).p)) / int(sp.Rational(a).q))) for v in points]
    assert found == pytest.approx(oracle, rel=1e-14)
