"""A law with feed-forward in closed loop: eq. esystem3 with numbers, and the same law for other libraries."""

from fractions import Fraction as F

import control
import numpy as np
import pytest

import quakedesign as qd
from quakedesign.laws import control_law, published
from quakedesign.laws.feed_forward import feed_forward
from quakedesign.lyapunov.exact import premises as certificates
from quakedesign.simulation import to_casadi, to_iosystem
from quakedesign.simulation.closed_loop import ClosedLoop

FAULTS = {name: qd.load_fault(name) for name in ("real-fault", "lab-fault")}


def fed(fault, law, name="nominal"):
    return law.with_feedforward(feed_forward(name, fault, law.divisor))


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize("law", ["cta", "dia"])
def test_the_error_acceleration_is_beta_times_nu_plus_h(name, law):
    # ν is what the law without feed-forward asks for; what is added belongs to h
    fault, plain = FAULTS[name], published(name)[law]
    loop, bare = ClosedLoop(fault, fed(fault, plain)), ClosedLoop(fault, plain)
    rng, divisor = np.random.default_rng(1), float(plain.divisor)
    for slip, rate, xi, t in rng.uniform([1e-4, -1e-3, -1e-3, 0], [0.1, 1e-3, 1e-3, 3000], (20, 4)):
        reference = loop.reference(t)
        pressure, nu = (float(one.law([slip, rate], [xi], reference)[0]) for one in (loop, bare))
        h, mu = (float(v) for v in loop.perturbation(t, [slip, rate], reference))
        acceleration = float(loop.plant(t, [slip, rate], pressure)[1])
        beta = mu * fault.authority / divisor
        assert acceleration - float(reference[2]) == pytest.approx(beta * (nu * divisor + h), rel=1e-9, abs=1e-12)
        added = fault.specific_stiffness * slip + fault.specific_damping * rate + float(reference[2])
        assert (pressure - nu) * divisor == pytest.approx(added, rel=1e-6)


def runs(fault, **options):
    """Metrics of proved gains without feed-forward, with the nominal and with the centred one."""
    divisor = certificates.least_authority(fault)
    scale = {"real-fault": F(251, 1000) ** 6, "lab-fault": F(156, 100) ** 6}[fault.name]
    law = control_law("cta").from_values(("7", "5", "2.3", "1.1"), scale=scale, divisor=divisor)
    laws = (law, fed(fault, law), fed(fault, law, "centred"))
    return [qd.simulate(fault, each, **options, plant="printed").metrics for each in laws]


def test_it_calms_the_matched_perturbation_of_a_run():
    plain, nominal, centred = runs(FAULTS["real-fault"], duration=2000.0)
    assert 2 * centred.max_h_rate < plain.max_h_rate
    assert 1.3 * nominal.max_h_rate < plain.max_h_rate


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_over_the_whole_task_the_pressure_is_the_same_and_the_errors_are_alike(name):
    # the reference decides which pressure is needed; errors are those of the chatter, which stays
    plain, nominal, centred = runs(FAULTS[name])
    for run in (nominal, centred):
        assert run.rms_pressure == pytest.approx(plain.rms_pressure, rel=1e-3)
        assert run.max_slip_error < 1.25 * plain.max_slip_error
        assert run.max_slip_rate_error < 1.25 * plain.max_slip_rate_error
        assert run.pressure_total_variation < 0.95 * plain.pressure_total_variation
    assert 2.5 * centred.max_h_rate < plain.max_h_rate
    assert 1.4 * nominal.max_h_rate < plain.max_h_rate


def test_other_libraries_get_the_same_law():
    fault = FAULTS["lab-fault"]
    law = fed(fault, published("lab-fault")["cta"])
    system = to_iosystem(law)
    assert system.input_labels == ["slip", "slip_rate", "r", "r_rate", "r_acceleration"]
    assert isinstance(system, control.NonlinearIOSystem)
    t, state = 900.0, [2e-3, 1e-5, 1e-3]
    outputs = to_casadi(fault, law)(t, state)
    reference = [float(v) for v in outputs[3].full().ravel()]
    pressure = system.output(t, state[2:], [*state[:2], *reference])[0]
    assert pressure == pytest.approx(float(outputs[1]), rel=1e-12)
