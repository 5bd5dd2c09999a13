"""Rate-and-state friction: both evolution laws, logarithmic and regularised."""

import math
import random

import mpmath
import pytest
import sympy as sp

from quakedesign.errors import ParameterError, ScenarioError, UnitError
from quakedesign.fault import friction_law, parse_fault
from quakedesign.fault.friction.rate_and_state import outward

QUANTITIES = {
    "reference_coefficient": 0.6,
    "direct_effect": 0.011,
    "evolution_effect": 0.016,
    "critical_slip": 2e-5,
    "reference_rate": 1e-6,
    "slowest_rate": 1e-9,
    "fastest_rate": 1e-2,
}
A, B, D, V0 = 0.011, 0.016, 2e-5, 1e-6
SLOW, FAST = 1e-9, 1e-2
AGING = friction_law("rate-and-state-aging")(**QUANTITIES)
SLIP = friction_law("rate-and-state-slip")(**QUANTITIES)
REGULAR = [friction_law("regularised-rate-and-state")(**QUANTITIES, evolution=e) for e in ("aging", "slip")]
ALL = [AGING, SLIP, *REGULAR]
TOML = """
name = "laboratory"
source = "test"
density = "2500 kg/m^3"
shear_modulus = "30 GPa"
length = "1 m"
damping = "1000 kg/s"
effective_normal_stress = "5 MPa"

[friction]
law = "{law}"
reference_coefficient = 0.6
direct_effect = 0.011
evolution_effect = 0.016
critical_slip = "20 um"
reference_rate = "1 um/s"
slowest_rate = "1 nm/s"
fastest_rate = "1 cm/s"
{more}

[task]
target_slip = "1 mm"
operation_time = "1 hour"
sampling_time = "1 ms"
"""


def identity(law):
    return f"{law.name}-{getattr(law, 'evolution', '')}"


@pytest.mark.parametrize("law", ALL, ids=identity)
def test_steady_sliding_at_the_reference_rate_has_the_reference_coefficient(law):
    # the regularised law misses it by a·exp(−2μ0/a) only
    assert float(sp.N(law.exact().steady_coefficient(law.exact().reference_rate), 30)) == pytest.approx(0.6, rel=1e-15)


@pytest.mark.parametrize("law", ALL, ids=identity)
def test_a_tenfold_steady_rate_changes_friction_by_the_difference_of_the_effects(law):
    change = float(law.steady_coefficient(10 * V0)) - float(law.steady_coefficient(V0))
    assert change == pytest.approx((A - B) * math.log(10), rel=1e-9)


@pytest.mark.parametrize("law", ALL, ids=identity)
def test_a_jump_of_the_rate_is_felt_by_the_direct_effect_first(law):
    theta = D / V0
    jump = float(law.coefficient(0, 10 * V0, theta)) - float(law.coefficient(0, V0, theta))
    assert jump == pytest.approx(A * math.log(10), rel=1e-9)


def test_at_rest_contacts_age_under_one_law_only():
    assert AGING.state_rates(0, 0, 1.0) == (1,)
    assert (
        sp.limit(SLIP.exact().state_rates(0, sp.Symbol("v", positive=True), 1)[0], sp.Symbol("v", positive=True), 0)
        == 0
    )


def test_both_evolutions_agree_about_steady_sliding():
    # θ' has the same slope −v/d_c in θ at θ = d_c/v
    theta, v = sp.symbols("theta v", positive=True)
    slopes = [
        sp.diff(law.exact().state_rates(0, v, theta)[0], theta).subs(theta, law.exact().critical_slip / v)
        for law in ALL
    ]
    assert len({sp.simplify(s) for s in slopes}) == 1


@pytest.mark.parametrize("law", REGULAR, ids=identity)
def test_the_regularised_law_is_zero_at_rest_and_odd(law):
    # ERRATA 13: no positive lower bound of friction
    assert law.coefficient(0, sp.Integer(0), 20) == 0
    forward, backward = (float(law.coefficient(0, sign * 3e-7, 20)) for sign in (1, -1))
    assert forward == -backward > 0


@pytest.mark.parametrize(("law", "rate"), [(law, rate) for law in REGULAR for rate in (1e-8, 1e-6, 1e-3)])
def test_the_regularised_law_is_the_logarithmic_one_away_from_rest(law, rate):
    # arsinh(x) = log(2x) + 1/(4x²) − …
    regular, plain = (
        mpmath.mpf(str(sp.N(x.exact().coefficient(0, sp.Rational(str(rate)), 3), 60))) for x in (law, AGING)
    )
    argument = mpmath.exp(plain / mpmath.mpf("0.011")) / 2
    assert abs(regular - plain) <= mpmath.mpf("0.011") / (4 * argument**2) * (1 + mpmath.mpf(10) ** -6)


@pytest.mark.parametrize("law", ALL, ids=identity)
def test_the_bounds_enclose_the_corners_at_fifty_digits(law):
    with mpmath.workdps(50):
        a, b, mu0 = mpmath.mpf("0.011"), mpmath.mpf("0.016"), mpmath.mpf("0.6")
        span_up, span_down = mpmath.log(mpmath.mpf("1e4")), mpmath.log(mpmath.mpf("1e-3"))
        lowest = mu0 + a * span_down - b * span_up
        highest = mu0 + a * span_up - b * span_down
        low, high = law.bounds
        assert lowest - 1e-15 < low <= lowest + (0 if law in (AGING, SLIP) else mpmath.mpf(10) ** -20)
        assert highest <= high < highest + 1e-15


@pytest.mark.parametrize("law", ALL, ids=identity)
def test_friction_and_its_change_stay_inside_the_bounds_on_the_working_range(law):
    draw = random.Random(1)
    v, theta = sp.symbols("v theta", positive=True)
    friction = law.coefficient(0, v, theta)
    along = sp.lambdify((v, theta), sp.diff(friction, theta) * law.state_rates(0, v, theta)[0] / v, "mpmath")
    slope = sp.lambdify((v, theta), sp.diff(friction, v), "mpmath")
    for _ in range(300):
        rate = SLOW * (FAST / SLOW) ** draw.random()
        age = D / (SLOW * (FAST / SLOW) ** draw.random())
        assert abs(along(rate, age)) <= law.slip_slope * (1 + 1e-12)
        assert 0 < slope(rate, age) <= law.rate_slope * (1 + 1e-12)


@pytest.mark.parametrize(("law", "worst"), [(AGING, (SLOW, D / FAST)), (SLIP, (FAST, D / SLOW))], ids=["aging", "slip"])
def test_the_slip_slope_is_reached_at_a_corner(law, worst):
    v, theta = sp.symbols("v theta", positive=True)
    along = sp.diff(law.coefficient(0, v, theta), theta) * law.state_rates(0, v, theta)[0] / v
    assert abs(float(along.subs({v: worst[0], theta: worst[1]}))) == pytest.approx(law.slip_slope, rel=1e-9)


@pytest.mark.parametrize("law", ALL, ids=identity)
def test_the_state_cannot_leave_the_working_range(law):
    for rate in (SLOW, 1e-6, FAST):
        assert float(law.state_rates(0, rate, D / SLOW)[0]) <= 1e-12
        assert float(law.state_rates(0, rate, D / FAST)[0]) >= -1e-12


@pytest.mark.parametrize("law", ALL, ids=identity)
def test_beyond_the_working_range_the_extended_law_stands_still(law):
    low, high = law.bounds
    assert float(law.extended(0, 0.0, 1e-9)) == pytest.approx(low, rel=1e-12)
    assert float(law.extended(0, 10.0, 1e9)) == pytest.approx(high, rel=1e-12)


def test_rounding_outward_never_crosses_the_number():
    assert outward(sp.Rational(1, 2), up=True) == outward(sp.Rational(1, 2), up=False) == 0.5
    for exact in (sp.Rational(1, 10), sp.log(3), -sp.log(3), sp.sqrt(2)):
        low, high = outward(exact, up=False), outward(exact, up=True)
        assert sp.Rational(low) < exact < sp.Rational(high)
        assert high == math.nextafter(low, math.inf)


@pytest.mark.parametrize("law", ALL, ids=identity)
def test_a_missing_state_is_refused(law):
    with pytest.raises(ParameterError, match=rf"{law.name} needs one state, theta \[s\]. Received 0"):
        law.coefficient(0, 1e-6)


@pytest.mark.parametrize("law", ALL, ids=identity)
def test_the_reference_rate_lies_in_the_working_range(law):
    with pytest.raises(
        ParameterError,
        match=r"reference_rate must lie between slowest_rate, 1e-05 m/s, and fastest_rate.*Received 1e-06 m/s",
    ):
        type(law)(**QUANTITIES | {"slowest_rate": 1e-5})


def test_another_evolution_is_refused():
    with pytest.raises(ParameterError, match=r"evolution must be one of aging, slip\. Received 'perrin'"):
        type(REGULAR[0])(**QUANTITIES, evolution="perrin")


@pytest.mark.parametrize(
    ("name", "more", "law"),
    [
        ("rate-and-state-aging", "", AGING),
        ("rate-and-state-slip", "", SLIP),
        ("regularised-rate-and-state", "", REGULAR[0]),
        ("regularised-rate-and-state", 'evolution = "slip"', REGULAR[1]),
    ],
)
def test_every_law_loads_from_a_fault_file(name, more, law):
    assert parse_fault(TOML.format(law=name, more=more), "laboratory").friction == law


def test_a_fault_file_with_a_wrong_option_or_unit_is_refused():
    with pytest.raises(ParameterError, match="evolution must be one of"):
        parse_fault(TOML.format(law="regularised-rate-and-state", more='evolution = "none"'), "laboratory")
    with pytest.raises(ScenarioError, match=r"friction\.evolution is not a known key"):
        parse_fault(TOML.format(law="rate-and-state-slip", more='evolution = "slip"'), "laboratory")
    text = TOML.format(law="rate-and-state-slip", more="")
    with pytest.raises(UnitError, match=r"friction.critical_slip must be a quantity in m"):
        parse_fault(text.replace('"20 um"', '"20 s"'), "laboratory")
