import dataclasses

import numpy as np
import pytest
from thinned import few

from quakedesign.errors import ParameterError, SimulationError
from quakedesign.fault import friction_law, load_fault
from quakedesign.simulation import earthquake as memoryless_earthquake
from quakedesign.simulation import natural_earthquake

REAL = load_fault("real-fault")


def test_the_real_fault_slips_as_fast_as_in_the_paper():
    """Section IV: 20 times the 3.5e-3 m/s of the laboratory's scale, then rest at the next equilibrium."""
    run = natural_earthquake(REAL)
    assert run.metrics.peak_slip_rate == pytest.approx(0.07, rel=0.1)
    assert run.slip[-1] == pytest.approx(REAL.rest_slip, rel=1e-6)
    assert abs(run.slip_rate[-1]) < 1e-6
    assert np.all(run.pressure == 0)


def test_the_laboratory_fault_ends_at_its_rest_slip():
    lab = load_fault("lab-fault")
    assert natural_earthquake(lab).slip[-1] == pytest.approx(lab.rest_slip, rel=1e-6)


def test_injected_fluid_makes_it_larger():
    """Where the spring has unloaded to residual friction at the lower effective stress."""
    run = natural_earthquake(REAL, 5e6)
    law, stress, stiffness = REAL.friction, REAL.effective_normal_stress, REAL.stiffness / REAL.area
    final = run.slip[-1]
    strength = (law.residual + law.drop * np.exp(-final / law.critical_slip)) * (stress - 5e6)
    assert strength == pytest.approx(law.bounds[1] * stress - stiffness * final, rel=1e-9)
    assert run.metrics.peak_slip_rate > natural_earthquake(REAL).metrics.peak_slip_rate


def test_a_stable_fault_stays():
    stable = dataclasses.replace(REAL, friction=dataclasses.replace(REAL.friction, drop=0.0))
    run = natural_earthquake(stable)
    assert run.metrics.peak_slip_rate == 0
    assert run.time[-1] == pytest.approx(200 * np.pi / REAL.natural_frequency, rel=1e-3)


@pytest.mark.parametrize("pressure", [50e6, -60e6, float("nan")])
def test_a_pressure_that_opens_the_fault_is_refused(pressure):
    with pytest.raises(ParameterError, match="effective normal stress"):
        natural_earthquake(REAL, pressure)


LAB = load_fault("lab-fault")
LINEAR = friction_law("linear-slip-weakening")(residual=0.4, drop=0.17, critical_slip=2.5e-3)
LAWS = {
    "exponential": LAB,
    "linear": dataclasses.replace(LAB, friction=LINEAR),
    "rate": dataclasses.replace(
        LAB, friction=friction_law("slip-rate-weakening")(residual=0.4, drop=0.17, critical_rate=0.02)
    ),
}


def weakening_then_residual(fault):
    """Peak slip rate [m/s] of linear weakening out of unstable rest: two linear oscillators, joined at the kink.

    Before it x'' = s²x − η̂x' with s² = N̂σ'Δμ/d_c − k̂ along the unstable eigenvector x' = λx; after it
    x'' = N̂σ'Δμ − k̂x − η̂x'. The peak is where x'' = 0.
    """
    k, eta, law = fault.specific_stiffness, fault.specific_damping, fault.friction
    drop = fault.authority * fault.effective_normal_stress * law.drop
    growth = -eta / 2 + np.sqrt(eta**2 / 4 + drop / law.critical_slip - k)
    slow, fast = np.roots([1, eta, k])
    offset, rate = law.critical_slip - drop / k, growth * law.critical_slip
    a = (rate - fast * offset) / (slow - fast)
    b = offset - a
    peak = np.log(-b * fast**2 / (a * slow**2)) / (slow - fast)
    return float(np.real(a * slow * np.exp(slow * peak) + b * fast * np.exp(fast * peak)))


def test_linear_weakening_in_the_laboratory_peaks_where_two_oscillators_meet():
    run = natural_earthquake(LAWS["linear"])
    assert run.metrics.peak_slip_rate == pytest.approx(weakening_then_residual(LAWS["linear"]), rel=5e-7)
    assert run.slip[-1] == pytest.approx(LAWS["linear"].rest_slip, rel=1e-6)


@pytest.mark.slow
@few("fault", [LAWS["exponential"], LAWS["linear"]], ids=["exponential", "linear"], every=2)
def test_the_peak_depends_neither_on_the_nudge_nor_on_the_step(monkeypatch, fault):
    """To the six digits that are printed."""
    peaks = {f"{natural_earthquake(fault).metrics.peak_slip_rate:.6g}"}
    for name, value in (("NUDGE", 1e-10), ("NUDGE", 7e-9), ("FINENESS", 1.3e-3), ("FINENESS", 9e-4)):
        with monkeypatch.context() as changed:
            changed.setattr(memoryless_earthquake, name, value)
            peaks.add(f"{natural_earthquake(fault).metrics.peak_slip_rate:.6g}")
    assert len(peaks) == 1


@pytest.mark.slow
def test_every_law_without_state_has_an_earthquake_where_it_is_unstable():
    for fault in LAWS.values():
        assert natural_earthquake(fault).metrics.peak_slip_rate > 1e-3


def test_fast_weakening_is_simulated_until_the_slow_spring_has_unloaded():
    """Weakening over 1 µm grows a hundred times faster than the fault swings; the rest is at (μ_max − μ_res)σ'A/k."""
    brittle = dataclasses.replace(LAB, friction=dataclasses.replace(LAB.friction, critical_slip=1e-6))
    run = natural_earthquake(brittle)
    assert run.slip[-1] == pytest.approx(0.17 * 1e5 * 0.1 / 225.5e3, rel=1e-6)


def test_an_unstable_fault_that_does_not_move_is_a_defect(monkeypatch):
    monkeypatch.setattr(memoryless_earthquake, "NUDGE", 1e-22)
    with pytest.raises(SimulationError, match=r"lab-fault is unstable .* but it stays at rest in simulation"):
        natural_earthquake(LAWS["linear"])


@pytest.mark.slow
def test_the_measure_of_events_is_found_with_the_event(monkeypatch):
    """Whatever disturbance and box the fault has; under pressure or without stick it is another event."""
    monkeypatch.setattr(memoryless_earthquake, "_PEAKS", {})
    runs, run = [], memoryless_earthquake.run
    monkeypatch.setattr(memoryless_earthquake, "run", lambda *given, **more: runs.append(1) or run(*given, **more))
    natural_earthquake(LAB, plant="printed")
    peak = memoryless_earthquake.natural_peak(LAB)
    assert len(runs) == 2
    event = natural_earthquake(LAB, compiled=False)
    assert event.criterion.natural_peak == event.metrics.peak_slip_rate == peak
    assert natural_earthquake(LAB, 1e3, compiled=False).criterion.natural_peak == peak
    assert memoryless_earthquake.natural_peak(LAB.with_box("ten-percent")) == peak
    assert len(runs) == 4


@pytest.mark.slow
def test_no_more_measures_are_kept_than_are_asked_for_again(monkeypatch):
    monkeypatch.setattr(memoryless_earthquake, "_PEAKS", {})
    monkeypatch.setattr(memoryless_earthquake, "_MOST_PEAKS", 1)
    stable = [
        dataclasses.replace(LAB, friction=dataclasses.replace(LAB.friction, drop=0.0, residual=r)) for r in (0.3, 0.4)
    ]
    assert [memoryless_earthquake.natural_peak(fault) for fault in stable] == [None, None]
    assert list(memoryless_earthquake._PEAKS) == [memoryless_earthquake._alone(stable[1])]


def test_the_natural_peak_is_computed_once_for_all_tasks_of_a_fault(monkeypatch):
    """A run without control has no task: the peak of another operation time is that of a run with it."""
    fault = load_fault("lab-fault")
    other = dataclasses.replace(
        fault, reference=dataclasses.replace(fault.reference, operation_time=3 * fault.reference.operation_time)
    )
    monkeypatch.setattr(memoryless_earthquake, "_PEAKS", {})
    expected = memoryless_earthquake.natural_earthquake(other, compiled=False).criterion.natural_peak
    monkeypatch.setattr(memoryless_earthquake, "natural_earthquake", None)
    assert memoryless_earthquake.natural_peak(fault) == memoryless_earthquake.natural_peak(other) == expected
