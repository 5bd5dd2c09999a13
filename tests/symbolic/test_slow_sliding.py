"""Errors about slow sliding against the forms in the literature and against the room's own linearisation."""

import pytest
import sympy as sp

from quakedesign.errors import UnsupportedError
from quakedesign.fault import friction_law
from quakedesign.symbolic import rate_and_state_plant as state_plant
from quakedesign.symbolic.rate_and_state_plant import log_rate, log_state, sliding_errors, sliding_rate

PARAMETERS = {
    "reference_coefficient": 0.6,
    "direct_effect": 0.01,
    "evolution_effect": 0.015,
    "critical_slip": 1e-3,
    "reference_rate": 1e-6,
    "slowest_rate": 1e-12,
    "fastest_rate": 1.0,
}
NAMES = ("rate-and-state-aging", "rate-and-state-slip", "regularised-rate-and-state")


def law(name):
    return friction_law(name)(**PARAMETERS)


@pytest.mark.parametrize(
    ("name", "ageing"),
    [
        ("rate-and-state-aging", sp.exp(-log_state) - sp.exp(log_rate)),
        ("rate-and-state-slip", -sp.exp(log_rate) * (log_rate + log_state)),
    ],
)
def test_logarithmic_friction_is_linear_and_only_the_state_is_not(name, ageing):
    chosen = law(name).symbolic()
    found = sliding_errors(chosen)
    linear = chosen.direct_effect * log_rate + chosen.evolution_effect * log_state
    assert sp.simplify(found.friction_change - linear) == 0
    assert sp.simplify(found.log_state_rate - sliding_rate / chosen.critical_slip * ageing) == 0


@pytest.mark.parametrize("name", NAMES)
def test_slopes_are_those_of_the_linearised_plant(name):
    """v·∂μ/∂v, θ·∂μ/∂θ, and of θ′ about steady sliding."""
    chosen, at = law(name).exact(), sp.Rational(3, 10**6)
    found = sliding_errors(chosen)
    steady = chosen.steady_state(at)[0]
    symbols = list(state_plant.slope_symbols(("theta",)).values())
    slopes = {symbol: sp.N(value, 30) for symbol, value in state_plant.slopes(chosen, at).items()}
    _, of_rate, of_state, _, ageing_by_rate, ageing_by_state = (slopes[symbol] for symbol in symbols)
    a, b = (float(v.subs(sliding_rate, at)) for v in found.slopes)
    assert a == pytest.approx(float(at * of_rate), rel=1e-12)
    assert b == pytest.approx(float(steady * of_state), rel=1e-12)
    by_rate, by_state = (float(v.subs(sliding_rate, at)) for v in found.decays)
    assert by_rate == pytest.approx(-float(at * ageing_by_rate / steady), rel=1e-12)
    assert by_state == pytest.approx(-float(ageing_by_state), rel=1e-12)


def test_a_law_without_a_state_is_refused():
    residual = {"residual": 0.2, "drop": 0.1, "critical_slip": 0.2}
    with pytest.raises(UnsupportedError, match="one state"):
        sliding_errors(friction_law("exponential-slip-weakening")(**residual).symbolic())
