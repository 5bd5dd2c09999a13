"""Limits are proved, refuted at a point, or left undecided."""

from fractions import Fraction as F
from math import inf

import pytest
import sympy as sp

from quakedesign.symbolic.maximum import Excess, Undecided, upper_limit

x, y = sp.symbols("x y", real=True)
INVERSE_E = F("0.36787944117144233")  # rounded up
GAUSSIAN = F("0.42888194248035340")  # (2e)^{-1/2}, rounded up
REACHED = [
    (x * (1 - x), {x: (F(0), F(1))}, F(1, 4)),
    (x * sp.exp(-x), {x: (F(0), F(5))}, INVERSE_E),
    (x * sp.exp(-x), {x: (F(0), inf)}, INVERSE_E),
    (x * sp.exp(-(x**2)), {x: (F(0), F(3))}, GAUSSIAN),
    (sp.exp(-sp.Max(x, 0)) / (1 + sp.Abs(y)), {x: (-inf, inf), y: (-inf, inf)}, F(1)),
    (sp.sin(x), {x: (-inf, inf)}, F(1)),
    (x * y - x, {x: (F(-1), F(1)), y: (F(-2), F(2))}, F(3)),
    (sp.Min(x, 1 - x) + y, {x: (F(0), F(1)), y: (F(0), F(1))}, F(3, 2)),
    (sp.Integer(2), {}, F(2)),
]


@pytest.mark.parametrize(("expression", "box", "largest"), REACHED, ids=lambda v: str(v)[:30])
def test_a_maximum_is_a_limit_and_less_than_it_is_refuted_where_it_is_exceeded(expression, box, largest):
    slack = F(1, 10**9)
    found = upper_limit(expression, box, largest, slack)
    assert largest <= found <= largest + slack
    below = upper_limit(expression, box, largest * F(999, 1000), F(0))
    assert isinstance(below, Excess)
    there = expression.subs({s: sp.Rational(v.numerator, v.denominator) for s, v in below.at.items()})
    assert float(there) >= float(below.value) > float(largest) * 0.998
    assert all(low <= below.at[s] <= high for s, (low, high) in box.items() if s in below.at)


def test_a_limit_that_is_not_exceeded_is_kept_exactly():
    assert upper_limit(sp.exp(-x) - sp.exp(-2 * x), {x: (F(0), inf)}, F(1, 3), F(0)) == F(1, 3)


@pytest.mark.parametrize(
    ("expression", "ends"), [(1 / x, (F(-1), F(1))), (-1 / x, (F(-1), F(2))), (sp.log(x), (F(-1), F(-1, 2)))], ids=str
)
def test_what_is_not_defined_has_no_limit(expression, ends):
    """Nor do slopes of one sign on both sides of a pole tell how it runs."""
    found = upper_limit(expression, {x: ends}, F(10**9), F(0))
    assert isinstance(found, Excess | Undecided)


def test_a_half_line_without_an_enclosure_is_left_undecided():
    found = upper_limit(sp.sin(x) * x - x, {x: (F(0), inf)}, F(0), F(0))
    assert isinstance(found, Undecided)
    assert found.where[x][1] == inf
