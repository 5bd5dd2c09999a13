"""Rate-and-state faults under a pressure that varies in time, against equations that are typed in again."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import lambertw
from thinned import few

from quakedesign.errors import ParameterError, SimulationError
from quakedesign.fault import friction_law
from quakedesign.simulation import PressureHistory, SpringSlider, simulate_state

A, B, D, V0, MU, ALPHA = 0.01, 0.015, 1e-5, 1e-5, 0.6, 0.2
STIFFNESS, NORMAL, DAMPING = 2e9, 5e6, 2e9 / 3000 / 2
LAW = {
    "reference_coefficient": MU,
    "direct_effect": A,
    "evolution_effect": B,
    "critical_slip": D,
    "reference_rate": V0,
    "slowest_rate": 1e-14,
    "fastest_rate": 10.0,
}
COURSE = PressureHistory(times=(0.0, 20.0, 60.0, 60.0, 90.0), pressures=(0.0, 1e6, 2e5, 1.2e6, 4e5))
END = 110.0


def slider(name="rate-and-state-aging", mass=0.0, sensitivity=ALPHA, **changes):
    law = friction_law(name)(**LAW, stress_sensitivity=sensitivity)
    return SpringSlider(law=law, stiffness=STIFFNESS, normal_stress=NORMAL, damping=DAMPING, mass=mass, **changes)


def pressure_and_slope(t, side):
    """The course by hand, on either side of its step at 60 s."""
    if t < 20:
        return 5e4 * t, 5e4
    if t < 60 or (t == 60 and side < 0):
        return 1e6 - 2e4 * (t - 20), -2e4
    return (1.2e6 - 8e5 / 30 * (t - 60), -8e5 / 30) if t < 90 else (4e5, 0.0)


def rate_in_balance(stretch, theta, normal):
    """v from k·stretch = N(μ_0 + a·log(v/v_0) + b·log(v_0θ/d_c)) + ηv, by Lambert's function."""
    driving = STIFFNESS * stretch / normal - MU - B * math.log(V0 * theta / D)
    scale = A * normal / DAMPING
    return scale * lambertw(math.exp(driving / A) * V0 / scale).real


def ageing(name, v, theta):
    share = v * theta / D
    return 1 - share if name.endswith("aging") else -share * math.log(share)


def quasi_dynamic(name, sensitivity, breaks, method="DOP853"):
    """Stretch and θ as such, event by event of the course, at the end of every span."""
    y, found = np.array([(NORMAL * MU + DAMPING * V0) / STIFFNESS, D / V0 * 1.01]), []
    y[0] = (NORMAL * (MU + B * math.log(1.01)) + DAMPING * V0) / STIFFNESS
    onsets = []
    for start, end in itertools.pairwise(breaks):
        if start == 60.0:
            slow = rate_in_balance(*y, NORMAL - 2e5)
            y = y * [1.0, ((NORMAL - 1.2e6) / (NORMAL - 2e5)) ** (-sensitivity / B)]
            onsets += [start] if slow < 10 * V0 <= rate_in_balance(*y, NORMAL - 1.2e6) else []

        def field(t, y, middle=(start + end) / 2, begin=start):
            reference, slope = pressure_and_slope(middle, 1)
            normal = NORMAL - reference - slope * (t - middle)
            v = rate_in_balance(*y, normal)
            return [V0 - v, ageing(name, v, y[1]) + sensitivity * y[1] / (B * normal) * slope]

        def crossing(t, y, middle=(start + end) / 2):
            reference, slope = pressure_and_slope(middle, 1)
            return math.log(rate_in_balance(*y, NORMAL - reference - slope * (t - middle)) / (10 * V0))

        crossing.direction = 1
        part = solve_ivp(field, (start, end), y, method=method, events=crossing, rtol=1e-11, atol=[1e-16, 1e-13])
        onsets += part.t_events[0].tolist()
        y = part.y[:, -1]
        found.append(y)
    return np.array(found), np.array(onsets)


@pytest.mark.parametrize(("name", "sensitivity"), [("rate-and-state-aging", ALPHA), ("rate-and-state-slip", 0.0)])
def test_cycles_under_ramps_and_a_step_agree_with_an_independent_integrator(name, sensitivity):
    """To 1e-6: every onset, and stretch and state wherever the course bends."""
    breaks = [0.0, 20.0, 60.0, 90.0, END]
    expected, onsets = quasi_dynamic(name, sensitivity, breaks)
    setting = {"duration": END, "start_rate": V0, "start_state": (D / V0 * 1.01,), "pressure": COURSE, "rtol": 1e-10}
    run = simulate_state(slider(name, sensitivity=sensitivity), V0, method="dop853", **setting)
    assert len(run.onsets) == len(onsets) >= 3
    assert np.max(np.abs(run.onsets / onsets - 1)) < 1e-6
    for end, (stretch, theta) in zip(breaks[1:], expected, strict=True):
        i = int(np.searchsorted(run.time, end, side="left"))
        assert run.time[i] == end
        assert run.stretch[i] == pytest.approx(stretch, rel=1e-6)
        assert run.states[0, i] == pytest.approx(theta, rel=1e-6)
    assert np.max(np.abs(run.imbalance)) < 1e-8


@pytest.mark.slow
@few("method", ["radau", "cvodes"], every=2)
def test_implicit_methods_follow_the_same_cycles(method):
    _, onsets = quasi_dynamic("rate-and-state-aging", ALPHA, [0.0, 20.0, 60.0, 61.0])
    setting = {"start_rate": V0, "start_state": (D / V0 * 1.01,), "pressure": COURSE, "rtol": 1e-9}
    run = simulate_state(slider(), V0, duration=61.0, method=method, **setting)
    assert len(run.onsets) == len(onsets) == 4
    assert np.max(np.abs(run.onsets / onsets - 1)) < 1e-6


@pytest.mark.slow
def test_with_inertia_it_agrees_with_the_unlogged_equations_under_pressure():
    """Stretch, rate and state as such by another implicit method, from 0 to a bend at 20 s and on to 45 s."""
    mass = 2000.0

    def field(t, y):
        stretch, v, theta = y
        pressure, slope = pressure_and_slope(t, 1)
        normal = NORMAL - pressure
        friction = MU + A * math.log(v / V0) + B * math.log(V0 * theta / D)
        acceleration = (STIFFNESS * stretch - normal * friction - DAMPING * v) / mass
        return [V0 - v, acceleration, 1 - v * theta / D + ALPHA * theta / (B * normal) * slope]

    y = [(NORMAL * MU + DAMPING * 2e-5 + NORMAL * (A - B) * math.log(2)) / STIFFNESS, 2e-5, 0.5]
    expected = []
    for start, end in ((0.0, 20.0), (20.0, 45.0)):
        part = solve_ivp(field, (start, end), y, method="LSODA", rtol=1e-11, atol=[1e-17, 1e-19, 1e-12])
        y = part.y[:, -1]
        expected.append(y)
    run = simulate_state(
        slider(mass=mass), V0, duration=45.0, start_rate=2e-5, pressure=COURSE, times=[20.0, 45.0], rtol=1e-9
    )
    for i, (stretch, v, theta) in enumerate(expected):
        assert run.stretch[i] == pytest.approx(stretch, rel=1e-6)
        assert run.slip_rate[i] == pytest.approx(v, rel=1e-5)
        assert run.states[0, i] == pytest.approx(theta, rel=1e-6)


def test_a_sudden_pressure_changes_the_logarithm_of_the_rate_by_mu_dp_over_a_sigma_to_first_order():
    undamped = dataclasses.replace(slider(sensitivity=0.0), damping=0.0)
    errors = []
    for share in (1e-3, 1e-4, 1e-5):
        course = PressureHistory(times=(1.0, 1.0), pressures=(0.0, share * NORMAL))
        run = simulate_state(undamped, V0, duration=2.0, pressure=course, method="dop853")
        i = int(np.flatnonzero(np.diff(run.time) == 0)[0])
        assert run.time[i] == 1.0
        assert run.slip[i] == run.slip[i + 1]
        change = math.log(run.slip_rate[i + 1] / run.slip_rate[i])
        errors.append(abs(change / (MU * share / A) - 1))
    assert errors[0] < 2e-3
    assert 8 < errors[0] / errors[1] < 12
    assert 8 < errors[1] / errors[2] < 12


def test_of_a_step_linker_and_dieterich_take_back_alpha_over_a():
    """The rate changes by (μ − α)Δp/(aσ) at once: ln v by −(b/a)·ln θ, ln θ by −(α/b)·ln σ."""
    undamped, share = dataclasses.replace(slider(), damping=0.0), 1e-6
    y = np.array(undamped.start(V0))
    after = undamped.stepped(y, 0.0, share * NORMAL)
    assert after[2] - y[2] == pytest.approx((MU - ALPHA) * share / A, rel=1e-4)
    assert after[3] - y[3] == pytest.approx(ALPHA / B * share, rel=1e-4)


def test_a_mass_does_not_jump_but_its_state_does():
    y = np.array(slider(mass=2000.0).start(V0))
    after = slider(mass=2000.0).stepped(y, 0.0, 1e6)
    assert after[2] == y[2]
    assert math.exp(after[3] - y[3]) == pytest.approx(0.8 ** (-ALPHA / B), rel=1e-12)


def test_a_step_that_lifts_the_rate_to_an_event_is_an_onset():
    course = PressureHistory(times=(5.0, 5.0), pressures=(0.0, 1e6))
    run = simulate_state(slider(sensitivity=0.0), V0, duration=6.0, pressure=course, times=[1.0, 5.0, 6.0])
    assert run.onsets.tolist() == [5.0]
    assert run.time.tolist() == [1.0, 5.0, 6.0]
    assert run.pressure.tolist() == [0.0, 1e6, 1e6]
    assert run.slip_rate[1] > 1e-4


def test_the_energy_of_a_pressed_fault_closes():
    run = simulate_state(slider(), V0, duration=62.0, start_rate=1.01e-5, pressure=COURSE, method="dop853", rtol=1e-8)
    assert run.energy.relative_residual < 1e-7
    assert run.energy.injection == pytest.approx(np.trapezoid(run.pressure * run.friction, run.slip), rel=1e-12)
    assert run.to_xarray()["pressure"].attrs["units"] == "Pa"


def test_a_pressure_that_opens_the_fault_is_refused():
    with pytest.raises(ParameterError, match="below the effective normal stress"):
        simulate_state(slider(), V0, duration=1.0, pressure=NORMAL)


def test_a_step_without_damping_that_nothing_balances_is_refused():
    undamped = dataclasses.replace(slider(), damping=0.0)
    with pytest.raises(SimulationError, match="balance"):
        undamped.stepped(np.array(undamped.start(V0)), 0.0, 0.99 * NORMAL)
