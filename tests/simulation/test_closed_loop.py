import numpy as np
import pytest
import sympy as sp

from quakedesign.fault import Disturbance, load_fault
from quakedesign.laws import published
from quakedesign.simulation.closed_loop import ClosedLoop, reference_expressions
from quakedesign.symbolic import plant

FAULTS = {name: load_fault(name) for name in ("real-fault", "lab-fault")}


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize("law", ["cta", "dia", "elqr"])
def test_beta_times_nu_plus_h_is_the_error_acceleration(name, law):
    """Eq. esystem3 with numbers: x2' − r'' = β(ν + h), at random states."""
    fault = FAULTS[name]
    loop = ClosedLoop(fault, published(name)[law])
    rng = np.random.default_rng(1)
    for slip, rate, p, t in rng.uniform([-1e-3, -1e-3, -1e6, 0], [0.1, 1e-3, 1e6, 3000], (20, 4)):
        reference = loop.reference(t)
        h, mu = (float(v) for v in loop.perturbation(t, [slip, rate], reference))
        acceleration = float(loop.plant(t, [slip, rate], p)[1])
        beta = mu * fault.authority / float(loop.divisor)
        expected = beta * (p * float(loop.divisor) + h)
        assert acceleration - float(reference[2]) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("name", FAULTS)
def test_the_reference_is_the_integral_of_its_rate(name):
    slip, rate, acceleration = reference_expressions(FAULTS[name])
    end = FAULTS[name].reference.operation_time
    moving = {plant.t: sp.Rational(int(end), 3)}
    s = sp.Symbol("s")
    assert sp.integrate(rate.args[0][0].subs(plant.t, s), (s, 0, moving[plant.t])) == slip.subs(moving)
    assert sp.integrate(acceleration.args[0][0].subs(plant.t, s), (s, 0, moving[plant.t])) == rate.subs(moving)
    assert rate.subs(plant.t, 2 * end) == acceleration.subs(plant.t, end) == 0


@pytest.mark.parametrize("name", FAULTS)
def test_a_tiny_acceleration_survives_next_to_large_stresses(name):
    loop = ClosedLoop(FAULTS[name].with_disturbance(Disturbance(constant=3.2e-15)))
    assert float(loop.plant(0, [0, 0], 0)[1]) == 3.2e-15


def test_friction_is_held_for_negative_slip():
    loop = ClosedLoop(FAULTS["lab-fault"])
    assert float(loop.perturbation(0, [-1.0, 0], [0, 0, 0])[1]) == pytest.approx(0.57, rel=1e-15)
    assert float(loop.perturbation(0, [1e3, 0], [0, 0, 0])[1]) == pytest.approx(0.4, rel=1e-15)


def test_a_law_without_a_divisor_gets_the_smallest_authority():
    loop = ClosedLoop(FAULTS["lab-fault"].with_box("ten-percent"), published("lab-fault")["elqr"])
    assert loop.divisor == sp.Rational(4, 10) * sp.Rational(9, 10) / sp.Rational(1385, 10)
