"""Plants of a fault that are compared with a given one."""

from dataclasses import fields, replace
from fractions import Fraction as F
from inspect import unwrap
from types import SimpleNamespace

import mpmath
import pytest
import sympy as sp

from quakedesign import load_fault
from quakedesign.fault.friction.rate_and_state import RegularisedRateAndState
from quakedesign.fault.friction.weakening import SlipRateWeakening
from quakedesign.plant import plant_like
from quakedesign.plant.of_fault import _near, slow_sliding_plant, static_friction, uncertain_plant

PATCH = load_fault("crustal-patch")


@pytest.mark.parametrize("rate_limited", [False, True])
def test_a_plant_like_another_has_its_class_of_disturbances(rate_limited):
    fault = load_fault("lab-fault")
    given = uncertain_plant(fault, rate_limited=rate_limited)
    assert (given.change is not None) == rate_limited
    assert plant_like(given, fault) == given


def test_static_friction_is_that_at_rest_at_the_initial_slip():
    law = SlipRateWeakening(residual=0.25, drop=0.08, critical_rate=1.0)
    assert static_friction(replace(load_fault("real-fault"), friction=law)) == F("0.33")
    third = SimpleNamespace(exact=lambda: SimpleNamespace(coefficient=lambda slip, rate: sp.Rational(1, 3) + slip))
    unchecked = unwrap(static_friction)  # without the check of its argument, which takes faults alone
    assert unchecked(SimpleNamespace(friction=third)) == F(1, 3)
    irrational = SimpleNamespace(exact=lambda: SimpleNamespace(coefficient=lambda slip, rate: sp.sqrt(2) / 4 + slip))
    with mpmath.workdps(60):
        found = unchecked(SimpleNamespace(friction=irrational))
        error = mpmath.mpf(found.numerator) / found.denominator - mpmath.sqrt(2) / 4
        assert abs(error) < mpmath.mpf(10) ** -48


def test_a_rational_is_near_itself_and_a_root_near_its_first_digits():
    for value in ("1/3", "0.6", f"1/{10**25 + 1}"):
        assert _near(sp.Rational(value)) == F(value)
    near = _near(sp.sqrt(2))
    assert abs(near**2 - 2) < F(1, 10**14)
    assert near.denominator <= 10**18


def test_friction_at_the_reference_rate_is_exact_and_else_within_a_margin():
    friction = PATCH.friction
    same = replace(PATCH, friction=replace(friction, reference_rate=1e-6))
    exact = slow_sliding_plant(same, F(0))
    assert exact.rate == F(1, 10**6)
    assert exact.ranges["coefficient"] == (F(str(friction.reference_coefficient)),) * 2
    assert slow_sliding_plant(same, F(0), F(1, 10)).ranges["coefficient"] == exact.ranges["coefficient"]
    low, high = slow_sliding_plant(PATCH, F(0)).ranges["coefficient"]
    with mpmath.workdps(40):
        names = "direct_effect", "evolution_effect", "reference_coefficient", "reference_rate"
        a, b, mu, rate = (mpmath.mpf(str(getattr(friction, name))) for name in names)
        value = mu + (a - b) * mpmath.log(mpmath.mpf("1e-6") / rate)
        assert mpmath.mpf(low.numerator) / low.denominator < value < mpmath.mpf(high.numerator) / high.denominator
    assert F(1, 10**13) < (high - low) / low < F(1, 10**11)


@pytest.mark.parametrize(("evolution", "state_law"), [("aging", "ageing"), ("slip", "slip")])
def test_a_regularised_law_names_its_evolution(evolution, state_law):
    values = {f.name: getattr(PATCH.friction, f.name) for f in fields(PATCH.friction) if f.init}
    law = RegularisedRateAndState(**values, evolution=evolution)
    plant = slow_sliding_plant(replace(PATCH, friction=law), F(0))
    assert (plant.state_law, plant.regularised) == (state_law, True)
    assert not slow_sliding_plant(PATCH, F(0)).regularised


def test_a_patch_of_several_squares_shares_its_damping():
    patch = replace(PATCH, width=PATCH.length / 2)
    assert patch.squares == 2
    assert slow_sliding_plant(patch, F(0)).damping == F(str(patch.damping)) / 2
