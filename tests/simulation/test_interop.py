from dataclasses import replace

import casadi as ca
import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from thinned import few

from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance, friction_law, friction_laws, load_fault
from quakedesign.laws import published
from quakedesign.simulation import simulate, to_casadi, to_iosystem
from quakedesign.simulation.state_plant import SpringSlider
from quakedesign.symbolic import derive

LAB = load_fault("lab-fault")


def test_a_casadi_function_has_names():
    function = to_casadi(LAB)
    assert function.name_in() == ["t", "x", "p"]
    assert function.name_out() == ["dx"]
    assert np.allclose(function(t=0, x=[0, 0.5], p=0)["dx"].full().ravel(), [0.5, -0.5 * LAB.specific_damping])


@pytest.mark.slow
def test_a_closed_loop_function_integrates_to_the_simulated_run():
    loop = to_casadi(LAB, published("lab-fault")["elqr"])
    run = simulate(LAB, published("lab-fault")["elqr"], step=1e-4, duration=0.2, samples=10, plant="printed")
    oracle = solve_ivp(
        lambda t, y: loop(t, y)[0].full().ravel(),
        (0, run.time[-1]),
        np.zeros(4),
        method="DOP853",
        t_eval=run.time,
        rtol=1e-9,
        atol=1e-18,
    )
    assert np.max(np.abs(oracle.y[0] - run.slip)) < 1e-6 * np.max(np.abs(run.slip))


@pytest.mark.slow
def test_python_control_joins_fault_and_law():
    """Interconnected by signal names and fed with the reference, they must move as the simulated loop."""
    fault, law = to_iosystem(LAB), to_iosystem(published("lab-fault")["elqr"])
    assert (fault.input_labels, fault.output_labels) == (["p"], ["slip", "slip_rate"])
    assert (law.input_labels, law.output_labels) == (["slip", "slip_rate", "r", "r_rate"], ["p"])
    joined = control.interconnect([fault, law], inputs=["r", "r_rate"], outputs=["slip", "p"], check_unused=False)
    run = simulate(LAB, published("lab-fault")["elqr"], step=1e-4, duration=0.1, samples=200, plant="printed")
    response = control.input_output_response(
        joined,
        run.time,
        np.vstack([run.reference, run.reference_rate]),
        solve_ivp_method="Radau",
        solve_ivp_kwargs={"rtol": 1e-9, "atol": 1e-18},
    )
    assert np.max(np.abs(response.outputs[0] - run.slip)) < 1e-5 * np.max(np.abs(run.slip))
    assert np.max(np.abs(response.outputs[1] - run.pressure)) < 1e-5 * np.max(np.abs(run.pressure))


@pytest.mark.parametrize("name", ["cta", "dia", "elqr"])
def test_a_law_alone_gives_the_pressure_of_the_run(name):
    law = published("lab-fault")[name]
    run, system = simulate(LAB, law, duration=0.5, samples=20), to_iosystem(law)
    for i in range(run.time.size):
        inputs = [run.slip[i], run.slip_rate[i], run.reference[i], run.reference_rate[i]]
        pressure = system.output(run.time[i], run.integrals[:, i], inputs)[0]
        assert pressure == pytest.approx(run.pressure[i], rel=1e-9, abs=1e-9)


def test_anything_else_is_refused():
    with pytest.raises(ParameterError, match="Fault or a Controller"):
        to_iosystem(3)


QUANTITIES = {
    "residual": 0.5,
    "drop": 0.1,
    "critical_slip": 2.5e-3,
    "critical_rate": 0.02,
    "reference_coefficient": 0.6,
    "direct_effect": 0.011,
    "evolution_effect": 0.016,
    "reference_rate": 1e-6,
    "slowest_rate": 1e-9,
    "fastest_rate": 1e-3,
    "stress_sensitivity": 0.2,
}


def faults_of_every_law():
    for kind in friction_laws().values():
        law = kind(**{name: QUANTITIES[name] for name in kind.quantities()})
        yield pytest.param(replace(LAB, friction=law, disturbance=Disturbance()), id=kind.name)


def derived_jacobian(fault):
    model = derive(fault)
    return np.array(model.jacobian.subs(model.values).evalf(30), dtype=float)


@pytest.mark.parametrize("fault", [case for case in faults_of_every_law() if not case.values[0].friction.state_names])
def test_free_parameters_are_those_of_another_fault(fault):
    """With other values it must be the function of the fault that has them."""
    draw = np.random.default_rng(3)
    of_plant = ("density", "shear_modulus", "damping", "effective_normal_stress")
    names = (*of_plant, *fault.friction.quantities())
    free = to_casadi(fault, parameters=names)
    nominal = [getattr(fault if name in of_plant else fault.friction, name) for name in names]
    for factors in (np.ones(len(names)), draw.uniform(0.8, 1.25, len(names))):
        values = np.multiply(nominal, factors)
        told = dict(zip(names, map(float, values), strict=True))
        law = replace(fault.friction, **{name: told.pop(name) for name in fault.friction.quantities()})
        other = to_casadi(replace(fault, friction=law, **told))
        for slip, rate, pressure in draw.normal(size=(20, 3)) * [3e-3, 1e-2, 1e5]:
            expected = other(0.1, [slip, rate], pressure).full().ravel()
            assert free(0.1, [slip, rate], pressure, values).full().ravel() == pytest.approx(expected, rel=1e-9)


def test_a_free_parameter_keeps_its_place_and_the_disturbance():
    free = to_casadi(LAB, parameters=("critical_slip", "density"))
    assert free.name_in() == ["t", "x", "p", "parameters"]
    values = [LAB.friction.critical_slip, LAB.density]
    assert free(0.3, [1e-3, 1e-3], 1e3, values).full() == pytest.approx(to_casadi(LAB)(0.3, [1e-3, 1e-3], 1e3).full())
    theta = ca.MX.sym("theta", 2)
    slope = ca.Function("S", [theta], [ca.jacobian(free(0.3, [1e-3, 1e-3], 1e3, theta), theta)])(values).full()
    assert slope[0] == pytest.approx([0, 0])
    assert np.abs(slope[1]).min() > 0


@pytest.mark.parametrize(
    ("parameters", "controller", "named"),
    [
        (("densty",), None, "Received 'densty'. Did you mean density"),
        (("drop", "drop"), None, "Received 'drop', twice"),
        (("drop",), published("lab-fault")["elqr"], "without a controller"),
    ],
)
def test_parameters_that_are_not_free_are_refused(parameters, controller, named):
    with pytest.raises(ParameterError, match=named):
        to_casadi(LAB, controller, parameters=parameters)


@few("fault", list(faults_of_every_law()), every=2)
def test_derivatives_at_the_equilibrium_are_those_that_are_derived(fault):
    """From rest motion goes to slip > 0 and slip rate > 0; rate and state are carried as logarithms (chain rule)."""
    if fault.friction.state_names:
        slider, at = SpringSlider.of(fault), fault.friction.operating_rate
        y = np.array(slider.start(at))
        _, found = slider.rates(y, at)
        scale = np.array([1, *np.exp(y[2:])])
        rows = found.full()[np.ix_([1, 2, 3], [1, 2, 3])]  # slip ahead of the far end is the stretch, backwards
        turned = np.diag([-1, 1, 1]) @ rows @ np.diag([-1, 1, 1])
        assert np.allclose(scale[:, None] * turned / scale, derived_jacobian(fault), rtol=1e-9, atol=0)
        return
    t, x, p = ca.SX.sym("t"), ca.SX.sym("x", 2), ca.SX.sym("p")
    found = ca.Function("J", [x, p], [ca.jacobian(to_casadi(fault)(t, x, p), x)])([0, 0], 0).full()
    assert np.allclose(found, derived_jacobian(fault), rtol=1e-12, atol=0)
    linear = to_iosystem(fault).linearize([0, 0], [0])
    assert np.allclose(linear.A, derived_jacobian(fault), rtol=1e-12, atol=0)
    authority = fault.friction.bounds[1] * fault.authority
    assert np.allclose(linear.B.ravel(), [0, authority], rtol=1e-12, atol=0)


def test_at_the_end_of_weakening_the_slope_is_that_of_slip_beyond_it():
    law = friction_law("linear-slip-weakening")(residual=0.5, drop=0.1, critical_slip=2**-8)
    fault = replace(LAB, friction=law, disturbance=Disturbance())
    linear = to_iosystem(fault).linearize(control.OperatingPoint([2**-8, 0.0], [0.0]))
    assert linear.A[1, 0] == pytest.approx(-LAB.specific_stiffness, rel=1e-12)
