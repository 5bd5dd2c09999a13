"""Closed loops against other people's integrators and against themselves."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from thinned import few

from quakedesign.errors import ParameterError, SimulationError
from quakedesign.fault import Disturbance, load_fault
from quakedesign.laws import published
from quakedesign.simulation import simulate

REAL = load_fault("real-fault")
LAB = load_fault("lab-fault")
LAWS = ("cta", "dia", "elqr")


def coefficient(fault, slip):
    """Eq. mu, typed in again."""
    law = fault.friction
    return law.residual + law.drop * math.exp(-max(slip, 0.0) / law.critical_slip)


def acceleration(fault, t, slip, rate, pressure):
    """Eq. shift, typed in again in floats: measured from the equilibrium at rest."""
    stress, load = fault.effective_normal_stress, fault.disturbance
    friction = coefficient(fault, slip) * (stress - pressure) - coefficient(fault, 0.0) * stress
    shaking = load.constant + load.amplitude * math.sin(load.frequency * t) + load.slip_growth * slip
    return shaking - fault.authority * friction - fault.specific_stiffness * slip - fault.specific_damping * rate


def reference(fault, t):
    stage = min(t / fault.reference.operation_time, 1.0)
    target = fault.reference.target_slip
    rate = 30 * stage**2 * (1 - stage) ** 2 * target / fault.reference.operation_time
    return target * stage**3 * (10 - 15 * stage + 6 * stage**2), rate


def elqr_field(fault, gains):
    def field(t, y):
        slip, rate, first, _ = y
        pressure = -float(np.dot(gains, y))
        error = slip - reference(fault, t)[0]
        return [rate, acceleration(fault, t, slip, rate, pressure), error, first]

    return field


@pytest.mark.slow
@pytest.mark.parametrize(("fault", "step", "duration"), [(REAL, 0.0046, 400.0), (LAB, 2e-5, 2.0)], ids=["real", "lab"])
def test_the_linear_law_agrees_with_scipy(fault, step, duration):
    """The early slip swings through zero, where friction has a kink and a fixed step its second order only."""
    controller = published(fault.name)["elqr"]
    gains = [float(gain) for gain in controller.gains.values()]
    run = simulate(fault, controller, step=step, duration=duration, samples=50, plant="printed")
    scale = np.max(np.abs([run.slip, run.slip_rate]), axis=1)
    oracle = solve_ivp(
        elqr_field(fault, gains),
        (0, run.time[-1]),
        np.zeros(4),
        method="DOP853",
        t_eval=run.time,
        rtol=1e-10,
        atol=[scale[0] * 1e-11, scale[1] * 1e-11, 1e-16, 1e-16],
    )
    assert np.max(np.abs(oracle.y[0] - run.slip)) < 1e-6 * scale[0]
    assert np.max(np.abs(oracle.y[1] - run.slip_rate)) < 1e-6 * scale[1]
    assert np.allclose(run.pressure, -np.array(gains) @ oracle.y, rtol=0, atol=1e-5 * np.max(np.abs(run.pressure)))


def test_the_uncontrolled_fault_agrees_with_scipy():
    run = simulate(REAL, step=0.02, duration=60.0, samples=60, plant="printed")
    oracle = solve_ivp(
        lambda t, y: [y[1], acceleration(REAL, t, *y, 0.0)],
        (0, run.time[-1]),
        [0.0, 0.0],
        method="Radau",
        t_eval=run.time,
        rtol=1e-10,
        atol=1e-14,
    )
    assert np.max(np.abs(oracle.y[0] - run.slip)) < 1e-6 * np.max(np.abs(run.slip))


def test_a_fault_without_weakening_is_a_forced_oscillator():
    """Closed form: linear, critically damped or not, under a constant acceleration."""
    linear = dataclasses.replace(REAL, friction=dataclasses.replace(REAL.friction, drop=0.0))
    run = simulate(linear.with_disturbance(Disturbance(constant=1e-3)), step=0.01, duration=20.0, samples=100)
    decay, frequency = REAL.specific_damping / 2, REAL.natural_frequency
    root = math.sqrt(decay**2 - frequency**2)
    motion = np.cosh(root * run.time) + decay / root * np.sinh(root * run.time)
    expected = 1e-3 / frequency**2 * (1 - np.exp(-decay * run.time) * motion)
    assert np.allclose(run.slip, expected, rtol=1e-9, atol=1e-16)


@few("law", LAWS, every=3)
@pytest.mark.parametrize("fault", [REAL, LAB], ids=["real", "lab"])
def test_both_backends_give_the_same_digits(fault, law, monkeypatch):
    monkeypatch.setattr("quakedesign.simulation.compiled._WORTH", 0)
    setting = {"duration": 5003 * fault.sampling_time, "samples": 40}
    fast = simulate(fault, published(fault.name)[law], **setting)
    if fast.provenance["backend"] != "compiled":
        pytest.skip(fast.provenance["backend_reason"])
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    slow = simulate(fault, published(fault.name)[law], **setting)
    assert slow.provenance["backend"] == "virtual-machine"
    assert "compiler" in slow.provenance["backend_reason"]
    for name, (values, _, _) in fast.signals().items():
        assert np.array_equal(values, slow.signals()[name][0]), name
    same = {"seconds": 0.0}
    assert dataclasses.replace(fast.metrics, **same) == dataclasses.replace(slow.metrics, **same)
    assert fast.events == slow.events


@pytest.mark.slow
def test_a_run_that_is_shorter_than_a_compilation_is_not_compiled():
    short, long = (simulate(LAB, published("lab-fault")["cta"], duration=d, samples=2) for d in (0.1, 2000.0))
    assert (short.provenance["backend"], short.provenance["backend_reason"]) == (
        "virtual-machine",
        "the run is shorter than a compilation",
    )
    assert "shorter" not in long.provenance["backend_reason"]


def test_a_broken_compiler_falls_back_or_is_reported(monkeypatch):
    monkeypatch.setattr("quakedesign.simulation.compiled._WORTH", 0)
    monkeypatch.setenv("CC", "false")
    run = simulate(LAB, published("lab-fault")["cta"], duration=0.1)
    assert run.provenance["backend"] == "virtual-machine"
    assert "failed" in run.provenance["backend_reason"]
    with pytest.raises(SimulationError, match="compiler"):
        simulate(LAB, published("lab-fault")["cta"], duration=0.1, compiled=True)


def test_every_step_is_taken_whatever_is_kept():
    """4099 steps are no multiple of any stride or chunk; the end must not depend on how they are cut."""
    controller = published("real-fault")["cta"]
    runs = [simulate(REAL, controller, duration=4099.5 * 0.184, samples=n, compiled=False) for n in (1, 7, 2000, 4099)]
    assert {run.metrics.steps for run in runs} == {4099}
    assert {run.time[-1] for run in runs} == {4099 * 0.184}
    assert {(run.slip[-1], run.metrics.rms_pressure, run.metrics.max_h_rate) for run in runs} == {
        (runs[0].slip[-1], runs[0].metrics.rms_pressure, runs[0].metrics.max_h_rate)
    }
    assert [run.time.size for run in runs] == [2, 8, 1368, 4100]


def test_a_float_that_means_ten_steps_gives_ten():
    assert simulate(REAL, duration=10 * 0.184 - 1e-12, samples=3, compiled=False).metrics.steps == 10


@pytest.mark.parametrize("law", LAWS)
def test_the_reference_rests_after_the_operation(law):
    brief = dataclasses.replace(LAB, reference=dataclasses.replace(LAB.reference, target_slip=1e-4, operation_time=2.0))
    run = simulate(brief, published("lab-fault")[law], duration=3.0, samples=300)
    after = run.time > 2.0
    assert np.allclose(run.reference, [reference(brief, t)[0] for t in run.time], rtol=1e-12, atol=1e-18)
    assert np.allclose(run.reference_rate, [reference(brief, t)[1] for t in run.time], rtol=1e-9, atol=1e-18)
    assert np.all(run.reference_rate[after] == 0)
    assert np.allclose(run.reference[after], 1e-4, rtol=1e-14)


def test_a_destabilising_law_is_named_and_has_no_metrics():
    good = published("real-fault")["elqr"]
    bad = dataclasses.replace(good, gains={name: -value for name, value in good.gains.items()})
    run = simulate(REAL, bad, duration=20000.0, plant="printed")
    assert 0 < run.events["diverged"] < 20000.0
    assert run.events["opening"] < run.events["diverged"]
    assert run.metrics.max_slip_error is None
    assert run.metrics.peak_slip_rate is None
    assert run.metrics.steps == round(run.events["diverged"] / 0.184)
    assert np.all(np.isfinite(run.slip))
    assert run.time[-1] < run.events["diverged"]


def test_reverse_slip_is_named_at_its_first_step():
    run = simulate(REAL, published("real-fault")["cta"], duration=200.0, samples=5000, plant="printed")
    assert run.events["reverse_slip"] == run.time[np.argmax(run.slip_rate < 0)]
    assert "diverged" not in run.events


def test_progress_rises_to_one():
    said = []
    simulate(LAB, published("lab-fault")["cta"], duration=1.0, samples=10, progress=said.append)
    assert said == sorted(said)
    assert said[-1] == 1.0
    assert len(said) == 10


def test_an_interrupt_leaves_the_loop():
    def stop(done):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate(LAB, published("lab-fault")["cta"], duration=1.0, progress=stop)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"step": 0.0}, "step must be positive"),
        ({"step": math.nan}, "step must be positive"),
        ({"duration": -1.0}, "duration must be positive"),
        ({"duration": math.inf}, "duration must be positive"),
        ({"duration": 1e-9}, "1 to"),
        ({"samples": 0}, "samples"),
        ({"samples": 2.5}, "samples"),
        ({"settled_from": -1.0}, "settled_from"),
        ({"scheme": "telepathic"}, "continuous.*'telepathic'"),
        ({"method": "euler"}, "dormand-prince"),
    ],
)
def test_meaningless_settings_are_refused(options, said):
    with pytest.raises(ParameterError, match=said):
        simulate(LAB, **options)


@pytest.mark.slow
@few(
    ("law", "bounds"),
    [
        ("cta", {"max_slip_rate_error": (5.4e-3, 6.0e-3)}),
        ("elqr", {"max_slip_error": (0.8e-3, 1.2e-3)}),
    ],
    every=2,
)
def test_the_published_gains_give_the_papers_errors(law, bounds):
    """Section IV-A: 2-CTA rate error about 5.7e-3 m/s (ERRATA 14), e-LQR slip error about 1 mm (ERRATA 29)."""
    figures = simulate(REAL, published("real-fault")[law], plant="printed").metrics.to_dict()
    for name, (low, high) in bounds.items():
        assert low < figures[name] < high


@pytest.mark.parametrize("rtol", [math.nan, math.inf, 0.0, -1e-9, 1e300])
def test_a_tolerance_means_something_with_every_method(rtol):
    for method in ("dormand-prince", "cvodes"):
        with pytest.raises(ParameterError, match="rtol must be between"):
            simulate(LAB, duration=0.01, method=method, rtol=rtol)


@pytest.mark.parametrize("begin", [math.nan, -1.0, 0.02, 1e300, math.inf])
def test_errors_count_from_a_time_of_the_run(begin):
    with pytest.raises(ParameterError, match="settled_from must be at least 0 s and less than the duration"):
        simulate(LAB, duration=0.02, settled_from=begin)
