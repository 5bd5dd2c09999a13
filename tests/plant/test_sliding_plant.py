"""Values of a slow-sliding plant by hand, differences from another one, and the plant of a fault file."""

from dataclasses import replace
from fractions import Fraction as F
from itertools import pairwise
from math import log

import pytest

from quakedesign import load_fault
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.plant import plant_like
from quakedesign.plant.of_fault import slow_sliding_plant
from quakedesign.plant.sliding_plant import SlidingPlant, cells

RANGES = {
    "direct_effect": (F(1, 100), F(2, 100)),
    "evolution_effect": (F(3, 100), F(4, 100)),
    "critical_slip": (F(1), F(2)),
    "coefficient": (F(1, 2), F(3, 4)),
    "normal_stress": (F(100), F(200)),
}
PLANT = SlidingPlant(
    name="by hand",
    density=F(2),
    shear_modulus=F(12),
    length=F(3),
    damping=F(18),
    ranges=RANGES,
    rate=F(1, 2),
    distance=F(4),
    ramp=F(1),
    stress=F(5),
    swing=F(1, 4),
)


def test_values_by_hand():
    assert (PLANT.stiffness, PLANT.inertia, PLANT.radiation) == (4, 6, 2)
    assert PLANT.fastest == F(5, 8)
    assert PLANT.pressure_per_slip == 8
    assert PLANT.normal_stress(F(7)) == (100 - 8 * 4 - 7, 207)


@pytest.mark.parametrize(
    ("ramp", "drift"), [(F(1), F(3) * F(5, 4)), (F(10), (10 - F(8, 3)) * F(5, 4)), (F(3), F(1) * F(5, 4))]
)
def test_the_drift_is_the_largest_over_the_coefficients(ramp, drift):
    """K·V/μ is 4 and 8/3 at the ends of the range of μ; times 1 + swing."""
    assert replace(PLANT, ramp=ramp).drift == drift


def test_a_plant_has_a_constant_rate_and_the_ageing_law_unless_given():
    plain = SlidingPlant(
        **{n: getattr(PLANT, n) for n in PLANT.__slots__ if n not in ("swing", "state_law", "regularised")}
    )
    assert (plain.swing, plain.state_law, plain.regularised) == (0, "ageing", False)
    with pytest.raises(ParameterError, match="state_law"):
        replace(PLANT, state_law="other")


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("density", F(3), "density [kg/m^3] 2 in the certificate, 3 in the fault"),
        ("shear_modulus", F(11), "shear_modulus [Pa] 12 in the certificate, 11 in the fault"),
        ("length", F(4), "length [m] 3 in the certificate, 4 in the fault"),
        ("damping", F(0), "damping [kg/s] 18 in the certificate, 0 in the fault"),
        ("rate", F(1, 4), "rate [m/s] 0.5 in the certificate, 0.25 in the fault"),
        ("ramp", F(2), "ramp [Pa/s] 1 in the certificate, 2 in the fault"),
        ("state_law", "slip", "state_law [-] ageing in the certificate, slip in the fault"),
        ("regularised", True, "regularised [-] False in the certificate, True in the fault"),
        ("distance", F(5), "distance [m] up to 4 in the certificate, 5 in the fault"),
        ("swing", F(1, 2), "swing [-] up to 0.25 in the certificate, 0.5 in the fault"),
        ("stress", F(6), "stress [Pa] up to 5 in the certificate, 6 in the fault"),
    ],
)
def test_a_value_that_the_proof_does_not_cover_is_named(name, value, said):
    assert PLANT.differences(replace(PLANT, **{name: value})) == [said]


@pytest.mark.parametrize(
    ("name", "value"), [("distance", F(3)), ("swing", F(0)), ("stress", F(0)), ("name", "another")]
)
def test_a_value_within_that_of_the_proof_is_no_difference(name, value):
    assert PLANT.differences(replace(PLANT, **{name: value})) == []
    assert PLANT.differences(PLANT) == []


WORDS = {
    "direct_effect": "a [-]",
    "evolution_effect": "b [-]",
    "critical_slip": "D_c [m]",
    "coefficient": "friction at V [-]",
    "normal_stress": "normal stress [Pa]",
}


@pytest.mark.parametrize("axis", RANGES)
def test_constants_must_lie_within_the_ranges_of_the_proof(axis):
    low, high = RANGES[axis]
    middle = (low + high) / 2
    in_words = {v: f"{float(v):g}" for v in (low, high, middle, low / 2, 2 * high)}

    def differences(*ends):
        return PLANT.differences(replace(PLANT, ranges={**RANGES, axis: ends}))

    def said(ends):
        return [f"{WORDS[axis]} from {in_words[low]} to {in_words[high]} in the certificate, {ends} in the fault"]

    assert differences(low, middle) == differences(middle, high) == []
    assert differences(low / 2, middle) == said(f"{in_words[low / 2]} to {in_words[middle]}")
    assert differences(middle, 2 * high) == said(f"{in_words[middle]} to {in_words[2 * high]}")
    assert differences(2 * high, 2 * high) == said(in_words[2 * high])


@pytest.mark.parametrize(("count", "valid"), [(1, True), (2, True), (64, True), (65, False)])
def test_a_box_has_at_most_64_cells(count, valid):
    """Each cut of D_c from below leaves one cell below it."""
    places = [F(1) + F(i, count) for i in range(1, count)]
    cuts = (*(entry for at in places for entry in (("critical_slip", at), None)), None)
    if valid:
        ends = [one.ranges["critical_slip"] for one in cells(PLANT, cuts)]
        assert ends == list(pairwise([F(1), *places, F(2)]))
        return
    with pytest.raises(ParameterError, match="n from 1 to 64, need 2n - 1 entries of cuts"):
        cells(PLANT, cuts)


@pytest.mark.parametrize(
    "cuts", [(), (None, None), (("critical_slip", F(3, 2)), None), (("critical_slip", F(3, 2)), None, None, None)]
)
def test_cuts_that_are_incomplete_or_more_than_cells_are_rejected(cuts):
    with pytest.raises(ParameterError, match="need 2n - 1 entries of cuts"):
        cells(PLANT, cuts)


@pytest.mark.parametrize(("axis", "at"), [("critical_slip", F(1)), ("critical_slip", F(2)), ("rate", F(1, 2))])
def test_a_cut_outside_its_range_is_rejected(axis, at):
    with pytest.raises(ParameterError, match=r"a cut must be along one of .*, strictly within its range"):
        cells(PLANT, ((axis, at), None, None))


PATCH = load_fault("crustal-patch")


def test_the_plant_of_a_fault_has_its_data_and_narrow_ranges():
    plant, friction = slow_sliding_plant(PATCH, F(1000)), PATCH.friction
    assert plant.density == F(str(PATCH.density))
    assert float(plant.damping) == pytest.approx(PATCH.damping / PATCH.squares, rel=1e-15)
    assert (plant.stress, plant.swing, plant.state_law) == (1000, 0, "ageing")
    assert plant.ranges["direct_effect"] == (F(str(friction.direct_effect)),) * 2
    low, high = plant.ranges["coefficient"]
    mu = float(friction.steady_coefficient(float(plant.rate)))
    assert 0 <= high - low < F(1, 10**11)
    assert float((low + high) / 2) == pytest.approx(mu, rel=1e-13)
    assert float(plant.ramp) == pytest.approx(PATCH.shear_modulus / PATCH.side * float(plant.rate) / mu, rel=1e-12)


def test_a_spread_of_a_and_b_widens_friction_at_the_rate_of_the_task():
    """|ln(V/V0)|·(a + b)·spread to both sides of the steady friction coefficient."""
    fault = replace(PATCH, friction=replace(PATCH.friction, reference_rate=1e-5))
    plant, friction = slow_sliding_plant(fault, F(0), F(1, 10)), fault.friction
    low, high = plant.ranges["coefficient"]
    off = abs(log(float(plant.rate) / 1e-5)) * (friction.direct_effect + friction.evolution_effect) / 10
    assert off > 0.001
    assert float(high - low) / 2 == pytest.approx(off, rel=1e-9)
    for axis in ("direct_effect", "evolution_effect", "critical_slip"):
        exact = F(str(getattr(friction, axis)))
        assert plant.ranges[axis] == (exact * F(9, 10), exact * F(11, 10))


def test_a_plant_like_another_has_its_stress_and_planned_pressure():
    given = replace(slow_sliding_plant(PATCH, F(1000), F(1, 10)), ramp=F(7))
    like, wide = plant_like(given, PATCH), plant_like(given, PATCH, wide=True)
    assert like == replace(slow_sliding_plant(PATCH, F(1000)), ramp=F(7))
    assert wide == slow_sliding_plant(PATCH, F(1000), F(1, 10))


def test_friction_that_the_theorem_does_not_cover_is_rejected():
    with pytest.raises(UnsupportedError, match=r"among .*Received exponential-slip-weakening\. Sim"):
        slow_sliding_plant(load_fault("real-fault"), F(0))
    stressed = replace(PATCH, friction=replace(PATCH.friction, stress_sensitivity=0.1))
    with pytest.raises(UnsupportedError, match=r"stress_sensitivity 0\.1"):
        slow_sliding_plant(stressed, F(0))
