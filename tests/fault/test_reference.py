"""The slip to follow, eq. ref."""

import pytest
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.fault import Reference

REFERENCE = Reference(target_slip=0.785, operation_time=3600.0)
s = sp.Symbol("s")


def test_it_starts_and_ends_at_rest():
    shape = REFERENCE.shape(s)
    assert [shape.subs(s, end) for end in (0, 1)] == [0, 1]
    for order in (1, 2):
        assert [sp.diff(shape, s, order).subs(s, end) for end in (0, 1)] == [0, 0]


def test_it_never_goes_back():
    # r' ∝ s²(1 − s)²
    assert sp.expand(sp.diff(REFERENCE.shape(s), s) - 30 * s**2 * (1 - s) ** 2) == 0


def test_slip_is_exact():
    # s = 1/2: (10 − 15/2 + 6/4)/8 = 1/2
    assert REFERENCE.slip(sp.Integer(1800)) == sp.Rational(785, 2000)
    assert REFERENCE.slip(sp.Integer(3600)) == sp.Rational(785, 1000)


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
@pytest.mark.parametrize("name", ["target_slip", "operation_time"])
def test_both_must_be_positive(name, value):
    with pytest.raises(ParameterError, match=f"^{name} must be positive and finite"):
        Reference(**{"target_slip": 1.0, "operation_time": 1.0} | {name: value})


@pytest.mark.parametrize("stage", [None, int, "1/2", [0.5], {}])
def test_a_stage_without_powers_is_refused(stage):
    with pytest.raises(ParameterError, match=r"stage must be a number, an array or an expression\. Received"):
        REFERENCE.shape(stage)
