"""Held rate-and-state faults: the loop between samples against equations that are typed in again."""

import dataclasses
import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from scipy.special import lambertw

from quakedesign import simulate
from quakedesign.errors import ParameterError, UnknownNameError
from quakedesign.fault import Reference, friction_law, load_fault
from quakedesign.guarantees import SampledLoop
from quakedesign.guarantees.search.lqg import growth_rate, sliding_law, sliding_model
from quakedesign.laws import LinearLaw
from quakedesign.loop import Actuator, Delay, Diffusion, Lag, Saturation, sliding_loop
from quakedesign.loop.sensing import Measurement, Transducer
from quakedesign.simulation import Load, Variation, simulate_state, slow_sliding
from quakedesign.simulation.slow_sliding import _Loop, simulate_sliding
from quakedesign.simulation.state_plant import PressurePath, SlidingVariation, Tide
from quakedesign.symbolic import derive

A, B, D, V, MU, NORMAL = 0.010, 0.015, 1e-3, 1.2e-6, 0.6, 50e6
STIFFNESS, DAMPING = 30e9 / 5e3, 5e14 / 25e6
STEP, PATH = Fraction(40), Fraction(833)


def fault(name="rate-and-state-aging", rate=V, **changes):
    parameters = {
        "reference_coefficient": MU,
        "direct_effect": A,
        "evolution_effect": B,
        "critical_slip": D,
        "reference_rate": V,
        "slowest_rate": 1e-14,
        "fastest_rate": 10.0,
    }
    task = Reference(target_slip=rate * 5e5, operation_time=5e5)
    given = {"friction": friction_law(name)(**(parameters | changes)), "reference": task, "sampling_time": 40.0}
    return dataclasses.replace(load_fault("real-fault"), **given)


def test_the_instability_is_that_of_the_linearised_fault():
    (fastest, *_) = sorted((z.real for z in derive(fault()).eigenvalues), reverse=True)
    assert growth_rate(sliding_model(fault())) == pytest.approx(fastest, rel=1e-4)
    kappa = STIFFNESS * D / NORMAL
    assert growth_rate(sliding_model(fault())) == pytest.approx((B - A - kappa) / A * V / D, rel=0.1)


@pytest.mark.parametrize("name", ["rate-and-state-aging", "rate-and-state-slip", "regularised-rate-and-state"])
def test_the_model_has_the_numbers_of_the_fault(name):
    model = sliding_model(fault(name))
    assert float(model.direct) == pytest.approx(A, rel=1e-12)
    assert float(model.evolution) == pytest.approx(B, rel=1e-12)
    assert float(model.state_rate) == pytest.approx(V / D, rel=1e-12)
    assert float(model.strength) == pytest.approx(NORMAL * A + DAMPING * V, rel=1e-12)
    assert float(model.coefficient) == pytest.approx(MU, rel=1e-12)


@pytest.mark.parametrize("path", [Fraction(0), PATH, 4 * PATH])
def test_the_law_makes_the_sampled_loop_stable(path):
    """With twice as many modes of the layer as the law knows."""
    model = sliding_model(fault())
    loop = sliding_loop(sliding_law(model, STEP, diffusion=path), model, STEP, diffusion=path)
    free = sliding_loop(asking_for(0), model, STEP, diffusion=path)
    (held, uncontrolled) = (
        np.max(np.abs(np.linalg.eigvals(expm(np.array(x.flow, float) * 40) @ np.array(x.segments[0].jump, float))))
        for x in (loop, free)
    )
    assert held < 0.998
    assert uncontrolled == pytest.approx(math.exp(40 * growth_rate(model)), rel=1e-9)


def test_the_law_rests_where_it_asks_for_a_constant_pressure():
    """Exactly: z = (0, 0, p …, −μp) is left by an update without errors, and asks for p."""
    model = sliding_model(fault())
    law = sliding_law(model, STEP, diffusion=PATH)
    states = [Fraction(0)] * 2 + [Fraction(1)] * 4 + [-model.coefficient]
    after = [sum((v * s for v, s in zip(row, states, strict=True)), Fraction(0)) for row in law.update]
    assert after == states
    asked = sum((v * s for v, s in zip(law.output, states, strict=True)), Fraction(0))
    assert asked == Fraction(NORMAL)
    assert law.of_slip_alone


def asking_for(pressure):
    """A law that adds up pressure·T_s every sample without looking; 0 for none."""
    zero, one = Fraction(0), Fraction(1)
    own = ((one, zero), (zero, one)) if not pressure else ((one, Fraction(pressure)), (zero, one))
    return LinearLaw(
        states=("level", "seen"), update=own, measured=((zero, zero), (zero, zero)), output=(one, zero),
        feedback=(zero, zero),
    )  # fmt: skip


def along(time, rate, ramp, length):
    """Slip and rate of a reference: mean rate, share of the smooth ramp, operation time, typed in again."""
    s = min(time / length, 1.0)
    swollen = (1 - ramp) * time + ramp * length * (10 * s**3 - 15 * s**4 + 6 * s**5)
    return rate * swollen, rate * (1 - ramp + ramp * (30 * s**2 - 60 * s**3 + 30 * s**4))


def oracle(
    law, name, tide, count, off=(1.0,) * 6, *, ramp=0.0, length=5e5, late=0.0, lag=0.0, read=float,
    pump=lambda asked, _: asked,
):  # fmt: skip
    """Slip error and ln(v/V) at every sample: balance of forces by Lambert's function, LSODA between samples.

    V is the first rate of the reference, whose mean is V/(1 - ramp). A pressure acts `late` [s] after its sample, and
    comes with a time constant `lag` [s].
    """
    a, b, d, sigma, stiffness, damping = (
        x * y for x, y in zip((A, B, D, NORMAL, STIFFNESS, DAMPING), off, strict=True)
    )
    mean = V / (1 - ramp)
    z, held, x, w, p, found = np.zeros(len(law.output)), 0.0, 0.0, 0.0, 0.0, []
    update, fed, output = (np.array(part, float) for part in (law.update, law.measured, law.output))

    def rate(t, x, w, held):
        slip = along(t, mean, ramp, length)[0]
        normal = sigma - STIFFNESS / MU * slip - held
        stress = (
            sigma * MU
            + damping * V
            + stiffness * (-slip - x)
            + tide.amplitude * math.sin(2 * math.pi * t / tide.period + tide.phase)
        )
        driving = stress / normal - MU - b * w
        scale = a * normal / damping
        return math.log(scale / V * lambertw(math.exp(driving / a) * V / scale).real)

    def field(t, state, held):
        y = rate(t, *state[:2], state[2] if lag else held)
        grown = math.exp(-state[1]) - math.exp(y) if name.endswith("aging") else -math.exp(y) * (y + state[1])
        coming = (held - state[2]) / lag if lag else 0.0
        return [V * math.exp(y) - along(t, mean, ramp, length)[1], V / d * grown, coming]

    for k in range(count):
        slip = along(40.0 * k, mean, ramp, length)[0]
        error = read(slip + x) - slip
        before, held = held, pump(float(output @ z) + float(law.feedback[0]) * error, STIFFNESS / MU * slip)
        z = update @ z + fed[:, 0] * error
        change, end = 40.0 * k + late, 40.0 * (k + 1)
        for span, acting in (((40.0 * k, change), before), ((change, end), held)):
            begin = [x, w, p]
            x, w, p = solve_ivp(field, span, begin, method="LSODA", args=(acting,), rtol=1e-10, atol=1e-15).y[:, -1]
        found.append((x, rate(40.0 * (k + 1), x, w, p if lag else held)))
    return np.array(found).T


@pytest.mark.parametrize("name", ["rate-and-state-aging", "rate-and-state-slip"])
def test_a_held_run_agrees_with_an_independent_integrator(name):
    law, tide = sliding_law(sliding_model(fault(name)), STEP), Tide(amplitude=160e3, period=3000.0)
    run = simulate_sliding(fault(name), law, STEP, tide=tide, duration=3000.0)
    error, log_rate = oracle(law, name, tide, 75)
    assert np.max(np.abs(log_rate)) > 0.02
    assert run.slip_error[4::4] == pytest.approx(error, abs=1e-6 * np.max(np.abs(error)))
    assert np.log(run.slip_rate[4::4] / V) == pytest.approx(log_rate, abs=1e-6)
    assert run.pressure == pytest.approx(STIFFNESS * V / MU * run.time + run.feedback_pressure, abs=1e-6)
    assert np.diff(run.time) == pytest.approx(10.0, rel=1e-12)  # four instants a period
    assert run.slip_rate[0] == pytest.approx(V, rel=1e-10)
    stress = tide.amplitude * np.sin(2 * np.pi * run.time / tide.period)
    force = MU * NORMAL + DAMPING * V - STIFFNESS * run.slip + stress - DAMPING * run.slip_rate
    assert run.shear_stress == pytest.approx(force, rel=1e-9)
    assert run.integrals.shape == (0, len(run.time))


def test_a_lag_between_samples_is_that_of_an_independent_integrator():
    law, tide = sliding_law(sliding_model(fault()), STEP), Tide(amplitude=90e3, period=3000.0)
    run = simulate_sliding(fault(), law, STEP, lag=Fraction(15), tide=tide, duration=1200.0)
    error, log_rate = oracle(law, "rate-and-state-aging", tide, 30, lag=15.0)
    assert run.slip_error[4::4] == pytest.approx(error, abs=1e-6 * np.max(np.abs(error)))
    assert np.log(run.slip_rate[4::4] / V) == pytest.approx(log_rate, abs=1e-6)
    at_once = oracle(law, "rate-and-state-aging", tide, 30)[1]
    assert np.max(np.abs(log_rate - at_once)) > 1e-3


def test_a_run_with_which_the_solver_cannot_go_on_has_no_metrics(monkeypatch):
    followed = slow_sliding._followed
    monkeypatch.setattr(slow_sliding, "_followed", lambda *given: (followed(*given)[0], {"diverged": 80.0}))
    run = simulate_sliding(fault(), sliding_law(sliding_model(fault()), STEP), STEP, duration=80.0, settled_from=20.0)
    known = {name: value for name, value in run.metrics.to_dict().items() if value is not None}
    assert known.keys() == {"settled_from", "steps", "seconds"}
    assert (known["settled_from"], known["steps"]) == (20.0, len(run.time) - 1)


def test_metrics_are_those_of_the_instants_from_where_errors_count():
    """Of all instants, also where few are kept; `progress` ends at one."""
    law, tide = sliding_law(sliding_model(fault()), STEP), Tide(amplitude=90e3, period=3000.0)
    told = {"tide": tide, "duration": 1010.0, "settled_from": 300.0}
    shares = []
    run = simulate_sliding(fault(), law, STEP, **told, progress=shares.append)
    assert shares == pytest.approx([min(1, 40 * (k + 1) / 1010) for k in range(26)])
    assert (run.time[0], run.time[-1], len(run.time)) == (0, 1040, 105)
    late = run.time > 300
    error, rate = (run.slip - V * run.time)[late], (run.slip_rate - V)[late]
    steps = np.diff(run.pressure[late])
    expected = {
        "max_slip_error": max(abs(error)),
        "max_slip_rate_error": max(abs(rate)),
        "mise_slip": np.mean(error**2),
        "mise_slip_rate": np.mean(rate**2),
        "rms_slip_error": np.sqrt(np.mean(error**2)),
        "rms_slip_rate_error": np.sqrt(np.mean(rate**2)),
        "rms_pressure": np.sqrt(np.mean(run.pressure[late] ** 2)),
        "pressure_total_variation": sum(abs(steps)),
        "reverse_slip_fraction": 0.0,
        "peak_slip_rate": max(run.slip_rate),
        "max_pressure": max(run.pressure),
        "min_pressure": min(run.pressure),
        "settled_from": 300.0,
        "steps": 104,
    }
    found = {name: value for name, value in run.metrics.to_dict().items() if value is not None}
    assert 0 < found.pop("seconds") < 600
    assert found == pytest.approx(expected, rel=1e-9, abs=0)
    few = simulate_sliding(fault(), law, STEP, **told, samples=7)
    assert (few.time[0], few.time[-1], len(few.time)) == (0, 1040, 8)
    assert few.metrics.to_dict() | {"seconds": 0} == run.metrics.to_dict() | {"seconds": 0}


def test_a_reference_that_swells_is_followed_as_by_an_independent_integrator():
    """From V up to 1 + 15/8·0.3/0.7 times that within 4000 s; behind its end V goes on."""
    task = Reference(target_slip=V / 0.7 * 4000, operation_time=4000.0, ramp=0.3)
    swelling = dataclasses.replace(fault(), reference=task, sampling_time=4.0)
    law, tide = sliding_law(sliding_model(swelling), STEP), Tide(amplitude=40e3, period=3000.0)
    run = simulate_sliding(swelling, law, STEP, tide=tide, duration=4400.0)
    error, log_rate = oracle(law, "rate-and-state-aging", tide, 110, ramp=0.3, length=4000.0)
    assert run.slip_error[4::4] == pytest.approx(error, abs=1e-6 * np.max(np.abs(error)))
    assert np.log(run.slip_rate[4::4] / V) == pytest.approx(log_rate, abs=1e-6)
    assert run.reference_rate.max() == pytest.approx(V * (1 + 15 / 8 * 0.3 / 0.7), rel=1e-12)
    assert run.reference_rate[[0, -1]] == pytest.approx([V, V], rel=1e-12)
    assert run.reference[400] == pytest.approx(task.target_slip, rel=1e-12)
    assert run.criterion.reference_rate == pytest.approx(run.reference_rate.max(), rel=1e-12)


def test_a_pump_that_is_late_and_cut_off_and_readings_in_steps_are_those_of_an_independent_integrator():
    """The plan is known ahead, so not late; what is cut off is the whole pressure, the planned one included."""
    law, tide = sliding_law(sliding_model(fault()), STEP), Tide(amplitude=90e3, period=3000.0)
    step, queue = 1e-7, [0.0, 0.0]

    def pump(asked, planned):
        queue.append(asked)
        return min(max(queue.pop(0) + planned, -30e3), 30e3) - planned

    stages = (Delay(samples=2), Saturation(lowest=-30e3, highest=30e3))
    told = {"tide": tide, "duration": 2000.0, "transducer": Transducer(quantum=step)}
    run = simulate_sliding(fault(), law, STEP, stages=stages, **told)
    read = {"read": lambda slip: step * math.floor(slip / step + 0.5), "pump": pump}
    error, log_rate = oracle(law, "rate-and-state-aging", tide, 50, **read)
    assert run.slip_error[4::4] == pytest.approx(error, abs=1e-6 * np.max(np.abs(error)))
    assert np.log(run.slip_rate[4::4] / V) == pytest.approx(log_rate, abs=1e-6)
    assert -30e3 <= run.pressure.min() < -29e3
    assert run.feedback_pressure.min() < -60e3
    given = {"actuator": Actuator(stages=stages), "measurement": Transducer(quantum=step), "plant": "quasi-dynamic"}
    controller = SampledLoop(law=law, step=STEP).controller
    same = simulate(fault(), controller, tide=tide, duration=2000.0, samples=200, **given)
    assert same.slip_rate[-1] == run.slip_rate[-1]


def test_a_pump_acts_between_samples_as_with_an_independent_integrator():
    law, tide = sliding_law(sliding_model(fault()), STEP), Tide(amplitude=90e3, period=3000.0)
    run = simulate_sliding(fault(), law, STEP, stages=(Delay(samples=0, part=0.3),), tide=tide, duration=2000.0)
    error, log_rate = oracle(law, "rate-and-state-aging", tide, 50, late=12.0)
    assert run.slip_error[8::8] == pytest.approx(error, abs=1e-6 * np.max(np.abs(error)))
    assert np.log(run.slip_rate[8::8] / V) == pytest.approx(log_rate, abs=1e-6)
    sooner = oracle(law, "rate-and-state-aging", tide, 50)[1]
    assert np.max(np.abs(log_rate - sooner)) > 1e-3


def test_it_moves_with_inertia_unless_asked_otherwise():
    controller = SampledLoop(law=sliding_law(sliding_model(fault()), STEP), step=STEP).controller
    assert simulate(fault(), controller, duration=80.0, samples=2).provenance["plant"] == "smooth"


def test_a_noisy_transducer_reads_other_slips_from_another_seed():
    law = sliding_law(sliding_model(fault()), STEP)
    ends = [
        simulate_sliding(fault(), law, STEP, duration=400.0, transducer=Transducer(deviation=1e-6, seed=seed)).slip[-1]
        for seed in (0, 0, 1)
    ]
    assert ends[0] == ends[1] != ends[2]


def test_true_constants_other_than_the_nominal_ones_are_those_of_the_plant_alone():
    """The law, its plan of the pressure and the start at V stay what they are."""
    off = {"direct_effect": 1.1, "evolution_effect": 0.93, "critical_slip": 1.2}
    off |= {"normal_stress": 0.9, "stiffness": 1.15, "damping": 1.3}
    law, tide = sliding_law(sliding_model(fault()), STEP), Tide(amplitude=90e3, period=3000.0, phase=1.0)
    told = {"tide": tide, "duration": 2000.0, "variation": SlidingVariation(**off)}
    run = simulate_sliding(fault(), law, STEP, **told)
    error, log_rate = oracle(law, "rate-and-state-aging", tide, 50, tuple(off.values()))
    assert np.max(np.abs(log_rate)) > 0.1
    assert run.slip_error[4::4] == pytest.approx(error, abs=1e-6 * np.max(np.abs(error)))
    assert np.log(run.slip_rate[4::4] / V) == pytest.approx(log_rate, abs=1e-6)
    told = {name: value for name, value in run.provenance.items() if name.startswith("variation_")}
    assert told == {f"variation_{name}": value for name, value in off.items()}
    doubled = simulate_sliding(fault(), law, STEP, duration=40.0, variation=SlidingVariation(damping=2.0))
    assert [name for name in doubled.provenance if name.startswith("variation_")] == ["variation_damping"]
    with pytest.raises(ParameterError, match="direct_effect must be positive"):
        SlidingVariation(direct_effect=0.0)


@pytest.mark.parametrize("lag", [50.0, 833.0, 8 * 833.0 / math.pi**2 / 2])
def test_a_step_goes_through_a_lag_and_then_the_layer(lag):
    """The step of Carslaw and Jaeger's layer, folded with e^(−t/ℓ)/ℓ by quadrature; one ℓ has the rate of a mode."""
    path = PressurePath(lag=Fraction(lag), diffusion=PATH)
    n, tau = np.arange(60), float(PATH)
    rates, shares = ((2 * n + 1) * math.pi / 2) ** 2 / tau, 4 / math.pi * (-1.0) ** n / (2 * n + 1)

    def behind(t):
        return quad(lambda s: (1 - shares @ np.exp(-rates * (t - s))) * math.exp(-s / lag) / lag, 0, t, epsabs=1e-9)[0]

    loop = _Loop.of(fault(), path, Tide(), SlidingVariation(), False, None)
    for time in (40.0, 400.0, 2000.0):
        found = loop.pressure(0.0, 1.0, time, np.zeros(len(loop.decay)))
        assert found == pytest.approx(behind(time), abs=2e-5)
    alone = _Loop.of(fault(), PressurePath(lag=Fraction(lag)), Tide(), SlidingVariation(), False, None)
    assert alone.pressure(0.0, 1.0, 40.0, np.zeros(1)) == pytest.approx(-math.expm1(-40.0 / lag), rel=1e-12)


@pytest.mark.parametrize("inertia", [True, False])
def test_a_stress_that_has_come_at_once_makes_the_rate_jump(inertia):
    """By about S/(aN) without inertia, as soon as that has acted with it."""
    law, tide = sliding_law(sliding_model(fault()), STEP), Tide(amplitude=10e3, period=1e6, phase=math.pi / 2)
    run = simulate_sliding(fault(), law, STEP, tide=tide, duration=40.0, inertia=inertia)
    jumped = np.log(run.slip_rate / V)
    assert jumped[0] == pytest.approx(0 if inertia else 10e3 / (A * NORMAL), rel=5e-3, abs=1e-12)
    assert jumped[1] == pytest.approx(10e3 / (A * NORMAL), rel=0.05)
    assert run.provenance["plant"] == ("smooth" if inertia else "quasi-dynamic")
    assert run.moment_per_slip == fault().shear_modulus * fault().area
    assert run.stress[0] == pytest.approx(10e3)


def test_simulate_runs_what_a_design_found_in_its_own_way():
    path, tide = Fraction(500), Tide(amplitude=5e3, period=3000.0)
    law = sliding_law(sliding_model(fault()), STEP, diffusion=path)
    controller = SampledLoop(law=law, step=STEP, diffusion=path).controller
    given = {"duration": 400.0, "tide": tide}
    run = simulate(fault(), controller, **given, plant="quasi-dynamic", samples=10)
    own = simulate_sliding(fault(), law, STEP, diffusion=path, **given)
    assert len(run.time) == 11
    assert run.slip_rate[-1] == own.slip_rate[-1]
    assert dataclasses.replace(run.metrics, seconds=0.0) == dataclasses.replace(own.metrics, seconds=0.0)
    assert run.outcome == own.outcome
    other = Actuator(stages=(Lag(time_constant=30.0), Diffusion.of_time(100.0)))
    late = simulate(fault(), controller, **given, plant="quasi-dynamic", actuator=other)
    written = simulate_sliding(fault(), law, STEP, lag=Fraction(30), diffusion=Fraction(100), **given)
    assert late.slip_rate[-1] == written.slip_rate[-1]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        *(
            ({"controller": None, name: value}, rf"uncontrolled .* Received {name}\. Omit")
            for name, value in {
                "step": 20.0,
                "scheme": "explicit",
                "settled_from": 1.0,
                "variation": SlidingVariation(),
                "actuator": Actuator(stages=()),
                "measurement": Transducer(),
                "tide": Tide(amplitude=1.0),
                "rtol": 1e-8,
            }.items()
        ),
        ({"substeps": 2}, "Received substeps"),
        ({"initial_slip": 1e-3}, "Received initial_slip "),
        ({"initial_slip_rate": 1e-3}, "Received initial_slip_rate"),
        ({"checkpoint": "run.npz"}, "Received checkpoint"),
        ({"rtol": 1e-8}, "Received rtol"),
        ({"compiled": False}, "Received compiled"),
        ({"load": Load()}, "Received load"),
        ({"measurement": Measurement()}, "Received measurement"),
        ({"variation": Variation()}, "Received variation"),
        ({"step": 20.0}, "runs with the scheme explicit"),
        ({"plant": "stick-slip"}, "one of smooth, quasi-dynamic"),
        (
            {"actuator": Actuator(stages=(Diffusion.of_time(100.0), Lag(time_constant=30.0)))},
            "a lag and then a diffusion path. Received diffusion, lag",
        ),
    ],
)
def test_what_a_run_in_slow_sliding_does_not_take_is_refused(wrong, said):
    law = sliding_law(sliding_model(fault()), STEP)
    with pytest.raises((ParameterError, UnknownNameError), match=said):
        simulate(fault(), **({"controller": SampledLoop(law=law, step=STEP).controller, "duration": 80.0} | wrong))


def test_an_uncontrolled_fault_with_a_state_is_loaded_at_its_operating_rate():
    """As `simulate_state` by two other methods, from a state half as old again as the steady one."""
    rate = fault().friction.operating_rate
    run = simulate(fault(), duration=50.0, plant="quasi-dynamic", samples=6)
    older = [1.5 * v for v in fault().friction.steady_state(rate)]
    assert run.time.tolist() == [0, 10, 20, 30, 40, 50]
    assert run.slip_rate[0] == pytest.approx(rate)
    for method in ("dop853", "cvodes"):
        own = simulate_state(
            fault(), rate, duration=50.0, start_state=older, inertia=False, method=method, times=run.time
        )
        assert run.slip_rate == pytest.approx(own.slip_rate, rel=1e-5)
    assert len(simulate(fault(), duration=50.0).time) != 6


def test_a_fault_without_a_state_has_no_tide():
    with pytest.raises(ParameterError, match="apply only to friction with a state"):
        simulate(load_fault("real-fault"), tide=Tide(amplitude=1.0))


def test_a_step_goes_through_the_layer_as_in_carslaw_and_jaeger():
    """1 − (4/π)Σ(−1)ⁿ/(2n + 1)e^(−((2n + 1)π/2)²t/τ) after a unit step of the well."""
    loop = _Loop.of(fault(), PressurePath(diffusion=PATH), Tide(), SlidingVariation(), False, None)
    for share in (0.05, 0.2, 1.0):
        time = share * float(PATH)
        n = np.arange(200)
        terms = (-1.0) ** n / (2 * n + 1) * np.exp(-(((2 * n + 1) * math.pi / 2) ** 2) * share)
        pressure = loop.pressure(0.0, 1.0, time, np.zeros(24))
        assert pressure == pytest.approx(1 - 4 / math.pi * np.sum(terms), abs=1e-9)


@pytest.mark.slow
def test_control_holds_what_runs_away_without_it():
    tide, model = Tide(amplitude=1e3, period=4000.0), sliding_model(fault())
    held = simulate_sliding(
        fault(), sliding_law(model, STEP, diffusion=PATH), STEP, diffusion=PATH, tide=tide, duration=15000.0
    )
    free = simulate_sliding(fault(), asking_for(0), STEP, tide=tide, duration=8000.0)
    assert held.outcome.kind == "tracked"
    assert np.max(np.abs(np.log(held.slip_rate / V))) < 0.01
    assert np.max(np.abs(np.log(free.slip_rate / V))) > 0.2


def test_with_inertia_a_held_run_is_the_same_to_a_thousandth():
    tide, law = Tide(amplitude=10e3, period=3000.0), sliding_law(sliding_model(fault()), STEP)
    runs = [simulate_sliding(fault(), law, STEP, tide=tide, duration=1200.0, inertia=x) for x in (True, False)]
    size = np.max(np.abs(runs[1].slip_error))
    assert runs[0].slip_error == pytest.approx(runs[1].slip_error, abs=1e-3 * size)


def test_a_law_that_asks_for_all_of_the_normal_stress_opens_the_fault():
    greedy = dataclasses.replace(asking_for(0), feedback=(Fraction(10) ** 15, Fraction(0)))
    tide = Tide(amplitude=40e3, period=1000.0)
    run = simulate_sliding(fault(), greedy, STEP, tide=tide, duration=4000.0, settled_from=3999.0)
    assert run.outcome.kind == "opened"
    assert run.events["opening"] == pytest.approx(run.time[-1], rel=1e-12)
    assert (run.metrics.max_slip_error, run.metrics.rms_pressure) == (None, None)  # it ends before errors count
    assert run.metrics.peak_slip_rate == max(run.slip_rate)


def test_a_pump_that_reaches_the_normal_stress_itself_opens_the_fault():
    greedy = dataclasses.replace(asking_for(0), feedback=(Fraction(10) ** 15, Fraction(0)))
    stages, tide = (Saturation(lowest=-NORMAL, highest=NORMAL),), Tide(amplitude=40e3, period=1000.0)
    run = simulate_sliding(fault(), greedy, STEP, stages=stages, tide=tide, duration=4000.0)
    assert run.outcome.kind == "opened"


def test_a_run_starts_in_steady_sliding_also_where_stress_changes_the_state():
    sensitive = fault(stress_sensitivity=0.3)
    run = simulate_sliding(sensitive, sliding_law(sliding_model(fault()), STEP), STEP, duration=40.0)
    assert (run.slip_rate[0], run.theta[0]) == pytest.approx((V, D / V), rel=1e-10)


def test_a_run_can_be_handed_on_and_others_are_refused():
    law = sliding_law(sliding_model(fault()), STEP)
    run = simulate_sliding(fault(), law, STEP, duration=80.0)
    assert run.to_xarray()["slip_error"].attrs["units"] == "m"
    assert len(run.time) == 9
    told_the_rate = dataclasses.replace(law, feedback=(law.feedback[0], Fraction(1)))
    for given, of in ((load_fault("real-fault"), law), (fault(), told_the_rate)):
        with pytest.raises(ParameterError, match="friction with one state"):
            simulate_sliding(given, of, STEP)
    with pytest.raises(ParameterError, match="method must be one of"):
        simulate_sliding(fault(), law, STEP, method="radau")
    assert np.array_equal(run.signals()["slip_error"][0], run.slip - run.reference)
    with pytest.raises(ParameterError, match="duration must be positive"):
        simulate_sliding(fault(), law, STEP, duration=0.0)
    for samples in (0, -1):
        with pytest.raises(ParameterError, match="samples must be a whole number of at least 1"):
            simulate_sliding(fault(), law, STEP, samples=samples)
    with pytest.raises(ParameterError, match="stress must be zero or positive"):
        Tide(amplitude=-1.0)
