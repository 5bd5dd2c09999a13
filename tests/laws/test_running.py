"""The law that simulations run is the law of the proof."""

import json
import pickle
from dataclasses import asdict, replace
from fractions import Fraction as F

import control
import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp
from thinned import few

from quakedesign import assess, simulate
from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.fault import load_fault
from quakedesign.guarantees import SampledLoop, TrackingProof, guarantee
from quakedesign.laws import (
    ErrorModel,
    SampledController,
    Signals,
    disturbance_estimate,
    slip_observer,
)
from quakedesign.loop import Actuator, Delay, Diffusion, Lag
from quakedesign.loop.sensing.measurement import Measurement
from quakedesign.plant import uncertain_plant
from quakedesign.simulation import Variation, export_controller, to_casadi, to_iosystem
from quakedesign.simulation.campaign import campaign_problem
from quakedesign.simulation.campaign.space import Sample
from quakedesign.simulation.closed_loop import ClosedLoop

STEP = F("0.184")
LAW = disturbance_estimate(
    (F(672300000), F(206000000)),
    F("0.57"),
    ErrorModel.delayed(((F(1), F(0)), (F("0.0722"), F("0.7475"))), ((F(0), F("0.1596")),), F("2.282e-8")),
)
HELD = SampledLoop(law=LAW, step=STEP)


def test_a_run_asks_for_the_pressure_of_the_matrices():
    """Pressures of 100 samples from the recorded errors, by the recursion p = Cz + Dy, z ← Fz + Gy."""
    run = simulate(load_fault("real-fault"), HELD.controller, duration=18.4, samples=101).to_pandas()
    as_floats = lambda rows: np.array(rows, dtype=float)  # noqa: E731
    z, errors = np.zeros(2), []
    for _, row in run.iloc[:-1].iterrows():
        y = [row["slip [m]"] - row["reference [m]"], row["slip_rate [m/s]"] - row["reference_rate [m/s]"]]
        errors.append(row["pressure [Pa]"] - as_floats(LAW.output) @ z - as_floats(LAW.feedback) @ y)
        z = as_floats(LAW.update) @ z + as_floats(LAW.measured) @ y
    assert np.abs(run["pressure [Pa]"]).max() > 1e3
    assert np.abs(errors).max() < 1e-6


@pytest.mark.slow
def test_the_whole_task_stays_far_inside_the_guarantee():
    """The guarantee is of the plant without stick, for all t >= 0, every disturbance and all friction of the box.

    The one disturbance of the file swings far more slowly than the loop answers: its errors are below a fifth of both.
    """
    fault = load_fault("real-fault")
    claim = guarantee(uncertain_plant(fault), HELD)
    assert isinstance(claim, TrackingProof)
    found = simulate(fault, HELD.controller, plant="printed", settled_from=0.0).metrics
    assert found.max_slip_error <= claim.claims.slip_error / 5
    assert found.max_slip_rate_error <= claim.claims.slip_rate_error / 5
    assert found.peak_slip_rate <= claim.claims.peak_slip_rate
    assert claim.claims.least_pressure <= found.min_pressure
    assert found.max_pressure <= claim.claims.largest_pressure


REAL = load_fault("real-fault")


def recursion(run, law):
    """Pressures [Pa] that the matrices ask for, told slips and slip rates of consecutive samples."""
    f, g, c, d = (np.array(m, dtype=float) for m in (law.update, law.measured, law.output, law.feedback))
    z, asked = np.zeros(len(c)), []
    for slip, rate, r, r_rate in zip(run.slip, run.slip_rate, run.reference, run.reference_rate, strict=True):
        y = np.array([slip - r, rate - r_rate])
        asked.append(c @ z + d @ y)
        z = f @ z + g @ y
    return np.array(asked)


OBSERVER = slip_observer(
    (F(1250000000), F(306200000)),
    (F("0.942"), F("6.12"), F("9.85")),
    ErrorModel.delayed(
        ((F("1.007"), F("0.1598")), (F("0.0718"), F("0.7513"))), ((F("0.0154"), F("0.1598")),), F("2.282e-8")
    ),
)


def test_a_run_of_the_slip_alone_asks_for_the_pressure_of_the_matrices_and_for_that_of_the_noisy_slip():
    """Without noise, and within what noise of a bound makes of it by the law's own gains."""
    controller = SampledLoop(law=OBSERVER, step=STEP).controller
    run = simulate(REAL, controller, duration=18.4, samples=101)
    assert np.allclose(run.pressure, recursion(run, OBSERVER), rtol=1e-9, atol=1e-6)
    noise = Measurement(slip_noise=1e-6, rate_noise=1.0, bounded=True)
    loud = simulate(REAL, controller, duration=18.4, samples=101, measurement=noise)
    f, g, c, d = (
        np.array(m, dtype=float) for m in (OBSERVER.update, OBSERVER.measured, OBSERVER.output, OBSERVER.feedback)
    )
    heard = [abs(d[0]), *(abs(c @ np.linalg.matrix_power(f, k) @ g[:, 0]) for k in range(101))]
    off = np.abs(loud.pressure - recursion(loud, OBSERVER))
    assert 1e3 < off.max() <= 1e-6 * sum(heard)


def test_it_runs_by_its_own_scheme_and_step_on_a_fault_of_another():
    other = replace(REAL, sampling_time=1.0)
    run = simulate(other, HELD.controller, duration=18.4, samples=101)
    assert (run.provenance["scheme"], run.provenance["step"]) == ("explicit", 0.184)
    assert np.allclose(run.pressure, recursion(run, LAW), rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize("wrong", [{"scheme": "continuous"}, {"scheme": "implicit"}, {"step": 0.1}])
def test_to_run_it_otherwise_is_refused_everywhere(wrong, tmp_path):
    calls = [
        lambda: simulate(REAL, HELD.controller, duration=1.0, **wrong),
        lambda: campaign_problem(REAL, HELD.controller, duration=1.0, **wrong),
        lambda: export_controller(REAL, HELD.controller, tmp_path / "c", **wrong),
    ]
    for call in calls:
        with pytest.raises(ParameterError, match=r"runs with the scheme explicit and the step 0\.184 s"):
            call()
    assert not (tmp_path / "c").exists()


@pytest.mark.slow
def test_a_campaign_runs_it_as_simulate_does():
    """The signals_delayed sample, by the program that all samples share."""
    problem = campaign_problem(REAL, HELD.controller, duration=18.4, initial_slip=1e-6)
    json.dumps(problem.inputs, allow_nan=False)
    start = Sample(numbers=asdict(Variation()) | {"initial_slip": 1e-6, "initial_slip_rate": 0.0}, noise_seed=0)
    (end,) = problem.program.ends([problem.start(start)], problem.setting.steps)
    run = problem.trajectory(start, 101)
    assert np.allclose(run.pressure, recursion(run, LAW), rtol=1e-9, atol=1e-6)
    assert end[2] == pytest.approx(run.slip[-1], rel=1e-12)


def test_python_control_runs_it_in_discrete_time():
    run = simulate(REAL, HELD.controller, duration=18.4, samples=101)
    system = to_iosystem(HELD.controller)
    assert system.dt == 0.184
    told = np.vstack([run.slip, run.slip_rate, run.reference, run.reference_rate])
    response = control.input_output_response(system, 0.184 * np.arange(len(run.time)), told)
    assert np.allclose(response.outputs, run.pressure, rtol=1e-9, atol=1e-6)


def test_it_has_no_function_of_a_loop_in_continuous_time():
    with pytest.raises(UnsupportedError, match="a sampled law has no closed loop"):
        to_casadi(REAL, HELD.controller)


def test_its_gains_are_those_of_the_law():
    """p = −Σ gain·signal, read off the matrices."""
    law = HELD.controller
    assert list(law.gains) == ["k1", "k2", "predicted_rate", "disturbance"] == list(law.gain_units)
    assert tuple(law.gains.values()) == tuple(-v for v in (*LAW.feedback, *LAW.output))
    assert pickle.loads(pickle.dumps(law)) == law


def test_it_has_no_loop_in_continuous_time():
    with pytest.raises(UnsupportedError, match="guarantee"):
        SampledController.loop_field()


def test_its_gains_are_not_told():
    with pytest.raises(ParameterError, match="unexpected keyword argument 'gains'"):
        SampledController(law=LAW, step=STEP, gains={})


def test_it_is_not_made_from_gains_in_order():
    with pytest.raises(UnsupportedError, match="given by its matrices"):
        SampledController.from_values(())


def test_its_expressions_are_those_of_the_matrices():
    """With symbols: what it asks for, the rates by which the scheme adds T_s·z′, and their units."""
    law = HELD.controller
    pi, d, e1, e2, x1, x2 = sp.symbols("pi d e1 e2 x1 x2")
    signals = Signals(slip=x1, slip_rate=x2, slip_error=e1, slip_rate_error=e2, integrals=(pi, d))
    told = sp.Matrix([pi, d, e1, e2])
    exact = lambda rows: sp.Matrix(rows).applyfunc(lambda v: sp.Rational(v.numerator, v.denominator))  # noqa: E731
    asked = (exact([[*LAW.output, *LAW.feedback]]) * told)[0]
    assert sp.expand(law.pressure(signals) - asked) == 0
    after = exact([[*own, *fed] for own, fed in zip(LAW.update, LAW.measured, strict=True)]) * told
    found = sp.Matrix([pi, d]) + sp.Rational(23, 125) * sp.Matrix(law.integral_rates(signals))
    assert sp.expand(found - after) == sp.zeros(2, 1)
    assert law.sampling_time == 0.184
    assert law.integral_units == ("-", "-")
    assert law.gain_units == {"k1": "Pa/m", "k2": "Pa s/m", "predicted_rate": "Pa", "disturbance": "Pa"}


@few(
    ("around", "stages", "substeps"),
    [
        ({"lag": F(1, 5)}, (Lag(time_constant=0.2),), 1),
        ({"lag": F(1, 100)}, (Lag(time_constant=0.01),), 8),
        ({"delay": 2 * STEP, "lag": F(1, 5)}, (Delay(samples=2), Lag(time_constant=0.2)), 1),
        ({"diffusion": F(20)}, (Diffusion.of_time(20.0),), 4),
    ],
    every=2,
)
def test_what_a_law_is_designed_for_stands_in_every_run_unless_told(around, stages, substeps):
    law, told = SampledLoop(law=LAW, step=STEP, **around).controller, Actuator(stages=stages)
    short = {"duration": 9.2, "samples": 51}
    own, same = simulate(REAL, law, **short), simulate(REAL, law, actuator=told, substeps=substeps, **short)
    free = simulate(REAL, law, actuator=Actuator(), **short)
    assert own.pressure.tolist() == same.pressure.tolist()
    assert own.slip.tolist() == same.slip.tolist()
    assert (own.provenance["actuator"], own.provenance["substeps"]) == (repr(told)[17:-2].rstrip(","), substeps)
    assert np.abs(own.pressure - free.pressure).max() > 0.01 * np.abs(free.pressure).max()
    assert free.pressure.tolist() == simulate(REAL, HELD.controller, **short).pressure.tolist()
    assert campaign_problem(REAL, law).scheme.actuator == told


@pytest.mark.parametrize("lag", [0, F(1, 5)])
@few("delay", [STEP / 3, STEP + F(1, 10)], every=2)
def test_a_pressure_arrives_between_samples(delay, lag):
    """The law by its recursion, the plant by SciPy between changes of the pressure; friction has a kink at slip 0."""
    law, periods = SampledLoop(law=LAW, step=STEP, delay=delay, lag=lag).controller, 10
    told = {"duration": periods * float(STEP), "samples": periods + 1, "initial_slip_rate": 1e-5}
    run = simulate(REAL, law, substeps=16, **told, plant="printed")
    plant, reference = ClosedLoop(REAL, law).plant, ClosedLoop(REAL, law).reference
    update, measured, output, feedback = (
        np.array(part, dtype=float) for part in (LAW.update, LAW.measured, LAW.output, LAW.feedback)
    )
    z, y, asked, found = np.zeros(2), np.array([0.0, 1e-5, 0.0]), [0.0, 0.0], []
    step, (late, part) = float(STEP), divmod(delay, STEP)

    def rates(t, y, held):
        pressure = y[2] if lag else held
        return [*plant(t, y[:2], pressure).full().ravel(), (held - y[2]) / float(lag) if lag else 0.0]

    for k in range(periods):
        found.append(y)
        error = y[:2] - reference(k * step).full().ravel()[:2]
        asked.append(output @ z + feedback @ error)
        z = update @ z + measured @ error
        changes = [k * step, k * step + float(part), (k + 1) * step]
        for begin, end, held in zip(changes, changes[1:], asked[-2 - int(late) :], strict=False):
            y = solve_ivp(rates, (begin, end), y, args=(held,), method="DOP853", rtol=1e-12, atol=1e-16).y[:, -1]
    slips, speeds, _ = np.transpose(found)
    assert np.abs(run.slip[:-1] - slips).max() < 1e-6 * np.abs(slips).max()
    assert np.abs(run.slip_rate[:-1] - speeds).max() < 1e-6 * np.abs(speeds).max()
    sooner = simulate(REAL, law, actuator=Actuator(), **told, plant="printed")
    assert np.abs(run.slip - sooner.slip).max() > 0.1 * np.abs(slips).max()


def test_a_verdict_on_a_law_of_samples_is_about_what_it_is_designed_for():
    late = SampledLoop(law=LAW, step=STEP, lag=F(1, 50))
    found = assess(REAL, late.controller).guarantee
    assert found.sampled_loop.lag == F(1, 50)
    assert found.claims.slip_rate_error > assess(REAL, HELD.controller).guarantee.claims.slip_rate_error
