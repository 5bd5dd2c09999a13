"""The equations of spring-sliders with state against differences with 50 digits and against the symbolic room."""

import dataclasses

import mpmath
import numpy as np
import pytest
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.fault import friction_law, load_fault
from quakedesign.simulation import SpringSlider
from quakedesign.symbolic import plant
from quakedesign.symbolic import rate_and_state_plant as state_plant

PARAMETERS = {
    "reference_coefficient": 0.6,
    "direct_effect": 0.01,
    "evolution_effect": 0.015,
    "critical_slip": 1e-5,
    "reference_rate": 1e-6,
    "slowest_rate": 1e-12,
    "fastest_rate": 1.0,
}
LAWS = {name: friction_law(f"rate-and-state-{name}")(**PARAMETERS) for name in ("aging", "slip")}


@pytest.mark.parametrize("name", LAWS)
def test_without_mass_the_balance_of_forces_stays_in_place(name):
    """d/dt (ks − Nμ − ηv) = 0 along the field, by a central difference with 50 digits."""
    law = LAWS[name]
    slider = SpringSlider(law=law, stiffness=2e9, normal_stress=5e6, damping=3e5)
    rng = np.random.default_rng(3)
    with mpmath.workdps(50):
        for u, w in rng.uniform([-20, -3], [-4, 8], (10, 2)):
            y = [0.0, 1e-3, u, w]
            dy = [mpmath.mpf(float(x)) for x in slider.rates(y, [1e-6, 0, 0])[0].full().ravel()]

            def balance(h, u=u, w=w, dy=dy):
                v, theta = mpmath.exp(u + h * dy[2]), mpmath.exp(w + h * dy[3])
                friction = (
                    mpmath.mpf("0.6")
                    + mpmath.log(v / mpmath.mpf("1e-6")) / 100
                    + mpmath.mpf("0.015") * mpmath.log(theta / 10)
                )
                return 2000000000 * h * dy[1] - 5000000 * friction - 300000 * v

            slope = mpmath.diff(balance, 0)
            assert abs(slope) < 1e-12 * (abs(2e9 * dy[1]) + abs(5e4 * dy[2]) + abs(3e5 * mpmath.exp(u) * dy[2]))


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("inertia", [True, False])
def test_a_fault_gives_the_rates_of_the_symbolic_room(name, inertia):
    """`state_plant` measures slip from steady sliding and works per unit of mass; the motion is the same."""
    fault = dataclasses.replace(load_fault("real-fault"), friction=LAWS[name])
    slider = SpringSlider.of(fault, inertia=inertia)
    law = fault.friction.exact()
    derived = state_plant.third_order_rates(law)[1:] if inertia else state_plant.quasi_dynamic_rates(law)
    v_inf, ahead, v, theta = 1e-6, 1e-3, 3e-6, 7.0
    values = plant.plant_values(fault) | {
        state_plant.loading_rate: v_inf,
        state_plant.rate: v,
        plant.x1: ahead,
        plant.p: 10**6,
        state_plant.state_symbols(("theta",))[0]: theta,
    }
    expected = [
        float(f.replace(plant.disturbance, lambda *_: sp.Integer(0)).subs(values)) for f in map(sp.sympify, derived)
    ]
    friction = PARAMETERS["reference_coefficient"]  # of steady sliding at the reference rate
    steady = (friction * fault.effective_normal_stress + slider.damping * v_inf) / slider.stiffness
    found = slider.rates([0.0, steady - ahead, np.log(v), np.log(theta)], [v_inf, 1e6, 0])[0].full().ravel()
    assert found[2] * v == pytest.approx(expected[0], rel=1e-9)
    assert found[3] * theta == pytest.approx(expected[1], rel=1e-11)
    assert found[0] == pytest.approx(v, rel=1e-14)


def test_the_jacobian_is_that_of_the_rates():
    slider = SpringSlider(law=LAWS["slip"], stiffness=2e9, normal_stress=5e6, damping=3e5, mass=100.0)
    y = np.array([0.0, 1.6e-3, -10.0, 1.0])
    load = [1e-6, 2e5, 3e3]
    _, jacobian = slider.rates(y, load)
    for i, size in enumerate((1e-6, 1e-9, 1e-6, 1e-6)):
        step = np.eye(4)[i] * size
        difference = (slider.rates(y + step, load)[0] - slider.rates(y - step, load)[0]).full().ravel() / (2 * size)
        assert np.allclose(jacobian.full()[:, i], difference, rtol=1e-5, atol=1e-7)


def test_the_start_is_in_balance_and_steady():
    slider = SpringSlider(law=LAWS["aging"], stiffness=2e9, normal_stress=5e6, damping=3e5)
    start = slider.start(1e-4)
    friction, excess = slider.readings(start, 0.0)
    assert float(friction) == pytest.approx(0.6 + (0.01 - 0.015) * np.log(100), rel=1e-14)
    assert abs(float(excess)) < 1e-8
    assert np.allclose(slider.rates(start, [1e-4, 0, 0])[0].full().ravel()[1:], 0, atol=1e-12)
    assert slider.names == ("slip", "stretch", "log_slip_rate", "log_theta")


@pytest.mark.parametrize("wrong", [{"stiffness": 0.0}, {"normal_stress": -1.0}, {"damping": -1.0}, {"mass": np.nan}])
def test_unphysical_sliders_are_refused(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        SpringSlider(**({"law": LAWS["aging"], "stiffness": 1.0, "normal_stress": 1.0} | wrong))
