"""Limits are proved, refuted at a point, or left undecided."""

from fractions import Fraction as F
from math import inf

import pytest
import sympy as sp

from quakedesign.symbolic import AbsolutePower, SignedPower
from quakedesign.symbolic import enclosure as maximum
from quakedesign.symbolic.enclosure import Excess, Undecided, upper_limit

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
    (SignedPower(x, 0), {x: (F(-3), F(1))}, F(1)),
    (x + (1 + x**2) * SignedPower(x, 0), {x: (F(-3), F(2))}, F(7)),
    (AbsolutePower(x, 1) - x**2, {x: (F(-3), F(1, 4))}, F(1, 4)),
    (SignedPower(x, sp.Rational(1, 2)) - x**2, {x: (F(1, 16), F(1))}, F("0.47247039371058")),  # 3/4^{4/3}, rounded up
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


@pytest.mark.slow
def test_a_half_line_without_an_enclosure_is_left_undecided():
    found = upper_limit(sp.sin(x) * x - x, {x: (F(0), inf)}, F(0), F(0))
    assert isinstance(found, Undecided)
    assert found.where[x][1] == inf


EXACT = [
    (x - x**2 / 4, {x: (F(0), F(1))}, F(3, 4)),  # rises
    (x**2 - x**3 / 3, {x: (F(0), F(1))}, F(2, 3)),  # rises, with a slope of 0 at one end
    (x**3 / 3 - x**2, {x: (F(0), F(1))}, F(0)),  # falls
    (x / 50 - x**2 / 100 + y, {x: (F(0), F(1)), y: (F(0), F(1))}, F(101, 100)),  # rises slowly
    (x**2 / 4 + x, {x: (F(-1), F(0))}, F(0)),
    (sp.Abs(x) - 2 * sp.sinh(sp.Abs(x)), {x: (F(-2), inf)}, F(0)),  # at the first cut
    (sp.Abs(x) - 2 * sp.sinh(sp.Abs(x)), {x: (-inf, F(2))}, F(0)),
    (x * (1 - x), {x: (F(0), F(1))}, F(1, 4)),  # at the first point that is tried
]


@pytest.mark.parametrize(("expression", "box", "largest"), EXACT, ids=lambda v: str(v)[:30])
def test_a_maximum_at_a_corner_is_reached_without_slack(expression, box, largest):
    assert upper_limit(expression, box, largest, F(0)) == largest


def test_a_maximum_along_a_line_within_is_approached_by_slopes(monkeypatch):
    """Of −(x − y)² written out: with plain enclosures it takes eight times as many pieces along the diagonal."""
    monkeypatch.setattr(maximum, "PIECES", 20)
    found = upper_limit(2 * x * y - x**2 - y**2, {x: (F(0), F(1)), y: (F(0), F(1))}, F(0), F(1, 10))
    assert 0 <= found <= F(1, 10)


@pytest.mark.parametrize(
    ("expression", "ends"),
    [
        (x * sp.exp(-x), (F(3, 4), inf)),
        (-x * sp.exp(x), (-inf, F(0))),
        (-x * sp.exp(x), (-inf, F(-3, 4))),
        (-(x - 9) * sp.exp(x - 9), (-inf, F(12))),
        (sp.exp(-1 - sp.Abs(x)), (F(-2), inf)),
        (sp.Abs(x) * sp.exp(-sp.Abs(x)), (-inf, inf)),
    ],
    ids=str,
)
def test_half_lines_are_cut_wherever_they_end(expression, ends):
    slack = F(1, 10**6)
    assert INVERSE_E <= upper_limit(expression, {x: ends}, INVERSE_E, slack) <= INVERSE_E + slack
    below = upper_limit(expression, {x: ends}, INVERSE_E - slack, F(0))
    assert isinstance(below, Excess)
    assert ends[0] <= below.at[x] <= ends[1]


def test_a_maximum_that_is_not_exceeded_by_itself_is_left_undecided(monkeypatch):
    """Enclosures around 1/3 stay above 1/3 and no value does; what is left holds the place."""
    monkeypatch.setattr(maximum, "PIECES", 30)
    found = upper_limit(x * (2 - 3 * x), {x: (F(0), F(1))}, F(1, 3), F(0))
    assert isinstance(found, Undecided)
    low, high = found.where[x]
    assert low - F(1, 100) < F(1, 3) < high + F(1, 100)
    assert high - low < F(1, 100)


def test_half_lines_are_cut_up_to_a_size(monkeypatch):
    monkeypatch.setattr(maximum, "FURTHEST", 10**3)
    found = upper_limit(sp.sin(x) * x - x + y, {x: (F(0), inf), y: (F(0), F(1))}, F(1), F(0))
    assert isinstance(found, Undecided)
    assert found.where[x] == (512, inf)  # of which the middle, twice as far out, is beyond
