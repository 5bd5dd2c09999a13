"""Ends of implicit steps against roots in closed form, and what is no such step."""

from fractions import Fraction as F

import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.laws import ImplicitStep, Power
from quakedesign.laws.implicit_root import pulled, step_solution

STEP = 0.25
ERRORS = np.array([[e1, e2] for e1 in (-2.0, -0.3, 0.0, 1e-9, 0.7, 5.0) for e2 in (-3.0, -0.2, 0.0, 0.4, 8.0)]).T


def power(argument, exponent=1, factor=1):
    return Power(factor=(F(factor), F(factor)), exponent=F(exponent), argument=argument)


def linear(e1, e2):
    return (e2 - 2 * e1) / (1 + 2 * STEP + 3)


def held(e1, e2):
    """A sign of the slip: it holds e1 + T·w = 0 as far as its size of 2 reaches."""
    return e2 - np.clip(e2 + e1 / STEP, -2, 2)


def kept(e1, e2):
    """A sign of the rate: w is 0 as far as its size of 2 reaches."""
    return e2 - np.clip(e2, -2, 2)


def rooted(e1, e2):
    """√|w| solves s² + 2s = |e2|."""
    return np.sign(e2) * (np.sqrt(1 + abs(e2)) - 1) ** 2


def nested(e1, e2):
    """u = e1 + T·w + w solves u + (1 + T)⌈u⌋^{1/2} = e1 + (1 + T)e2."""
    most = e1 + (1 + STEP) * e2
    u = (np.sqrt((1 + STEP) ** 2 + 4 * abs(most)) - (1 + STEP)) / 2
    return e2 - np.sign(most) * u


def squared(e1, e2):
    """u = e1 + T·w solves u + T·⌈u⌋² = e1 + T·e2."""
    most = e1 + STEP * e2
    u = np.sign(most) * (np.sqrt(1 + 4 * STEP * abs(most)) - 1) / (2 * STEP)
    return (u - e1) / STEP


STEPS = {
    "linear": ((power("slip", 1, 2), power("rate", 1, 3)), linear),
    "sign of slip": ((power("slip", 0, 2),), held),
    "sign of rate": ((power("rate", 0, 2),), kept),
    "root of rate": ((power("rate", F(1, 2), 2),), rooted),
    "root of a sum": ((power((power("slip"), power("rate")), F(1, 2)),), nested),
    "square of slip": ((power("slip", 2),), squared),
}


@pytest.mark.parametrize(("pull", "root"), STEPS.values(), ids=STEPS)
def test_ends_of_steps_known_in_closed_form(pull, root):
    assert np.allclose(step_solution(pull, STEP, *ERRORS), root(*ERRORS), rtol=1e-12, atol=2e-14)


def test_a_sign_of_the_slip_holds_it_exactly_as_far_as_it_reaches():
    """With a root beside it, which vanishes there; at both ends of its reach, too."""
    e1, e2 = np.array([0.3, -0.1, 0.0, 0.25, -0.25]), np.array([0.1, 1.0, 0.5, 1.0, -1.0])
    pull = power("slip", 0, 2), power("slip", F(1, 3))
    assert np.array_equal(step_solution(pull, STEP, e1, e2), -e1 / STEP)


def test_a_pull_is_the_middle_of_its_factors():
    ranged = Power(factor=(F(1), F(4)), exponent=F(2), argument="rate")
    assert pulled((ranged, power("slip", 0)), -3.0, 2.0) == 2.5 * 4 - 1
    assert pulled((ranged, power("slip", 0)), 0.0, -2.0) == -2.5 * 4


def test_slopes_have_a_middle_and_half_a_range():
    root = ImplicitStep(pull=(power("slip"),), slopes=(F(1, 4), F(3, 4)), remainder=F(2))
    assert (root.middle, root.half_range) == (F(1, 2), F(1, 4))
    plain = ImplicitStep(pull=(power("slip"),))
    assert (plain.middle, plain.half_range, plain.remainder) == (1, 0, 0)


@pytest.mark.parametrize("exponent", [F(0), F(1, 6), F(6), F(5, 6), F(6, 5)])
@pytest.mark.parametrize("factor", [(F(0), F(0)), (F(0), F(1)), (F(2), F(2))])
def test_terms_that_are_sound(exponent, factor):
    assert Power(factor=factor, exponent=exponent, argument="rate").exponent == exponent


@pytest.mark.parametrize(
    "wrong",
    [
        {"factor": (F(-1), F(1))},
        {"factor": (F(2), F(1))},
        {"exponent": F(-1, 2)},
        {"exponent": F(7)},
        {"exponent": F(1, 7)},
        {"argument": "push"},
        {"argument": ()},
        {"argument": ""},
    ],
)
def test_terms_that_are_not_sound_are_refused(wrong):
    with pytest.raises(ParameterError, match="term of an implicit step"):
        Power(**{"factor": (F(1), F(1)), "exponent": F(1), "argument": "slip"} | wrong)


def test_terms_are_counted_within_each_other():
    inner = (power("slip"),) * 7
    assert len(ImplicitStep(pull=(power(inner), power(inner))).pull) == 2
    for pull in ((), (power(inner), power((*inner, power("rate")))), (power("slip"),) * 17):
        with pytest.raises(ParameterError, match="1 to 16 terms"):
            ImplicitStep(pull=pull)


@pytest.mark.parametrize("slopes", [(F(0), F(1)), (F(1, 2), F(1, 2)), (F(0), F(0))])
def test_slopes_that_are_ordered_within_the_unit_interval_are_taken(slopes):
    assert ImplicitStep(pull=(power("slip"),), slopes=slopes).slopes == slopes


@pytest.mark.parametrize(
    "wrong",
    [
        {"slopes": (F(-1, 9), F(1))},
        {"slopes": (F(1, 2), F(1, 3))},
        {"slopes": (F(1, 2), F(10, 9))},
        {"remainder": F(-1)},
    ],
)
def test_lines_that_hold_no_root_are_refused(wrong):
    with pytest.raises(ParameterError, match="slopes of an implicit step"):
        ImplicitStep(pull=(power("slip"),), **wrong)
