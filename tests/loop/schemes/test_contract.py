"""What every scheme must do, and what every sampled one must do besides."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.linalg import expm
from thinned import few

from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance, load_fault
from quakedesign.laws import control_law, published
from quakedesign.loop import (
    Actuator,
    Delay,
    Diffusion,
    Lag,
    Quantisation,
    RateLimit,
    Saturation,
    Scheme,
    schemes,
    simulation_scheme,
)
from quakedesign.loop.schemes.base import Sampled
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.simulation import integrator, simulate
from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.simulation.recorder import Recorder
from quakedesign.simulation.run_settings import _step

REAL = load_fault("real-fault")
SAMPLED = [*sorted(name for name, kind in schemes().items() if issubclass(kind, Sampled)), "own_parts:Halved"]
DIVISOR = "2353/125000000000"  # μ_res·N̂ of the real fault
LAWS = {
    "cta": control_law("cta").from_values(("7", "5", "2.3", "1.1"), scale="1/1000", divisor=DIVISOR),
    "dia": control_law("dia").from_values(("2", "5", "1.44", "0"), scale="1/1000", divisor=DIVISOR),
    "elqr": control_law("elqr").from_values(("2e7", "2e7", "2e6", "2e4")),
    "none": None,
}
CHAIN = Actuator(
    stages=(
        Delay(samples=1),
        Quantisation(quantum=10.0),
        Saturation(lowest=-2e6, highest=1e6),
        RateLimit(rate=5e4),
        Lag(time_constant=0.2),
        Diffusion(length=10.0, diffusivity=90.0, storage=1e-6, cells=2),
    )
)


def run(scheme, law="cta", fault=REAL, samples=200, count=200, **options):
    return simulate(
        fault,
        LAWS[law],
        scheme=scheme,
        duration=count * fault.sampling_time,
        samples=samples,
        compiled=False,
        **options,
    )


def test_all_schemes_are_found():
    assert {"continuous", "explicit", "implicit", "semi-implicit", "compensated"} <= set(schemes())


@pytest.mark.parametrize("name", schemes())
def test_a_scheme_has_a_name_and_says_what_it_does(name):
    kind = schemes()[name]
    assert issubclass(kind, Scheme)
    assert kind.name == name
    assert kind.__doc__
    assert isinstance(simulation_scheme(name), kind)


@few("law", LAWS, every=3)
@pytest.mark.parametrize("name", SAMPLED)
def test_every_law_runs_with_finite_figures_or_is_named_diverged(name, law):
    found = run(name, law)
    assert found.provenance["scheme"] == simulation_scheme(name).name
    assert "diverged" not in found.events
    assert math.isfinite(found.metrics.peak_slip_rate)
    assert found.integrals.shape == (len(found.integral_units), found.time.size)


@few("name", SAMPLED, every=2)
def test_between_samples_the_fault_moves_under_the_pressure_that_is_held(name):
    """Without weakening and disturbance the plant is linear, and the matrix exponential gives every sample exactly."""
    friction = dataclasses.replace(REAL.friction, drop=0.0)
    linear = dataclasses.replace(REAL, friction=friction).with_disturbance(Disturbance())
    quick = dataclasses.replace(linear, reference=dataclasses.replace(linear.reference, operation_time=200.0))
    found = run(name, fault=quick, substeps=4, plant="printed")
    gain = friction.residual * REAL.authority
    rates = np.array([[0, 1, 0], [-REAL.specific_stiffness, -REAL.specific_damping, gain], [0, 0, 0]])
    advance = expm(rates * REAL.sampling_time)[:2]
    ahead = advance @ np.array([found.slip, found.slip_rate, found.pressure])[:, :-1]
    assert np.max(np.abs(found.pressure)) > 1e4
    for values, expected in ((found.slip, ahead[0]), (found.slip_rate, ahead[1])):
        assert np.allclose(values[1:], expected, rtol=1e-8, atol=1e-9 * np.max(np.abs(values)))


@few("name", SAMPLED, every=3)
def test_without_control_a_scheme_is_the_integrator(name):
    sampled, plain = run(name, "none"), run("continuous", "none")
    assert np.allclose(sampled.slip, plain.slip, rtol=1e-12, atol=0)


@few("name", SAMPLED, every=2)
def test_substeps_refine_the_plant_and_not_the_control(name):
    """Under a law without chatter the motions differ by the error of the integrator only."""
    coarse, fine = (run(name, "elqr", count=60, substeps=n) for n in (1, 5))
    assert np.allclose(coarse.slip, fine.slip, rtol=0, atol=1e-4 * np.max(np.abs(fine.slip)))
    assert coarse.time.size == fine.time.size == 61


@few("name", SAMPLED, every=3)
def test_both_backends_give_the_same_digits_through_every_stage(name, monkeypatch):
    monkeypatch.setattr("quakedesign.simulation.compiled._WORTH", 0)
    setting = {
        "scheme": name,
        "duration": 300 * REAL.sampling_time,
        "samples": 100,
        "substeps": 1,
        "actuator": CHAIN,
        "measurement": Measurement(slip_noise=1e-8, rate_noise=1e-8, seed=3),
    }
    fast = simulate(REAL, LAWS["cta"], **setting)
    slow = simulate(REAL, LAWS["cta"], **setting, compiled=False)
    assert slow.provenance["backend"] == "virtual-machine"
    if fast.provenance["backend"] != "compiled":
        assert fast.provenance["backend_reason"]
    assert {"well_pressure", "injected_volume", "flow_rate"} <= set(fast.signals())
    for label, (values, _, _) in fast.signals().items():
        assert np.array_equal(values, slow.signals()[label][0]), label
    assert dataclasses.replace(fast.metrics, seconds=0.0) == dataclasses.replace(slow.metrics, seconds=0.0)


def machine(name, law, **options):
    recorder = Recorder(ClosedLoop(REAL, law), simulation_scheme(name, **options), REAL.sampling_time)
    return _step(recorder, integrator("dormand-prince")).serialize(), recorder.start(0.0)


@few("name", SAMPLED, every=2)
def test_numbers_are_data_and_not_code(name):
    """Other gains, limits and noise give the same step function, with another vector to start from."""
    other = control_law("cta").from_values(("8", "6", "2.5", "1.3"), scale="1/500", divisor=DIVISOR)
    limits = [Actuator(stages=(Saturation(lowest=-x, highest=x), Lag(time_constant=x / 1e6))) for x in (1e6, 2e6)]
    noises = [Measurement(rate_noise=x, seed=i) for i, x in enumerate((1e-8, 1e-7))]
    (code, start), (same, changed) = (
        machine(name, law, actuator=limit, measurement=noise)
        for law, limit, noise in zip((LAWS["cta"], other), limits, noises, strict=True)
    )
    assert code == same
    assert start != changed


@few("name", SAMPLED, every=3)
def test_no_error_and_no_disturbance_means_no_pressure(name):
    still = dataclasses.replace(REAL, reference=dataclasses.replace(REAL.reference, target_slip=1e-300))
    found = run(name, "elqr", fault=still.with_disturbance(Disturbance()), count=20)
    assert np.max(np.abs(found.pressure)) < 1e-40


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"substeps": 0}, "substeps"),
        ({"substeps": 1.5}, "substeps"),
        ({"authority": 0.0}, "authority"),
        ({"weight": 0.5}, "weight is a setting of compensated, stick-slip. Received it with the scheme explicit"),
    ],
)
def test_meaningless_settings_are_refused(options, said):
    with pytest.raises(ParameterError, match=said):
        simulation_scheme("explicit", **options)


def test_the_continuous_scheme_has_no_settings():
    with pytest.raises(ParameterError, match=r"substeps is a setting of compensated, .* with the scheme continuous"):
        run("continuous", substeps=2)
    with pytest.raises(ParameterError, match="Set these in the scheme"):
        run(simulation_scheme("explicit"), substeps=2)


def test_published_gains_run_with_the_fault_s_own_input_gain():
    """Their divisor is five orders too large for the real fault (ERRATA 15), so that it says nothing about β."""
    found = simulate(
        REAL, published("real-fault")["cta"], scheme="implicit", duration=2000.0, samples=10, compiled=False
    )
    assert found.metrics.max_slip_rate_error < 1e-5
