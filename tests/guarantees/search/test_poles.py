"""Eigenvalues of laws and of loops over a period, against closed forms."""

import math
from fractions import Fraction as F

import numpy as np
import pytest

from quakedesign.guarantees.search.float_bounds import own_poles, spectral_radius
from quakedesign.laws import LinearLaw
from quakedesign.loop import PeriodicLoop, Segment


def test_the_poles_of_a_law_are_those_of_its_own_states_the_integral_first():
    law = LinearLaw(
        states=("a", "b", "c"),
        update=((F(1, 2), F(7), F(0)), (F(0), F(1), F(5)), (F(0), F(0), F(-3))),
        measured=((F(0), F(0)),) * 3,
        output=(F(0), F(1), F(0)),
        feedback=(F(0), F(0)),
    )
    np.testing.assert_allclose(own_poles(law), [1, 0.5, -3], rtol=1e-12)


def test_a_law_without_states_has_none():
    law = LinearLaw(states=(), update=(), measured=(), output=(), feedback=(F(-1), F(-1)))
    assert own_poles(law).size == 0


def test_a_period_is_every_flow_behind_its_jump():
    """x′ = −x turned by a right angle before the first part of a second and doubled before the second part of two."""
    turn, double = ((F(0), F(-1)), (F(1), F(0))), ((F(2), F(0)), (F(0), F(2)))
    loop = PeriodicLoop(
        states=("a", "b"),
        flow=((F(-1), F(0)), (F(0), F(-1))),
        segments=(Segment(jump=turn, duration=F(1)), Segment(jump=double, duration=F(2))),
        inputs={},
        outputs={"slip_error": (F(1), F(0))},
    )
    assert spectral_radius(loop) == pytest.approx(2 * math.exp(-3), rel=1e-12)
