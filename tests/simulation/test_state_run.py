"""Rate-and-state spring-sliders against the printed results of other codes and against other formulations.

Printed digits of other codes: velocity steps of rsfmodel and of Marone's simulator, slide-hold-slide of the latter, and
the onset of a stick-slip run of QDYN (its frozen cycles are binary pickles and cannot be read as text). Whole cycles
are compared with QDYN's equations, stress and state as variables, in another integrator.
"""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import lambertw
from thinned import few

from quakedesign.errors import ParameterError, SimulationError
from quakedesign.fault import friction_law, load_fault
from quakedesign.fault.model import magnitude
from quakedesign.simulation import SpringSlider, simulate_state, velocity_step
from quakedesign.symbolic import rate_and_state_plant as state_plant

DATA = Path(__file__).parent.parent / "data"
MICRON = 1e-6
RANGE = {"slowest_rate": 1e-14, "fastest_rate": 10.0}


def law(name="rate-and-state-aging", **changes):
    """The law of rsfmodel's examples (rates in m/s)."""
    parameters = {
        "reference_coefficient": 0.6,
        "direct_effect": 0.005,
        "evolution_effect": 0.01,
        "critical_slip": 10 * MICRON,
        "reference_rate": MICRON,
    }
    return friction_law(name)(**(parameters | RANGE | changes))


# examples/notebooks/RSF_spring-block.ipynb of ydluo/qdyn: stiffness MU/L, radiation damping MU/(2 VS)
QDYN_LAW = law(direct_effect=0.01, evolution_effect=0.015, critical_slip=1e-5, reference_rate=1e-5)
QDYN = SpringSlider(law=QDYN_LAW, stiffness=2e9, normal_stress=5e6, damping=2e9 / 3000 / 2)


def printed(name):
    lines = (DATA / f"{name}.csv").read_text().splitlines()
    head, *rows = (line.split(",") for line in lines if not line.startswith("#"))
    return dict(zip(head, np.array(rows, dtype=float).T, strict=True))


def test_a_velocity_step_of_rsfmodel_to_its_printed_digits():
    """jrleeman/rsfmodel, tests/rsf_tests.py, TestDeiterichOneStateVar2."""
    expected = printed("rsfmodel_velocity_step")
    run = velocity_step(law(), 1e-3 / MICRON, [(10.0, MICRON), (30.0, 10 * MICRON)], times=expected["time"])
    assert np.max(np.abs(run.friction - expected["friction"])) < 5.1e-9


def test_the_extremes_of_rsfmodels_velocity_step():
    """jrleeman/rsfmodel, tests/rsf_tests.py, TestDeiterichOneStateVar: value to 8 decimals and row of each extreme."""
    times = np.arange(0, 40.005, 0.01)
    run = velocity_step(law(), 1e-3 / MICRON, [(10.0, MICRON), (30.0, 10 * MICRON)], times=times)
    found = {
        "largest friction": (np.argmax(run.friction), np.max(run.friction), 1129, 0.60784356),
        "smallest friction": (np.argmin(run.friction), np.min(run.friction), 1322, 0.58362349),
        "smallest state": (np.argmin(run.states), np.min(run.states), 1282, 0.51710192),
        "largest rate": (np.argmax(run.slip_rate), np.max(run.slip_rate) / MICRON, 1231, 35.26869330),
    }
    for name, (row, value, expected_row, expected) in found.items():
        assert row == expected_row, name
        assert abs(value - expected) < 1.5e-8, name


def test_a_velocity_step_of_marones_simulator_to_nine_decimals():
    """rsfmodel's cjm_model_comparison/cjm_model.tim, which prints two rows, up to 1e-7 s, before the step."""
    expected = printed("marone_velocity_step")
    times = 1.0 + expected["time"] - 1e-7
    run = velocity_step(law(), 1e-3 / MICRON, [(1.0, MICRON), (9.0, 10 * MICRON)], times=times)
    assert np.max(np.abs(run.friction - expected["friction"])) < 1.1e-9


def test_slide_hold_slide_of_marones_simulator_to_nine_decimals():
    """rsfmodel's cjm_model_comparison/cjm_shs.tim: a hold of 100 s."""
    expected = printed("marone_slide_hold_slide")
    loading = [(1.0, MICRON), (100.0, 0.0), (60.0, MICRON)]
    run = velocity_step(law(), 1e-3 / MICRON, loading, times=1.0 + expected["time"])
    assert np.max(np.abs(run.friction - expected["friction"])) < 1.1e-9


def test_the_onset_of_qdyns_stick_slip_to_its_printed_digits():
    """ydluo/qdyn, examples/notebooks/RSF_spring-block.ipynb: ten rows that its notebook prints.

    QDYN's first Runge–Kutta–Fehlberg stage sees no slip (in every row the slip lags the time by 8.07 µs, 16/135 of the
    first step: the weight of that stage), so that state and stress start with what ageing and loading add meanwhile.
    """
    expected = printed("qdyn_spring_block")
    lag = 16 / 119 * expected["slip"][0] / 1.01e-5
    stress = 5e6 * (0.6 + 0.01 * math.log(1.01)) + 2e9 * 1e-5 * lag
    rate = 1e-5 * math.exp((stress / 5e6 - 0.6 - 0.015 * math.log1p(lag)) / 0.01)
    run = simulate_state(
        QDYN,
        1e-5,
        duration=2.0,
        start_rate=rate,
        start_state=(1 + lag,),
        times=expected["time"] - lag,
        method="dop853",
        rtol=1e-12,
    )
    half_a_digit_of_time = 5e-7
    assert np.all(np.abs(run.slip - expected["slip"]) < run.slip_rate * half_a_digit_of_time * 1.02)
    assert np.all(np.abs(run.states[0] - expected["theta"]) < 5.3e-7)
    assert np.all(np.abs(run.friction * 5e6 - expected["tau"]) < 0.51)
    assert np.all(np.abs(run.slip / expected["slip"] - 1)[-3:] < 1e-6)


# test/stickslip.py and test/test_suite.py of ydluo/qdyn, mode "RSF": MU 2e10 Pa, L 10 m, 1 µm/s
QDYN_TEST = SpringSlider(
    law=law(direct_effect=0.01, evolution_effect=0.025, critical_slip=1e-5, reference_rate=MICRON),
    stiffness=2e9,
    normal_stress=5e6,
    damping=2e10 / 3000 / 2,
)


def log_rate(slider, stress, theta):
    """log(v/v_0) from the logarithmic law."""
    a, b, d = (getattr(slider.law, name) for name in ("direct_effect", "evolution_effect", "critical_slip"))
    return (stress / slider.normal_stress - 0.6 - b * math.log(slider.law.reference_rate * theta / d)) / a


def qdyn_field(slider):
    """QDYN's equations (van den Ende et al. 2018; derivs_all.f90), typed in again: stress and state."""
    a, b, d = (getattr(slider.law, name) for name in ("direct_effect", "evolution_effect", "critical_slip"))

    def field(t, y):
        rate = slider.law.reference_rate * math.exp(log_rate(slider, *y))
        by_stress, by_theta = rate / (slider.normal_stress * a), -rate * b / a / y[1]
        ageing = 1 - rate * y[1] / d
        loading = slider.stiffness * (slider.law.reference_rate - rate) - slider.damping * by_theta * ageing
        return [loading / (1 + slider.damping * by_stress), ageing]

    return field


def qdyn_cycles(slider, method, rtol, duration):
    """Times at which the rate rises through ten times the loading rate."""

    def crossing(t, y):
        return log_rate(slider, *y) - math.log(10.0)

    crossing.direction = 1
    faster = math.log(1.01e-5 / slider.law.reference_rate) * slider.law.direct_effect
    aged = math.log(slider.law.reference_rate / slider.law.critical_slip) * slider.law.evolution_effect
    start = [slider.normal_stress * (0.6 + faster + aged), 1.0]
    options = {"method": method, "rtol": rtol, "atol": np.array([5e6, 1.0]) * rtol * 1e-3}
    return solve_ivp(qdyn_field(slider), (0, duration), start, events=crossing, **options).t_events[0]


@pytest.mark.slow
@pytest.mark.parametrize(("slider", "duration", "events"), [(QDYN, 300.0, 10), (QDYN_TEST, 1e4, 17)])
def test_stick_slip_cycles_agree_with_qdyns_equations_in_stress_and_state(slider, duration, events):
    """The parameters of QDYN's notebook and of its test-suite."""
    run = simulate_state(
        slider,
        slider.law.reference_rate,
        duration=duration,
        start_rate=1.01e-5,
        start_state=(1.0,),
        method="dop853",
        rtol=1e-12,
    )
    expected = qdyn_cycles(slider, "DOP853", 1e-12, duration)
    assert len(expected) == events
    assert np.max(np.abs(run.onsets / expected - 1)) < 1e-9
    assert np.max(np.abs(run.imbalance)) < 1e-10


@pytest.mark.slow
def test_the_recurrence_interval_converges_under_tolerance_refinement():
    """Its relative error stays below the tolerance over four and six decades."""
    exact = np.diff(qdyn_cycles(QDYN, "DOP853", 1e-13, 300.0))[-1]
    for method, tolerances in (("dop853", (1e-5, 1e-7, 1e-9, 1e-11)), ("radau", (1e-4, 1e-6, 1e-8))):
        for rtol in tolerances:
            run = simulate_state(QDYN, 1e-5, duration=300.0, start_rate=1.01e-5, method=method, rtol=rtol)
            assert abs(run.recurrence_intervals[-1] / exact - 1) < rtol


@pytest.mark.parametrize("evolution", ["rate-and-state-aging", "rate-and-state-slip"])
def test_the_rate_solved_from_the_balance_of_forces_gives_the_same_motion(evolution):
    """Stretch and state as variables; the rate by Lambert's function from Nμ + ηv = ks. With damping, after a step."""
    chosen = law(evolution)
    slider = SpringSlider(law=chosen, stiffness=600.0, normal_stress=1.0, damping=50.0)
    times = np.linspace(0, 60, 121)
    run = simulate_state(slider, 3 * MICRON, duration=60.0, start_rate=MICRON, times=times, method="dop853", rtol=1e-12)

    def rate(stretch, theta):
        driving = (600.0 * stretch - 0.6 - 0.01 * math.log(0.1 * theta)) / 0.005
        scale = 0.005 / 50.0
        return scale * lambertw(MICRON / scale * math.exp(driving)).real

    def field(t, y):
        v = rate(*y)
        share = v * y[1] / 1e-5
        ageing = 1 - share if evolution.endswith("aging") else -share * math.log(share)
        return [3 * MICRON - v, ageing]

    start = [(0.6 + 50.0 * MICRON) / 600.0, 10.0]
    oracle = solve_ivp(field, (0, 60), start, method="DOP853", t_eval=times, rtol=1e-12, atol=1e-17)
    assert np.max(np.abs(run.stretch / oracle.y[0] - 1)) < 1e-9
    assert np.max(np.abs(run.states[0] / oracle.y[1] - 1)) < 1e-8
    assert np.max(np.abs(run.slip + run.stretch - run.stretch[0] - run.load_point)) < 1e-15


@pytest.mark.slow
def test_with_inertia_it_agrees_with_the_unlogged_equations():
    """Slip, rate and state as such, in an implicit method of another family; the interval converges to theirs."""
    slider = dataclasses.replace(QDYN, mass=2000.0)
    runs = [simulate_state(slider, 1e-5, duration=120.0, start_rate=2e-5, rtol=rtol) for rtol in (1e-5, 1e-7, 1e-8)]

    def field(t, y):
        stretch, v, theta = y
        friction = 0.6 + 0.01 * math.log(v / 1e-5) + 0.015 * math.log(theta)
        return [1e-5 - v, (2e9 * stretch - 5e6 * friction - QDYN.damping * v) / 2000.0, 1 - v * theta / 1e-5]

    def onset(t, y):
        return math.log(y[1] / 1e-4)

    onset.direction = 1
    start, tolerances = [runs[0].stretch[0], 2e-5, 0.5], [1e-17, 1e-19, 1e-12]
    oracle = solve_ivp(field, (0, 120), start, method="LSODA", events=onset, rtol=1e-11, atol=tolerances)
    expected = oracle.t_events[0]
    assert len(expected) == 5
    assert np.max(np.abs(runs[-1].onsets / expected - 1)) < 1e-8
    errors = [abs(run.recurrence_intervals[-1] / np.diff(expected)[-1] - 1) for run in runs]
    assert errors[0] > 5 * errors[1] > 25 * errors[2]
    assert errors[-1] < 1e-9


@few("mass", [0.0, 2e9], every=2)
def test_small_perturbations_grow_as_the_derived_eigenvalues_say(mass):
    """det(λE − J) of `state_plant.characteristic` with numbers, against the simulated growth between two peaks."""
    slider = SpringSlider(law=law(), stiffness=450.0, normal_stress=1.0, damping=20.0, mass=mass)
    hats = {
        state_plant.k_hat: 450.0 / (mass or 1),
        state_plant.eta_hat: 20.0 / (mass or 1),
        state_plant.N_hat: 1 / (mass or 1),
        state_plant.effective_stress: 1.0,
    }
    at = {symbol: value.subs(state_plant.loading_rate, MICRON) for symbol, value in state_plant.slopes(law()).items()}
    powers = state_plant.characteristic(("theta",), inertia=bool(mass))
    roots = np.roots([float(power.subs(at).subs(hats)) for power in powers])
    fastest = roots[np.argmax(roots.real)]
    period = 2 * math.pi / abs(fastest.imag)
    times = np.linspace(0, 6 * period, 601)
    run = simulate_state(
        slider,
        MICRON,
        duration=6 * period,
        start_rate=MICRON,
        start_state=(10.0 * (1 + 1e-7),),
        times=times,
        method="radau" if mass else "dop853",
        rtol=1e-12,
    )
    ripple = np.log(run.states[0] / 10.0)
    growth = np.log(np.max(np.abs(ripple[500:])) / np.max(np.abs(ripple[300:401])))
    assert growth == pytest.approx(2 * period * fastest.real, abs=2e-3)


def test_the_critical_stiffness_separates_decay_from_growth():
    """Ruina (1983): k_c = (b − a)/d_c per unit normal stress, without damping."""
    critical = (0.01 - 0.005) / (10 * MICRON)
    ripples = []
    for share in (0.97, 1.03):
        run = velocity_step(law(), share * critical, [(1.0, MICRON), (600.0, 1.0001 * MICRON)])
        late, early = (run.friction[(run.time > t) & (run.time < t + 80)] for t in (520, 20))
        ripples.append(np.ptp(late) / np.ptp(early))
    assert ripples[0] > 1.2
    assert ripples[1] < 0.8


@pytest.mark.slow
def test_a_fault_has_earthquakes_years_apart():
    """The paper's fault with rate-and-state friction: with inertia and without the same cycles within a few percent."""
    friction = law(critical_slip=0.02, reference_rate=1e-6)
    fault = dataclasses.replace(load_fault("real-fault"), friction=friction)
    year = 3.15576e7
    runs = [
        simulate_state(fault, 1e-9, duration=200 * year, start_rate=2e-9, inertia=inertia, method=method, rtol=rtol)
        for inertia, method, rtol in ((True, "radau", 1e-6), (False, "dop853", 1e-8))
    ]
    for run in runs:
        assert len(run.onsets) >= 3
        assert np.max(run.slip_rate) > 1e-3
        assert np.ptp(run.recurrence_intervals[1:]) < 1e-3 * run.recurrence_intervals[-1]
        # what the spring loses in an event, and regains at the loading rate until the next one
        regained = 1e-9 * run.recurrence_intervals[-1]
        assert run.event_slips[-1] == pytest.approx(regained, rel=0.1)
        assert 5.8 < magnitude(fault.moment_of(run.event_slips[-1])) < 5.9  # Hanks and Kanamori of G A D
    intervals = [run.recurrence_intervals[-1] for run in runs]
    assert intervals[0] == pytest.approx(intervals[1], rel=0.05)


def test_the_regularised_law_gives_the_same_velocity_step_where_the_logarithm_holds():
    runs = [
        velocity_step(law(name), 1e3, [(10.0, MICRON), (30.0, 10 * MICRON)], times=[5.0, 12.0, 20.0, 40.0])
        for name in ("rate-and-state-aging", "regularised-rate-and-state")
    ]
    assert np.max(np.abs(runs[0].friction - runs[1].friction)) < 1e-10


def test_the_regularised_law_does_not_overflow_for_a_small_direct_effect():
    """μ/a is about 1500 there; e^1500 is no float."""
    small = {"direct_effect": 4e-4, "evolution_effect": 8e-4}
    runs = [
        velocity_step(law(name, **small), 1e3, [(10.0, MICRON), (30.0, 10 * MICRON)], times=[5.0, 12.0, 20.0, 40.0])
        for name in ("rate-and-state-aging", "regularised-rate-and-state")
    ]
    assert np.ptp(runs[0].friction) > 5e-4
    assert np.max(np.abs(runs[0].friction - runs[1].friction)) < 1e-10


def test_without_inertia_and_damping_an_event_runs_away_and_says_so():
    with pytest.raises(SimulationError, match="slip rate stays finite"):
        velocity_step(law(), 200.0, [(10.0, MICRON), (200.0, 10 * MICRON)], rtol=1e-8)


def test_a_run_can_be_handed_on():
    run = simulate_state(QDYN, [(1.0, 1e-5), (1.0, 2e-5)], method="dop853")
    data = run.to_xarray()
    assert data["theta"].attrs["units"] == "s"
    assert data["slip"].attrs == {"long_name": "slip", "units": "m"}
    assert data.attrs["method"] == "dop853"
    assert list(run.to_pandas().columns)[-1] == "theta [s]"
    assert run.load_point[-1] == pytest.approx(3e-5, rel=1e-14)
    assert np.all(np.diff(run.time) > 0)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"loading": 1e-5}, "loading must be one rate together with duration"),
        ({"loading": [(1.0, 1e-5)], "duration": 1.0}, "loading must be one rate together with duration"),
        ({"loading": []}, "at least one pair"),
        (
            {"loading": 1e-5, "duration": 1e13},
            r"at most 1e\+07 critical slips, .*Received 1e\+08 m. Shorten",
        ),
        ({"loading": [(1.0, -1e-5)]}, "finite rate ≥ 0"),
        ({"loading": [(math.inf, 1e-5)]}, "positive, finite length"),
        ({"loading": [(1.0, 0.0)]}, "start_rate must be positive"),
        ({"loading": [(1.0, 1e-5)], "start_state": (1.0, 2.0)}, "1 values"),
        ({"loading": [(1.0, 1e-5)], "start_state": (-1.0,)}, "theta must be positive"),
        ({"loading": [(1.0, 1e-5)], "times": [0.5, 0.4]}, "times must ascend"),
        ({"loading": [(1.0, 1e-5)], "times": [2.0]}, "times must ascend"),
        ({"loading": [(1.0, 1e-5)], "method": "euler"}, "dop853, radau.*cvodes, idas"),
        ({"loading": [(1.0, 1e-5)], "rtol": 1e-16}, "rtol must be"),
        ({"loading": 1e-6, "duration": 4.4e18}, r"duration must be at most 1e\+14 s, got 4.4e\+18 s"),
        ({"loading": [(9e13, 1e-6), (2e13, 0.0)]}, r"duration must be at most 1e\+14 s, got 1.1e\+14 s"),
    ],
)
def test_meaningless_settings_are_refused(options, said):
    with pytest.raises(ParameterError, match=said):
        simulate_state(QDYN, **options)


def test_a_law_without_state_is_sent_to_simulate():
    with pytest.raises(ParameterError, match=r"must have a state.*Use simulate"):
        simulate_state(load_fault("lab-fault"), 1e-6, duration=1.0)


@pytest.mark.slow
@few(("method", "rtol", "error"), [("cvodes", 1e-10, 3e-7), ("idas", 1e-10, 3e-7)], every=2)
def test_sundials_finds_the_same_stick_slip_cycles(method, rtol, error):
    """Onsets are found although no step of the solver is known: every event of the parameters of QDYN's notebook."""
    run = simulate_state(QDYN, 1e-5, duration=300.0, start_rate=1.01e-5, start_state=(1.0,), method=method, rtol=rtol)
    expected = qdyn_cycles(QDYN, "DOP853", 1e-12, 300.0)
    assert len(run.onsets) == len(expected) == 10
    assert np.max(np.abs(run.onsets / expected - 1)) < error
    assert np.max(np.abs(run.imbalance)) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("method", ["cvodes", "idas"])
def test_sundials_with_inertia_follows_the_stiff_problem(method):
    slider, times = dataclasses.replace(QDYN, mass=2000.0), np.linspace(0, 40, 21)
    setting = {"duration": 40.0, "start_rate": 2e-5, "times": times}
    expected = simulate_state(slider, 1e-5, rtol=1e-10, **setting)
    run = simulate_state(slider, 1e-5, method=method, rtol=1e-10, **setting)
    assert np.array_equal(run.time, times)
    assert len(run.onsets) == len(expected.onsets) >= 1
    assert np.max(np.abs(run.onsets / expected.onsets - 1)) < 1e-6
    assert np.max(np.abs(run.stretch / expected.stretch - 1)) < 1e-5


@pytest.mark.slow
def test_sundials_says_that_an_event_runs_away():
    with pytest.raises(SimulationError, match="slip rate stays finite"):
        velocity_step(law(), 200.0, [(10.0, MICRON), (200.0, 10 * MICRON)], rtol=1e-8, method="cvodes")


@pytest.mark.slow
def test_sundials_has_earthquakes_years_apart():
    """Eighteen decades of stiffness; 40 years with one earthquake against Radau."""
    fault = dataclasses.replace(load_fault("real-fault"), friction=law(critical_slip=0.02, reference_rate=1e-6))
    setting = {"duration": 40 * 3.15576e7, "start_rate": 2e-9}
    expected = simulate_state(fault, 1e-9, rtol=1e-8, **setting).onsets
    run = simulate_state(fault, 1e-9, method="cvodes", rtol=1e-10, **setting)
    assert np.max(np.abs(run.onsets / expected - 1)) < 1e-5


def test_the_energy_of_stick_slip_cycles_closes():
    """Friction heat N∫μ dδ from NumPy; what the load point brings is stored, rubbed away or radiated."""
    run = simulate_state(QDYN, 1e-5, duration=100.0, start_rate=1.01e-5, method="dop853", rtol=1e-10)
    found = run.energy
    assert found.frictional == pytest.approx(5e6 * np.trapezoid(run.friction, run.slip), rel=1e-12)
    assert found.elastic == pytest.approx(1e9 * (run.stretch[-1] ** 2 - run.stretch[0] ** 2), rel=1e-12)
    assert found.kinetic == 0
    assert 0 < found.viscous < 0.1 * found.frictional
    assert found.far_field == pytest.approx(found.frictional + found.viscous + found.elastic, rel=1e-9)
    fault = dataclasses.replace(load_fault("real-fault"), friction=law(critical_slip=0.02, reference_rate=1e-6))
    event = simulate_state(fault, 1e-9, duration=3e8, start_rate=2e-9, rtol=1e-6)
    assert event.energy.relative_residual < 1e-3
    assert event.energy.frictional > 1e3 * event.energy.kinetic
