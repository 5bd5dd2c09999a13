"""Feed-forward: exact coefficients by hand, one definition in the law, nothing changed in the loop of the errors."""

import pickle
from dataclasses import replace
from fractions import Fraction as F

import pytest
import sympy as sp

import quakedesign as qd
from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.laws import Signals, SlidingMode, control_laws
from quakedesign.laws.feed_forward import FEED_FORWARDS, NONE, FeedForward, feed_forward

REAL = qd.load_fault("real-fault")
LEAST = F("0.2353") * F(8, 10**8)
SLIDING = sorted(name for name, law in control_laws().items() if issubclass(law, SlidingMode))
x1, x2, e1, e2, xi, push = sp.symbols("x1 x2 e1 e2 xi push", real=True)
AT = Signals(slip=x1, slip_rate=x2, slip_error=e1, slip_rate_error=e2, integrals=(xi,), reference_acceleration=push)


def law_of(name, added=NONE):
    law = control_laws()[name]
    return law(gains=dict.fromkeys(law.gain_units, F(3, 2)), divisor=F(1, 7), feedforward=added)


def test_nominal_is_the_remark_of_the_paper():
    # k̂ = G/(ρL²) = 30e9/(2500·25e6) 1/s², η̂ = 5e14/(2500·125e9) 1/s, all of r''
    found = feed_forward("nominal", REAL, LEAST)
    assert (found.stiffness, found.damping, found.inertia) == (F(48, 100), F(16, 10), 1)
    assert feed_forward("nominal", REAL.with_box("ten-percent"), LEAST) == found
    assert feed_forward("none", REAL, LEAST) == NONE


@pytest.mark.parametrize("box", ["paper", "ten-percent"])
def test_centred_is_the_middle_of_what_is_unknown(box):
    fault = REAL.with_box(box)
    width = F(1, 10) if box == "ten-percent" else F(0)
    most = F(3353, 2353) * (1 + width)  # β over the divisor μ_res·N̂
    least = 1 - width
    found = feed_forward("centred", fault, LEAST)
    assert found.inertia == (1 / most + 1 / least) / 2
    assert found.damping == F(16, 10) * ((1 - width) / most + (1 + width) / least) / 2
    # friction takes σ'·μ0N̂0·μ_max·slope/μ_res² from the spring at most
    taken = 50 * 10**6 * LEAST * F("0.3353") * F("0.1") / F("0.27635") / F("0.2353") ** 2
    assert found.stiffness == (F(48, 100) * 2 / least - taken) / 2


@pytest.mark.parametrize("name", SLIDING)
def test_it_is_added_to_the_control_before_the_division(name):
    added = FeedForward(name="own", stiffness=F(2), damping=F(-3), inertia="1/4")
    plain, fed = law_of(name), law_of(name, added)
    assert sp.expand(fed.pressure(AT) - plain.pressure(AT) - 7 * (2 * x1 - 3 * x2 + push / 4)) == 0
    assert fed.integral_rates(AT) == plain.integral_rates(AT)
    assert fed.loop_field() == plain.loop_field()
    assert plain.with_feedforward(added) == fed
    assert not plain.pressure(AT).has(x1, x2, push)


@pytest.mark.parametrize("name", SLIDING)
def test_a_law_with_feed_forward_is_a_value(name):
    law = law_of(name, feed_forward("nominal", REAL, LEAST))
    assert pickle.loads(pickle.dumps(law)) == law == replace(law, gains=dict(law.gains))
    assert law != law_of(name)
    assert law.scaled(F(64)).feedforward == law.feedforward


def test_coefficients_are_exact_numbers():
    assert FeedForward(stiffness=0.1).stiffness == F(1, 10)
    with pytest.raises(ParameterError, match="feed-forward damping must be a finite number"):
        FeedForward(damping="nan")


def test_an_unknown_name_is_one_clear_message():
    with pytest.raises(UnknownNameError, match=r"one of none, nominal, centred\. Received 'all'"):
        feed_forward("all", REAL, LEAST)
    assert FEED_FORWARDS == ("none", "nominal", "centred")
