"""Lines around the root of an implicit step: closed forms, and roots that are found by bisection."""

from fractions import Fraction as F

import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.guarantees.exact.small_gain import sector_is_valid
from quakedesign.laws import ImplicitStep, Power

STEP = F("0.2")


def term(factor, power, of):
    return Power(factor=(F(factor), F(factor)), exponent=F(power), argument=of)


def twisting(scale=1.0):
    """Cube root and square root, both signs."""
    factors = (F(v) for v in (1.5 * scale, 1.1 * scale, 0.09 * scale, 0.04 * scale))
    return tuple(term(c, p, of) for c, p, of in zip(factors, ("1/3", "1/2", 0, 0), ("slip", "rate") * 2, strict=True))


NESTED = (term(1, "1/3", (term(1, "3/2", "rate"), term("2", 1, "slip"))), term("1/20", 0, "slip"))


def roots(q, slips, rate, step=float(STEP)):
    """w of 0 in w − e2 + q(e1 + T·w, w) by bisection on a strongly monotone function."""
    low, high = np.full_like(slips, -9.0), np.full_like(slips, 9.0)
    for _ in range(120):
        middle = (low + high) / 2
        positive = middle - rate + q(slips + step * middle, middle) > 0
        low, high = np.where(positive, low, middle), np.where(positive, middle, high)
    return (low + high) / 2


def signed(x, power):
    return np.sign(x) * np.abs(x) ** power


def twisted(scale):
    return lambda s, r: scale * (1.5 * signed(s, 1 / 3) + 1.1 * signed(r, 0.5) + 0.09 * np.sign(s) + 0.04 * np.sign(r))


LAWS = {
    "twisting": (twisting(), twisted(1)),
    "weak": (twisting(0.1), twisted(0.1)),
    "nested": (NESTED, lambda s, r: signed(signed(r, 1.5) + 2 * s, 1 / 3) + 0.05 * np.sign(s)),
}


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("slopes", [("1", "1"), ("9/10", "1"), ("7/10", "1"), ("1/2", "19/20"), ("0", "1")])
@pytest.mark.parametrize("remainder", ["0", "1/1000", "1/50"])
@pytest.mark.parametrize("size", ["1/100000", "1/1000", "1/20"])
def test_what_is_shown_is_true_of_all_roots_and_what_is_true_by_a_margin_is_shown(name, slopes, remainder, size):
    pull, q = LAWS[name]
    (low, high), rate = map(F, slopes), 2 * F(size)
    root = ImplicitStep(pull=pull, slopes=(low, high), remainder=F(remainder))
    u = np.linspace(0, float(F(size) / STEP), 400)
    above, below = (roots(q, u * float(STEP), sign * float(rate)) for sign in (1, -1))
    room = np.min([float(F(remainder)) - float(low) * u - above, below + float(high) * u + float(F(remainder))])
    shown = sector_is_valid(root, STEP, F(size), rate)
    if shown:
        assert room >= -1e-12
    if room > 0.02 * float(F(size) / STEP):
        assert shown


def test_a_deadbeat_root_is_exact_where_the_sign_holds_it():
    """c3 ≥ R + u + c2·√u + c4 up to E/T keeps e1 + T·w at 0: for all smaller errors and, just beyond, no longer."""
    root = ImplicitStep(pull=twisting())
    last = F("0.001")  # 0.001 + 1.1·√0.001 = 0.0357854 of the 0.05 that both signs leave
    assert sector_is_valid(root, STEP, last * STEP, F("0.0142"))
    assert not sector_is_valid(root, STEP, last * STEP, F("0.0143"))


def test_a_factor_is_taken_at_the_end_that_hurts():
    root = ImplicitStep(pull=twisting())
    wide = tuple(Power(factor=(t.factor[0], t.factor[1] * F(3, 2)), exponent=t.exponent, argument=t.argument)
                 for t in root.pull)  # fmt: skip
    assert not sector_is_valid(ImplicitStep(pull=wide), STEP, F("0.001") * STEP, F("0.0142"))
    assert sector_is_valid(ImplicitStep(pull=wide), STEP, F("0.0001") * STEP, F("0.0005"))


@pytest.mark.parametrize(
    "wrong",
    [
        {"slopes": (F(1), F("0.9"))},
        {"slopes": (F(-1), F(1))},
        {"slopes": (F(0), F(2))},
        {"remainder": F(-1)},
        {"pull": ()},
        {"pull": (term(1, 0, "slip"),) * 17},
        {"pull": (term(1, 1, (term(1, 0, "slip"),) * 16),)},
    ],
)
def test_impossible_lines_and_long_sums_are_refused(wrong):
    with pytest.raises(ParameterError, match="implicit step"):
        ImplicitStep(**{"pull": twisting()} | wrong)


@pytest.mark.parametrize(
    ("factor", "power", "of"),
    [((-1, 1), 0, "slip"), ((2, 1), 0, "slip"), ((1, 1), -1, "slip"), ((1, 1), "1/7", "slip"), ((1, 1), 7, "slip"),
     ((1, 1), 1, "time"),
     ((1, 1), 1, ())],
)  # fmt: skip
def test_terms_that_are_not_monotone_are_refused(factor, power, of):
    with pytest.raises(ParameterError, match="implicit step"):
        Power(factor=(F(factor[0]), F(factor[1])), exponent=F(power), argument=of)
