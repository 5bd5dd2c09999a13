"""Ranges of a plant with spreads that differ, beside all corners and fine grids."""

from dataclasses import replace
from fractions import Fraction as F
from itertools import product

import pytest

from quakedesign.errors import ParameterError
from quakedesign.plant.fault_plant import FaultPlant, Friction

LAW = Friction(
    static=F(1, 2), least=F(1, 4), largest=F(3, 4), weakening=F(1, 8), strengthening=F(1, 16), rate_slope=F(1, 32)
)
PLANT = FaultPlant(
    name="by hand",
    density=F(2),
    shear_modulus=F(16),
    length=F(2),
    damping=F(32),
    normal_stress=F(10),
    spreads=(F(1, 4), F(1, 8), F(1, 16)),
    friction=LAW,
    shape=tuple(map(F, (0, 0, 0, 10, -15, 6))),
    target_slip=F(3),
    operation_time=F(5),
    amplitude=F(7),
    change=None,
    growths=(F(1, 2), F(1, 3)),
)
STIFFNESS, DAMPING, AREA = (F(3, 2), F(5, 2)), (F(7, 4), F(9, 4)), (F(15, 64), F(17, 64))
LAWS = [
    LAW,
    replace(LAW, strengthening=F(1, 8)),
    replace(LAW, strengthening=F(1, 4)),
    replace(LAW, weakening=F(0)),
    replace(LAW, weakening=F(1, 64)),
]


def test_constants_per_mass_have_their_own_spreads():
    """G/(ρL²) = 2, η/(ρL³) = 2, 1/(ρL) = 1/4; b = 15/256 and β up to (3/4·17/64)/(15/256)."""
    assert (PLANT.stiffness, PLANT.specific_damping, PLANT.area_per_mass) == (STIFFNESS, DAMPING, AREA)
    assert (PLANT.authority, PLANT.beta) == (F(15, 256), (1, F(17, 5)))


@pytest.mark.parametrize("growth", [F(1, 2), F(21, 8)])  # with the second the disturbance exceeds the spring
@pytest.mark.parametrize("law", LAWS)
def test_the_stress_is_that_of_every_friction_stiffness_and_slip(law, growth):
    """(μ*σ' - (k - φ1)/n·r)/μ on a grid of slips that contains all kinks of the bounds of friction."""
    values = [
        (law.static * 10 - (k - growth) / n * r) / mu
        for r in (F(3 * i, 192) for i in range(193))
        for k, n in product(STIFFNESS, AREA)
        for mu in (max(law.least, law.static - law.weakening * r), min(law.largest, law.static + law.strengthening * r))
    ]
    plant = replace(PLANT, friction=law, growths=(growth, F(1, 3)))
    assert plant.stress == (min(values), max(values))
    assert plant.rest_pressure == (10 - max(values), 10 - min(values))


@pytest.mark.parametrize("stress", [(F(1), F(3)), (F(-5), F(2)), (F(-5), F(-4))])
@pytest.mark.parametrize("law", LAWS)
def test_slopes_are_those_of_all_corners(law, stress):
    """n·N·(-Δμ/Δslip) - k + φ1, and η ± n·|N|·Δμ/Δrate - φ2."""
    plant = replace(PLANT, friction=law)
    slips = [
        n * p * c - k + F(1, 2) for n, p, c, k in product(AREA, stress, (law.weakening, -law.strengthening), STIFFNESS)
    ]
    assert plant.slip_slopes(stress) == (min(slips), max(slips))
    rates = [d + sign * n * abs(p) * F(1, 32) - F(1, 3) for d, sign, n, p in product(DAMPING, (-1, 1), AREA, stress)]
    assert plant.rate_slopes(stress) == (min(rates), max(rates))


def test_what_the_reference_needs_and_how_fast_its_pressure_drifts():
    """r' up to 15/8·3/5 and r'' up to 10/√3·3/25; |w| and |s| at their larger ends."""
    first, second = PLANT.reference_rates
    assert first == pytest.approx(F(9, 8), rel=1e-3)
    assert float(second) == pytest.approx(10 / 3**0.5 * 3 / 25, rel=1e-3)
    for plant in (PLANT, replace(PLANT, growths=(F(1, 2), F(99)))):  # w at its lower end in absolute value
        assert plant.reference_force == max(map(abs, plant.rate_chord)) * first + second
        assert plant.drift == max(map(abs, plant.slip_chord)) * first
    low, high = PLANT.rate_chord
    assert PLANT.model.rate == (low + high) / 2
    assert PLANT.half_ranges["slip_rate_error"] == (high - low) / 2


@pytest.mark.parametrize(
    "shape", [(1, 0), (0, 0, 0, 20, -30, 12), (0, 2, -1), (0, 0, 1), (0, 0, 0, 10, -15, 7)], ids=str
)
def test_each_end_of_a_reference_has_its_value_and_its_slope(shape):
    """1 from the start; 2 at the end; a slope of 2 at the start; of 2 at the end; of 5 there, with a value of 2."""
    with pytest.raises(ParameterError, match="must rise from 0 to 1 with slope 0 at both ends"):
        replace(PLANT, shape=tuple(map(F, shape)))
