"""What every friction law must keep, those of the future included."""

import random
from dataclasses import FrozenInstanceError, fields, is_dataclass

import pint
import pytest
import sympy as sp

from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.fault import FrictionLaw, friction_law, friction_laws

# One value for every quantity that any law uses; a law with a new quantity adds it here.
VALUES = {
    "residual": 0.2353,
    "drop": 0.1,
    "critical_slip": 0.27635,
    "critical_rate": 0.02,
    "reference_coefficient": 0.6,
    "direct_effect": 0.011,
    "evolution_effect": 0.016,
    "reference_rate": 1e-6,
    "slowest_rate": 1e-9,
    "fastest_rate": 1e-3,
    "stress_sensitivity": 0.2,
}
UNITS = pint.UnitRegistry()
NAMES = sorted(friction_laws())
RATE, THETA = sp.symbols("rate theta", positive=True)


@pytest.fixture(params=[*NAMES, "own_parts:Hyperbolic"])
def law(request):
    kind = friction_law(request.param)
    return kind(**{name: VALUES[name] for name in kind.quantities()})


def log_between(draw, low, high):
    return low * (high / low) ** draw.random()


def points(law, number, *, inside):
    """Random slips, rates and states; inside of the domain of the law, or anywhere."""
    draw = random.Random(law.name)
    slowest, fastest = law.working_rates if law.state_names else (1e-9, 10.0)
    for _ in range(number):
        slip, rate = log_between(draw, 1e-4, 10), log_between(draw, slowest, fastest)
        state = [law.steady_state(log_between(draw, slowest, fastest))[0] for _ in law.state_names]
        if not inside:
            slip, rate = draw.choice([-1, 1]) * slip * 1e3, draw.choice([-1, 1]) * rate * 1e3
            state = [theta * 10 ** draw.uniform(-6, 6) for theta in state]
        yield slip, rate, *state


def number(value):
    return float(sp.N(value, 30))


def test_known_laws_are_found():
    assert "exponential-slip-weakening" in NAMES
    assert all(friction_law(name).name == name for name in NAMES)
    with pytest.raises(UnknownNameError, match=r"friction law must be one of .*exponential.*Received 'glue'"):
        friction_law("glue")


def test_it_is_a_documented_value(law):
    assert isinstance(law, FrictionLaw)
    assert is_dataclass(law)
    assert law.source
    assert law.domain
    assert law == type(law)(**{f.name: getattr(law, f.name) for f in fields(law)})
    assert hash(law) is not None
    with pytest.raises((FrozenInstanceError, TypeError)):
        setattr(law, fields(law)[0].name, 1.0)


def test_every_quantity_has_a_unit_and_a_symbol_of_its_own(law):
    quantities = law.quantities()
    for name, entry in quantities.items():
        assert UNITS.Quantity(1, entry.metadata["unit"]).magnitude == 1, name
    symbols = [entry.metadata["symbol"] for entry in quantities.values()]
    assert all(symbols)
    assert len(set(symbols)) == len(symbols)
    assert len(law.state_names) == len(law.state_units)


def test_symbols_exact_numbers_and_floats_are_the_same_law(law):
    where = next(points(law, 1, inside=True))
    exact = law.exact().coefficient(*map(sp.Rational, map(str, where)))
    inserted = sp.sympify(law.symbolic().coefficient(*where)).subs(law.values())
    assert number(inserted) == pytest.approx(number(exact), rel=1e-14)
    assert number(law.coefficient(*where)) == pytest.approx(number(exact), rel=1e-14)
    assert all(value.is_Rational for value in law.values().values())


def test_the_bounds_hold_everywhere_for_the_extended_law(law):
    low, high = law.bounds
    assert 0 < low <= high
    for where in points(law, 60, inside=False):
        assert low * (1 - 1e-12) <= number(law.extended(*where)) <= high * (1 + 1e-12), where


def test_the_extended_law_is_the_law_inside_of_its_domain(law):
    low, high = law.bounds
    for where in points(law, 30, inside=True):
        inner = number(law.coefficient(*where))
        assert number(law.extended(*where)) == pytest.approx(inner, rel=1e-12)
        assert low * (1 - 1e-12) <= inner <= high * (1 + 1e-12)


def test_negative_slip_is_held_at_slip_zero(law):
    for slip, *others in points(law, 10, inside=True):
        held = number(law.extended(sp.Integer(0), *others))
        assert number(law.extended(-slip, *others)) == pytest.approx(held, rel=1e-14)


def test_chords_are_not_steeper_than_the_slopes_say(law):
    places = list(points(law, 40, inside=not law.state_names)) + list(points(law, 40, inside=False))
    for (a, u, *state), (b, v, *_) in zip(places, places[1:] + places[:1], strict=True):
        change = abs(number(law.extended(a, u, *state)) - number(law.extended(b, v, *state)))
        assert change <= (law.slip_slope * abs(a - b) + law.rate_slope * abs(u - v)) * (1 + 1e-9) + 1e-13


def test_the_slopes_are_reached(law):
    if law.state_names:
        slowest, _ = law.working_rates
        high = sp.diff(law.exact().coefficient(0, RATE, THETA), RATE)
        at = {RATE: slowest, THETA: law.steady_state(slowest)[0]}
        assert number(high.subs(at)) == pytest.approx(law.rate_slope, rel=0.05)
        return
    step = 1e-7
    start = number(law.extended(0, 0))
    along_slip = abs(number(law.extended(step, 0)) - start) / step
    along_rate = abs(number(law.extended(0, step)) - start) / step
    assert along_slip == pytest.approx(law.slip_slope, rel=1e-4)
    assert along_rate == pytest.approx(law.rate_slope, rel=1e-4)


def test_ageing_per_slip_is_bounded_by_the_slip_slope(law):
    if not law.state_names:
        assert law.state_rates(0, 1) == law.steady_state(1) == ()
        return
    exact = law.exact()
    carried = sp.diff(exact.coefficient(0, RATE, THETA), THETA) * exact.state_rates(0, RATE, THETA)[0] / RATE
    for _, rate, theta in points(law, 40, inside=True):
        assert abs(number(carried.subs({RATE: rate, THETA: theta}))) <= law.slip_slope * (1 + 1e-9)


def test_a_state_rests_at_its_steady_value(law):
    for _, rate, *_ in points(law, 5, inside=True):
        for change in law.state_rates(0, rate, *law.steady_state(rate)):
            assert number(change) == pytest.approx(0, abs=1e-12)


def test_quantities_must_be_numbers(law):
    right = {name: getattr(law, name) for name in law.quantities()}
    for name in right:
        for value in (float("nan"), float("inf"), -1.0):
            with pytest.raises(ParameterError, match=rf"{name} must be .*Received {value!r}"):
                type(law)(**right | {name: value})
