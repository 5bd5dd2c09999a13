"""Linear models for python-control against closed forms, automatic derivatives and another discretisation."""

import math
from dataclasses import replace
from fractions import Fraction as F

import casadi as ca
import control
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from thinned import few

import quakedesign as qd
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.laws import ErrorModel, SampledController, disturbance_estimate
from quakedesign.loop import Actuator, Delay, Diffusion, Lag, Saturation
from quakedesign.plant import uncertain_plant
from quakedesign.simulation.interop import resting_pressure

REAL = qd.load_fault("real-fault")
LAW = qd.published("real-fault")["elqr"]


def closed_form(slip):
    """Slope of the acceleration in slip, and in pressure, at rest at a slip: the force balance by hand."""
    drop, length = REAL.friction.drop, REAL.friction.critical_slip
    mu, start = REAL.friction.residual + drop * math.exp(-slip / length), REAL.friction.residual + drop
    area, mass, stress = 25e6, 2500 * 125e9, 50e6
    k = 30e9 * 5e3
    effective = (start * stress - k * slip / area) / mu
    fall = drop / length * math.exp(-slip / length)
    growth = REAL.disturbance.slip_growth
    return fall * effective * area / mass - k / mass + growth, mu * area / mass, stress - effective


@pytest.mark.parametrize("slip", [0.0, 0.1, 0.785])
def test_a_fault_about_rest_is_that_of_the_force_balance(slip):
    plant = qd.to_statespace(REAL, slip)
    steep, push, pressure = closed_form(slip)
    assert resting_pressure(REAL, slip) == pytest.approx(pressure, rel=1e-12, abs=1e-6)
    assert plant.A == pytest.approx(np.array([[0, 1], [steep, -1.6]]), rel=1e-12)
    assert plant.B[:, 0] == pytest.approx([0, push], rel=1e-12)
    assert (plant.input_labels, plant.output_labels) == (["p"], ["slip", "slip_rate"])
    assert (plant.state_labels, plant.name) == (["slip", "slip_rate"], "real-fault")


def test_the_loop_has_the_poles_of_the_closed_loop():
    field = qd.to_casadi(REAL, LAW)
    time, state = ca.SX.sym("t"), ca.SX.sym("x", 4)
    slopes = ca.Function("A", [state], [ca.substitute(ca.jacobian(field(time, state)[0], state), time, 0)])
    expected = np.linalg.eigvals(slopes([0, 0, 0, 0]).full())
    found = control.feedback(qd.loop_transfer(REAL, LAW), 1).poles()
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(expected), rel=1e-7)


def test_margins_are_where_the_loop_loses_stability():
    loop = qd.loop_transfer(REAL, LAW)
    lower = control.stability_margins(loop)[0]  # an unstable plant: it may not be pushed less than this
    B = loop.B @ loop.C

    def growth(factor):
        return np.linalg.eigvals(loop.A - factor * B).real.max()

    edge = brentq(growth, 1e-3, 0.5, xtol=1e-12)
    assert lower == pytest.approx(edge, rel=1e-6)


def unstable_from(loop, factor):
    """Factor towards 0.01 or 100 at which a pole of the closed loop leaves the circle, by bisection."""

    def excess(power):
        return np.max(np.abs(control.feedback(10.0**power * loop, 1).poles())) - 1

    return 10 ** brentq(excess, 0, math.log10(factor), xtol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("around", [{}, {"lag": F(1, 5)}])
def test_margins_of_a_sampled_loop_are_where_its_poles_and_its_nyquist_curve_say(around):
    """Up to half the sampling frequency, which python-control leaves out."""
    law = qd.guarantee(REAL, **around).proof.controller
    loop = qd.loop_transfer(REAL, law)
    found = qd.loop_margins(loop)
    assert found.stable
    assert found.gain_margin == pytest.approx(unstable_from(loop, 10.0), rel=1e-8)
    assert found.gain_reduction == pytest.approx(unstable_from(loop, 0.03), rel=1e-6)
    curve = loop(np.exp(1j * np.linspace(1e-3, np.pi, 100_001)))
    assert found.modulus_margin == pytest.approx(np.abs(1 + curve).min(), rel=1e-6)
    crossings = np.flatnonzero(np.diff(np.abs(curve) > 1))
    angles = np.degrees(np.abs(np.angle(-curve[crossings])))  # poles at 0 blur those of python-control
    assert found.phase_margin == pytest.approx(angles.min(), rel=1e-3)


@few("gain", [0.5, 1.25, 4.0], every=2)
def test_margins_of_an_unstable_pole_are_its_closed_form(gain):
    """L = k/(s − 1): stable from k = 1 on; |1 + L| falls from k − 1 at ω = 0 to 1; cos of the phase margin is 1/k."""
    found = qd.loop_margins(control.tf([gain], [1, -1]))
    assert (found.stable, found.gain_margin) == (gain > 1, None if gain > 1 else pytest.approx(1 / gain))
    assert found.gain_reduction == (pytest.approx(1 / gain) if gain > 1 else None)
    assert found.phase_margin == (pytest.approx(math.degrees(math.acos(1 / gain)), rel=1e-9) if gain > 1 else None)
    assert found.modulus_margin == pytest.approx(min(abs(gain - 1), 1), rel=1e-5)


def test_a_loop_of_two_signals_has_no_margins():
    with pytest.raises(ParameterError, match="one input and one output"):
        qd.loop_margins(qd.to_statespace(REAL))


@pytest.mark.parametrize("loop", [None, 1.0, "L", np.eye(2), REAL, LAW, control.frd([1], [1])])
def test_what_is_no_loop_has_no_margins(loop):
    with pytest.raises(ParameterError, match="loop must be a StateSpace or TransferFunction"):
        qd.loop_margins(loop)


@pytest.mark.slow
def test_a_law_of_samples_meets_a_fault_that_is_held():
    design = qd.design(REAL, "elqr")
    loop = qd.loop_transfer(REAL, design.controller)
    assert loop.dt == pytest.approx(0.184)
    steep, push, _ = closed_form(0.0)
    held = expm(np.array([[0, 1, 0], [steep, -1.6, push], [0, 0, 0]]) * 0.184)
    law = qd.to_iosystem(design.controller.while_moving)
    n = law.nstates

    def closed(z):  # one period, step by step
        x, own = z[:2], z[2:]
        seen = np.array([*x, 0.0, 0.0])
        return np.concatenate(
            [held[:2, :2] @ x + held[:2, 2] * law.output(0, own, seen)[0], law.dynamics(0, own, seen)]
        )

    expected = np.linalg.eigvals(np.column_stack([closed(e) for e in np.eye(2 + n)]))
    found = control.feedback(loop, 1).poles()
    assert np.sort(abs(found)) == pytest.approx(np.sort(abs(expected)), abs=1e-7)
    assert max(abs(found)) < 1
    gain, phase = control.stability_margins(loop)[:2]
    assert gain < 1
    assert phase > 0


def test_what_is_not_linear_has_no_transfer_function():
    with pytest.raises(UnsupportedError, match=r"needs a linear law and linear stages. Received cta"):
        qd.loop_transfer(REAL, qd.published("real-fault")["cta"])
    with pytest.raises(ParameterError, match=r"at must be"):
        qd.to_statespace(REAL, float("nan"))


def test_a_run_is_resampled_at_uniform_instants():
    run = qd.simulate(REAL, duration=30.0, step=0.01)
    even = run.resample(0.05)
    steps = np.diff(even.time.values)
    assert steps == pytest.approx(np.full(600, 0.05), rel=1e-9)
    assert even.slip.attrs["units"] == "m"
    inside = even.time.values[::60]
    assert even.slip.values[::60] == pytest.approx(np.interp(inside, run.time, run.slip), rel=1e-12, abs=1e-15)
    assert even.slip.values[-1] == pytest.approx(run.slip[-1], rel=1e-6)
    for wrong in (0.0, 1e-3, 31.0, float("nan")):
        with pytest.raises(ParameterError, match=r"dt must be between"):
            run.resample(wrong)


STEP = F(23, 125)
SAMPLED = disturbance_estimate(
    (F(672300000), F(206000000)),
    F("0.57"),
    ErrorModel.delayed(((F(1), F(0)), (F("0.0722"), F("0.7475"))), ((F(0), F("0.1596")),), F("2.282e-8")),
)
AT_ONCE = SampledController(law=SAMPLED, step=STEP)


def apart(found, expected):
    """By how much two loops answer differently, up to the frequency of the samples, and their closed poles differ."""
    places = np.exp(1j * np.geomspace(1e-4, 3.1, 40))
    answers = [np.array([complex(loop(z)) for z in places]) for loop in (found, expected)]
    poles = [np.sort(abs(control.feedback(loop, 1).poles()))[-3:] for loop in (found, expected)]
    return max(np.abs(one / other - 1).max() for one, other in (answers, poles))


def matrices():
    parts = SAMPLED.update, SAMPLED.measured, SAMPLED.output, SAMPLED.feedback
    return [np.array(part, dtype=float) for part in parts]


def behind(path):
    """The loop by python-control alone: a continuous path before the plant, both sampled together."""
    plant = control.sample_system(qd.to_statespace(REAL) * path, float(STEP), "zoh")
    update, measured, output, feedback = matrices()
    return -control.ss(update, measured, output[None, :], feedback[None, :], float(STEP)) * plant


@pytest.mark.parametrize("lag", [F(1, 50), F(2, 25), F(1, 2)])
def test_the_lag_for_which_a_law_is_designed_stands_in_its_loop(lag):
    law = replace(AT_ONCE, lag=lag)
    assert apart(qd.loop_transfer(REAL, law), behind(control.ss(control.tf(1, [float(lag), 1])))) < 1e-6
    told = Actuator(stages=(Lag(time_constant=float(lag)),))
    assert apart(qd.loop_transfer(REAL, AT_ONCE, actuator=told), qd.loop_transfer(REAL, law)) < 1e-6
    assert apart(qd.loop_transfer(REAL, law, actuator=Actuator()), qd.loop_transfer(REAL, AT_ONCE)) < 1e-6


@pytest.mark.parametrize("whole", [1, 3])
def test_a_delay_of_whole_steps_is_a_power_of_z(whole):
    law, shift = replace(AT_ONCE, delay=whole * STEP), control.tf([1], [1, *[0] * whole], float(STEP))
    expected = qd.loop_transfer(REAL, AT_ONCE) * control.ss(shift)
    assert apart(qd.loop_transfer(REAL, law), expected) < 1e-6
    assert apart(qd.loop_transfer(REAL, AT_ONCE, actuator=Actuator(stages=(Delay(samples=whole),))), expected) < 1e-6


@pytest.mark.parametrize("tenths", [3, 15])
def test_a_delay_of_no_whole_steps_is_that_of_a_finer_grid(tenths):
    """A tenth of a step at a time: what is held changes `tenths` after the sample that asked for it."""
    found = qd.loop_transfer(REAL, replace(AT_ONCE, delay=tenths * STEP / 10, lag=F(2, 25)))
    path = qd.to_statespace(REAL) * control.ss(control.tf(1, [0.08, 1]))
    fine, late = control.sample_system(path, float(STEP) / 10, "zoh"), -(-tenths // 10)
    n, (update, measured, output, feedback) = fine.nstates, matrices()

    def period(z):  # plant, law, pressures that wait
        x, own, waiting = z[:n], z[n : n + 2], list(z[n + 2 :])
        seen = fine.C @ x
        asked = [output @ own + feedback @ seen, *waiting]
        for k in range(10):
            x = fine.A @ x + fine.B[:, 0] * asked[-(-(tenths - k) // 10) if tenths > k else 0]
        return np.concatenate([x, update @ own + measured @ seen, asked[:late]])

    expected = np.linalg.eigvals(np.column_stack([period(e) for e in np.eye(n + 2 + late)]))
    poles = control.feedback(found, 1).poles()
    assert np.sort(abs(poles))[-4:] == pytest.approx(np.sort(abs(expected))[-4:], rel=1e-7)


def test_rock_answers_as_its_cells_do():
    rock = Diffusion.of_time(2.0)
    found = qd.loop_transfer(REAL, LAW, actuator=Actuator(stages=(rock,)))
    direct = qd.loop_transfer(REAL, LAW)
    size = len(rock.start)
    flow = np.array([rock.rates(rock.numbers, list(row), 0.0) for row in np.eye(size)]).T
    inlet = np.array(rock.rates(rock.numbers, [0.0] * size, 1.0))
    for omega in (0.01, 0.3, 4.0):
        last = np.linalg.solve(1j * omega * np.eye(size) - flow, inlet)[-1]
        assert complex(found(1j * omega)) == pytest.approx(complex(direct(1j * omega)) * last, rel=1e-7)
    meant = qd.loop_transfer(REAL, replace(AT_ONCE, diffusion=F(2)))
    assert apart(meant, qd.loop_transfer(REAL, AT_ONCE, actuator=Actuator(stages=(rock,)))) < 1e-6


@pytest.mark.parametrize(
    ("law", "stage"),
    [(AT_ONCE, Saturation(lowest=-1e7, highest=1e7)), (AT_ONCE, Delay(samples=1, jitter=1)), (LAW, Delay(samples=1))],
)
def test_stages_that_are_not_linear_and_delays_without_samples_have_no_transfer_function(law, stage):
    with pytest.raises(UnsupportedError, match=rf"can contain a lag, a diffusion path and.*Received {stage.name}"):
        qd.loop_transfer(REAL, law, actuator=Actuator(stages=(stage,)))


def test_a_plant_behind_delay_and_lag_is_held_over_its_step_with_its_disturbance():
    """By matrix exponentials of plant and lag together, in the two parts of a period."""
    plant = qd.to_statespace(REAL, step="0.1 s", delay="0.13 s", lag="0.05 s", disturbance=True)
    free = qd.to_statespace(REAL)
    s, w, gain = free.A[1, 0], -free.A[1, 1], free.B[1, 0]
    flow = np.array([[0, 1, 0, 0, 0], [s, -w, gain, 0, 1], [0, 0, -20, 20, 0], [0] * 5, [0] * 5])
    assert plant.input_labels == ["p", "disturbance"]
    pressures, pushes = np.random.default_rng(3).standard_normal((2, 9)) * [[1e6], [1e-3]]
    x, expected = np.zeros(3), []
    for k in range(9):
        expected.append(x[:2])
        before, after = (pressures[k - late] if k >= late else 0 for late in (2, 1))
        x = (expm(flow * 0.03) @ [*x, before, pushes[k]])[:3]
        x = (expm(flow * 0.07) @ [*x, after, pushes[k]])[:3]
    got = control.forced_response(plant, np.arange(9) * 0.1, np.array([pressures, pushes])).outputs
    assert got.T == pytest.approx(np.array(expected), rel=1e-6)


def test_a_vertex_of_the_box_is_that_of_the_guarantee():
    known = uncertain_plant(REAL)
    plant = qd.to_statespace(REAL, vertex=("high", "middle", "low"))
    assert plant.A[1] == pytest.approx([float(known.slip_chord[1]), -float(sum(known.rate_chord) / 2)])
    assert plant.B[1, 0] == pytest.approx(float(known.authority))


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"delay": "1 s"}, "delay requires discrete time"),
        ({"step": "1 s", "slip_noise": "1 m"}, "to_statespace takes only step, delay, lag and diffusion"),
        ({"vertex": ("high", "low")}, "vertex must be three"),
        ({"vertex": ("high", "low", "most")}, "end of a range"),
    ],
)
def test_a_plant_that_is_not_there_is_refused(more, said):
    with pytest.raises(ParameterError, match=said):
        qd.to_statespace(REAL, **more)
