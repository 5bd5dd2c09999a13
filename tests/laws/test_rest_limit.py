"""A limit of the pressure at rest: never reached where it is proved, and told to the law where it cuts off."""

from dataclasses import asdict, replace
from fractions import Fraction as F
from itertools import product

import control
import numpy as np
import pytest

import quakedesign as qd
from quakedesign import simulate
from quakedesign.errors import ParameterError
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.fault import load_fault
from quakedesign.guarantees import SampledLoop, guarantee
from quakedesign.guarantees.search.worst_case import _Limit, _searched, worst_tracking
from quakedesign.laws import (
    ErrorModel,
    RestLimit,
    SampledController,
    Signals,
    disturbance_estimate,
    slip_observer,
    summed_integrals,
)
from quakedesign.loop import Actuator, Delay, Diffusion, Lag
from quakedesign.loop.diffusion_path import DiffusionPath
from quakedesign.loop.schemes.compensated import Compensated
from quakedesign.plant import uncertain_plant
from quakedesign.simulation import Variation, to_iosystem
from quakedesign.simulation.campaign import campaign_problem
from quakedesign.simulation.campaign.space import Sample

REAL, STEP, GAIN = load_fault("real-fault"), F("0.184"), F("2.282e-8")
GAINS = F(672300000), F(206000000)
LATE = ErrorModel.delayed(
    ((F(1), F("0.16")), (F("0.07"), F("0.75"))), ((F("0.002"), F("0.01")), (F("0.013"), F("0.15"))), GAIN
)
ARRIVAL = (F(1), F("0.184"), GAIN * F("0.015")), (F("0.07"), F("0.75"), GAIN * F("0.16"))  # errors there
LATE_GAINS = tuple(GAINS[0] * slip + GAINS[1] * rate for slip, rate in zip(*ARRIVAL, strict=True))


LOOSE = RestLimit(width=F(100), per_slip=F(7), resolution=F(10**9))  # wherever the fault goes, it rests


@pytest.fixture(scope="module")
def proved():
    model = ErrorModel.delayed(((F(1), F(0)), (F("0.0722"), F("0.7475"))), ((F(0), F("0.1596")),), GAIN)
    law = disturbance_estimate(GAINS, F("0.57"), model)
    return guarantee(uncertain_plant(REAL), SampledLoop(law=law, step=STEP))


def stepped(controller, z, slip_error, rate_error, reference):
    """Pressure and states after a sample, in floats."""
    signals = Signals(
        slip=reference + slip_error,
        slip_rate=rate_error,
        slip_error=slip_error,
        slip_rate_error=rate_error,
        integrals=tuple(z),
    )
    rates = controller.integral_rates(signals)
    after = [float(v + float(controller.step) * rate) for v, rate in zip(z, rates, strict=True)]
    return float(controller.pressure(signals)), after


def cut(asked, highest, width):
    """The limit by hand, at the pressures of before."""
    return max(asked, highest - width)


def test_a_law_with_an_estimate_expects_what_is_applied():
    """π ← of_slip·e1 + of_rate·e2 + Σγ_j(βb·p_j + d) with the p that is applied; one period late p_1 is that too."""
    law = disturbance_estimate(LATE_GAINS, F("0.57"), LATE)
    limit = RestLimit(width=F(50), per_slip=F(0), resolution=F(1))
    controller = SampledController(law=law, step=STEP, rest_limit=limit)
    z, highest, cuts, random = [0.0] * 5, 0.0, 0, np.random.default_rng(5)
    for _ in range(8):
        e1, e2 = random.normal(0, 1e-6, 2)
        expected, level, before = z[:3]
        level += 0.57 * (e2 - expected) / 0.16
        pushed = 2.282e-8 * before + level
        ahead = e1 + 0.184 * e2 + 0.015 * pushed, 0.07 * e1 + 0.75 * e2 + 0.16 * pushed
        asked = -float(GAINS[0]) * ahead[0] - float(GAINS[1]) * ahead[1] - level / 2.282e-8
        applied = cut(asked, highest, 50)
        cuts, highest = cuts + (applied != asked), max(highest, applied)
        predicted = 0.07 * e1 + 0.75 * e2 + 0.01 * (2.282e-8 * applied + level) + 0.15 * pushed
        pressure, z = stepped(controller, z, e1, e2, 0.0)
        assert pressure == pytest.approx(applied, rel=1e-9)
        assert z == pytest.approx([predicted, level, applied, highest, e1], rel=1e-9, abs=1e-12)
    assert 0 < cuts < 8


def test_an_observer_expects_what_is_applied():
    law = slip_observer(LATE_GAINS, (F("0.9"), F("3.5"), F("3.2")), LATE)
    limit = RestLimit(width=F(50), per_slip=F(0), resolution=F(1, 10**6))
    limited, free = (SampledController(law=law, step=STEP, rest_limit=one) for one in (limit, None))
    z = [1e-6, -1e-6, 1e-6, 20.0, 30.0, 1.5e-6]
    asked, expected = stepped(free, z[:4], 2e-6, 0.0, 0.0)
    applied, found = stepped(limited, z, 2e-6, 0.0, 0.0)
    assert applied == pytest.approx(-20, rel=1e-12)
    assert asked < -21
    beyond = 2.282e-8 * (applied - asked)
    expected = [expected[0] + 0.002 * beyond, expected[1] + 0.01 * beyond, expected[2], applied]
    assert found == pytest.approx([*expected, 30.0, 2e-6], rel=1e-9)
    moving = [*z[:5], 0.5e-6]  # by more than the resolution
    assert stepped(limited, moving, 2e-6, 0.0, 0.0)[0] == asked


@pytest.mark.slow
def test_it_is_not_reached_where_the_pressure_follows_one_that_moves_with_the_reference():
    """|p − p*| ≤ 50 Pa and |dp*/dr| ≤ 7 Pa/m, p* from 0: never, however p* turns; beyond 50 Pa it is."""
    law = summed_integrals((F(1), F(0), F(0), F(0)), F(1))  # p = −e1
    controller = SampledController(law=law, step=F(1), rest_limit=LOOSE)
    for away, reached in ((50, False), (70, True)):
        random, cuts = np.random.default_rng(3), 0
        for _ in range(20):
            z, reference, rest = [0.0] * (len(law.states) + 2), 0.0, 0.0
            for _ in range(60):
                moved = random.exponential(3.0) * (random.random() < 0.7)
                reference, rest = reference + moved, rest + 7 * moved * random.choice([-1, 1, 1])
                asked = rest + away * random.choice([-1, 1])
                pressure, z = stepped(controller, z, -asked, 0.0, reference)
                cuts += not np.isclose(pressure, asked, rtol=1e-9, atol=1e-9)
        assert (cuts > 0) == reached


@pytest.mark.slow
def test_on_a_fault_that_sticks_the_pressure_stays_where_it_is_proved_to_stay(proved):
    """Ahead of a reference that comes to rest the fault rests for ever: the pressure without limits goes on to fall."""
    claims = proved.claims
    free, limited = (
        simulate(REAL, one.controller, plant="stick-slip", samples=20_000) for one in (proved.sampled_loop, proved)
    )
    assert free.pressure.min() < 1.2 * float(claims.least_pressure)
    assert limited.pressure.min() > claims.least_pressure
    for run in (free, limited):
        assert run.metrics.max_slip_error < claims.slip_error
        assert run.metrics.max_slip_rate_error < claims.slip_rate_error


@pytest.mark.slow
def test_single_runs_campaigns_and_python_control_cut_alike(proved):
    limit = RestLimit(width=F(4000), per_slip=F(10**6), resolution=F(1))
    tight = replace(proved.controller, rest_limit=limit)
    run = simulate(REAL, tight, duration=18.4, samples=101)
    free = simulate(REAL, replace(tight, rest_limit=None), duration=18.4, samples=101)
    assert np.abs(run.pressure - free.pressure).max() > 1000
    slow = simulate(REAL, tight, duration=18.4, samples=101, compiled=False)
    assert np.array_equal(run.pressure, slow.pressure)
    problem = campaign_problem(REAL, tight, duration=18.4)
    numbers = asdict(Variation()) | {"initial_slip": 0.0, "initial_slip_rate": 0.0}
    start = problem.start(Sample(numbers=numbers, noise_seed=0))
    (end,) = problem.program.ends([start], problem.setting.steps)
    assert end[2] == pytest.approx(run.slip[-1], rel=1e-12)
    system = to_iosystem(tight)
    told = np.vstack([run.slip, run.slip_rate, run.reference, run.reference_rate])
    response = control.input_output_response(system, 0.184 * np.arange(len(run.time)), told)
    assert np.allclose(response.outputs, run.pressure, rtol=1e-9, atol=1e-6)


def test_a_guarantee_has_limits_of_what_it_proves(proved):
    """Twice what the proved pressure is beyond p*, and what p* does while a pressure is on its way, rounded up."""
    claim, limit = proved, proved.rest_limit
    low, high = claim.task.rest_pressure
    beyond = max(low - claim.claims.least_pressure, claim.claims.largest_pressure - high)
    assert 2 * beyond <= limit.width <= F(1001, 1000) * 2 * beyond
    steepest = 0.0
    stiff, _, wide = (float(v) for v in claim.task.spreads)
    for k, n in product((1 - stiff, 1 + stiff), (1 - wide, 1 + wide)):  # friction and p* together carry the spring
        slip = np.linspace(0, 0.785, 20_001)
        friction = 0.2353 + 0.1 * np.exp(-slip / 0.27635)
        rest = 50e6 - (0.3353 * 50e6 - k / n * 30e9 / 5000 * slip) / friction
        steepest = max(steepest, float(np.abs(np.diff(rest) / np.diff(slip)).max()))
    assert steepest <= limit.per_slip <= 3 * steepest
    late = replace(claim, sampled_loop=replace(claim.sampled_loop, delay=F(100)))  # so that it counts in four digits
    more = float(limit.per_slip * claim.task.reference_rates[0] * 100)
    assert float(late.rest_limit.width - limit.width) == pytest.approx(more, rel=0.01)
    assert claim.controller == replace(claim.sampled_loop.controller, rest_limit=limit)
    way = float(claim.task.reference_rates[0]) * 0.184
    assert float(limit.resolution) == pytest.approx(way / 100, rel=1e-3)
    noisy = replace(claim, sampled_loop=replace(claim.sampled_loop, slip_noise=F(1, 10**6)))
    assert float(noisy.rest_limit.resolution) == pytest.approx(2e-6 + way / 100, rel=1e-3)


def test_pressures_that_are_proved_never_to_be_passed_are_cut_off_unless_the_fault_goes_faster():
    """p = −e1 Pa, within −3 and 2 Pa for slips of at most 5 m a sample, at rest or not."""
    law = summed_integrals((F(1), F(0), F(0), F(0)), F(1))
    limit = RestLimit(width=F(100), per_slip=F(0), resolution=F(0), least=F(-3), largest=F(2), fastest=F(5))
    controller = SampledController(law=law, step=F(1), rest_limit=limit)
    cases = (4.0, 4.0, -3.0), (4.0, 0.0, -3.0), (-4.0, 0.0, 2.0), (1.0, 0.0, -1.0), (9.0, 0.0, -9.0)
    for error, last, applied in cases:
        pressure, after = stepped(controller, [*(0.0 for _ in law.states), 0.0, last], error, 0.0, 0.0)
        assert pressure == applied
        assert after[len(law.states)] == max(0.0, applied)  # the highest so far is that which was applied
    with pytest.raises(ParameterError, match="both omitted"):
        replace(limit, largest=None)
    with pytest.raises(ParameterError, match="least <= 0 <= largest"):
        replace(limit, largest=F(-1))
    with pytest.raises(ParameterError, match=r"fastest of a limit at rest must be 0 or more. Received -1 m"):
        replace(limit, fastest=F(-1))


def test_a_guarantee_cuts_off_what_it_proves_never_to_be_passed(proved):
    claims, limit, way = proved.claims, proved.rest_limit, proved.claims.peak_slip_rate * STEP
    assert (limit.least, limit.largest) == (claims.least_pressure, claims.largest_pressure)
    assert way <= limit.fastest <= way * F(1001, 1000)
    off = replace(proved, sampled_loop=replace(proved.sampled_loop, slip_noise=F(1), jitter=F(1, 100)))
    moved = 2 + proved.claims.peak_slip_rate * (STEP + F(2, 100))
    assert moved <= off.rest_limit.fastest <= moved * F(1001, 1000)
    late = replace(claims, least_asked=LowerBound(-(10**8)), largest_asked=UpperBound(10**8))
    behind = replace(proved, claims=late, sampled_loop=replace(proved.sampled_loop, lag=F(1))).rest_limit
    assert (behind.least, behind.largest) == (-(10**8), 10**8)  # of the valve, where the law acts


@pytest.mark.slow
def test_where_the_fault_sticks_no_course_takes_the_pressure_beyond_what_is_certified(proved):
    """The limit at rest alone allows twice the proved |p − p*|: before, courses left the interval."""
    seen, claims = worst_tracking(proved, sticks=True), proved.claims
    assert claims.least_pressure <= seen.least_pressure < 0.97 * claims.least_pressure
    assert 0.97 * claims.largest_pressure < seen.largest_pressure <= claims.largest_pressure
    assert worst_tracking(proved).pressures is None


def test_an_independent_adversary_does_not_leave_the_certified_pressure(proved):
    """Pushes at random ends from the end of the task on, where p* is lowest, on the stick-slip plant in plain Euler."""
    law, limit, authority = proved.sampled_loop.law, proved.rest_limit, float(proved.task.authority)
    rows, seen, output, fed = (np.array(m, dtype=float) for m in (law.update, law.measured, law.output, law.feedback))
    told = np.array(law.applied, dtype=float)
    random, low, high = np.random.default_rng(11), *(float(p) for p in proved.task.rest_pressure)
    ends = [float(v) for v in proved.task.slip_chord], [float(v) for v in proved.task.rate_chord]
    beta, pieces, count = [float(b) for b in proved.task.beta], 20, 400
    for rest in (low, high):
        e1, e2, z = np.zeros(count), np.zeros(count), np.zeros((count, 2))
        highest, last, cuts = np.full(count, rest), np.zeros(count), 0
        push = random.choice([-1.0, 1.0], count) * float(proved.task.amplitude)
        gain = random.choice(beta, count)
        for _ in range(150):
            asked = rest + z @ output + np.outer(e1, fed[:1])[:, 0] + fed[1] * e2
            still = e1 <= last + float(limit.resolution)
            applied = np.where(still, np.maximum(asked, highest - float(limit.width)), asked)
            inside = np.clip(applied, float(limit.least), float(limit.largest))
            applied = np.where(e1 <= last + float(limit.fastest), inside, applied)
            assert float(proved.claims.least_pressure) <= applied.min()
            assert applied.max() <= float(proved.claims.largest_pressure)
            cuts += int((inside != asked).sum())
            z = z @ rows.T + np.outer(e1, seen[:, 0]) + np.outer(e2, seen[:, 1]) + np.outer(applied - asked, told)
            highest, last = np.maximum(highest, applied), e1.copy()
            push = np.where(random.random(count) < 0.15, -push, push)
            for _ in range(pieces):
                slope, damping = random.choice(ends[0], count), random.choice(ends[1], count)
                force = slope * e1 - damping * e2 + gain * authority * (applied - rest) + push
                e2 = np.maximum(e2 + 0.184 / pieces * force, 0.0)  # a fault that rests does not slide backward
                e1 = e1 + 0.184 / pieces * e2
        assert cuts > 0


def test_the_adversary_s_limit_is_that_of_the_run(proved):
    """Of random errors while the reference goes at its largest rate: pressures and states of both, sample by sample."""
    task, law, random = proved.task, proved.sampled_loop.law, np.random.default_rng(2)
    authority, pace = float(task.authority), float(task.reference_rates[0])
    exact = RestLimit(
        width=F(4000), per_slip=task.drift / task.authority / task.reference_rates[0], resolution=F(1, 10**6)
    )
    controller = replace(proved.controller, rest_limit=exact)
    limit = replace(
        _Limit.of(proved, proved.sampled_loop, 6, np.array([pace])),
        width=4000 * authority,
        moved=0.0,
        rests=np.array([1e-6 - pace * 0.184]),
    )
    limit.last = limit.last + pace * 0.184  # the reference has not moved before the first sample
    rows, seen, output, fed = (np.array(m, dtype=float) for m in (law.update, law.measured, law.output, law.feedback))
    z, told, cuts = [0.0] * 4, np.zeros(2), 0
    for number in range(60):
        errors = random.normal(0, [1e-5, 5e-5])
        asked = output @ told + fed @ errors
        (state,) = limit.cut(
            np.array([[*errors, *(rows @ told + seen @ errors), asked * authority, 0.0]]), np.array([True])
        )
        told = state[2:4]
        pressure, z = stepped(controller, z, *errors, number * pace * 0.184)
        cuts += abs(pressure - asked) > 1
        assert state[4] / authority == pytest.approx(pressure, rel=1e-9, abs=1e-6)
        assert told == pytest.approx(z[:2], rel=1e-9)
        limit.follow(np.zeros((1, 6)), np.zeros((1, 6)))
        limit.moved = float(task.drift * STEP)
    assert 5 < cuts < 40


def test_what_the_adversary_cuts_off_moves_all_that_stands_at_the_valve(proved):
    """The pressure that waits alone; or the valve's, its last step, what is less it, and the kick of the rock."""
    layer, gain = DiffusionPath(time=F(1)), float(sum(proved.task.beta) / 2)
    modes = {f"layer{i}": -1.0 for i in range(8)}
    cases = (
        ({"delay": F("0.2")}, {"waiting0": 1.0}),
        ({"lag": F(1)}, {"valve": 1.0, "behind": -1.0}),
        ({"lag": F(1), "diffusion": F(1)}, {"valve": 1.0, "behind": -1.0}),
        ({"diffusion": F(1)}, {"valve": 1.0, "stepped": 1.0, "e2": -gain * float(layer.area), **modes}),
        ({"diffusion": F(1), "delay": F("0.1")}, {"waiting0": 1.0}),
    )
    own = dict(zip(("predicted_rate", "disturbance"), proved.sampled_loop.law.applied, strict=True))
    asked = {"least_asked": LowerBound(-(10**8)), "largest_asked": UpperBound(10**8)}
    for around, expected in cases:
        behind = any(name != "delay" for name in around)
        claims = replace(proved.claims, **(asked if behind else {}))
        claim = replace(proved, claims=claims, sampled_loop=replace(proved.sampled_loop, **around))
        states = claim.loop.states
        told = _Limit.of(claim, claim.sampled_loop, len(states) + 1, np.zeros(1)).correction
        expected |= {name: float(v / proved.task.authority) for name, v in own.items()}
        assert told == pytest.approx([expected.get(name, 0.0) for name in (*states, "disturbance of the class")])


def test_where_p_star_drifts_all_pressures_that_count_from_it_move(proved):
    limit = replace(_Limit.of(proved, proved.sampled_loop, 6, np.array([0.0])).anew(), within=(-9.0, 9.0))
    limit.cut(np.array([[0.0, 0.0, 0.0, 0.0, 3.0, 0.0]]), np.array([True]))
    limit.follow(np.zeros((1, 6)), np.array([[0.0, 0.0, 0.0, 0.0, -2.0, 0.0]]))
    assert limit.highest == pytest.approx([1.0])


@pytest.mark.slow
def test_the_search_with_stick_lets_the_limit_follow_every_step(proved, monkeypatch):
    followed = []
    monkeypatch.setattr(_Limit, "follow", lambda _, before, after: followed.append((before[0, 4], after[0, 4])))
    _searched(proved, True)
    drift = float(proved.task.drift * STEP) / 6
    assert len(followed) > 1000
    assert max(abs(after - before) for before, after in followed) == pytest.approx(drift, rel=1e-6)


@pytest.mark.slow
def test_the_adversary_is_held_by_the_limit_and_only_with_stick(proved, monkeypatch):
    """Where the pressure may never fall, however fast the fault goes, what pushes forward makes an earthquake."""
    before = [_searched(proved, sticks) for sticks in (False, True)]
    never = RestLimit(width=F(1, 100), per_slip=F(0), resolution=F(10**9))
    monkeypatch.setattr(type(proved), "rest_limit", property(lambda _: never))
    assert _searched(proved, False) == before[0]
    assert before[1][1] < proved.claims.slip_rate_error < _searched(proved, True)[1] / 10


def test_behind_a_lag_it_is_that_of_what_is_claimed_at_the_valve(proved):
    low, high = proved.task.rest_pressure
    asked = {"least_asked": LowerBound(low - 10**6), "largest_asked": UpperBound(high + 3 * 10**6)}
    for around in ({"lag": F(1)}, {"diffusion": F(1)}):
        behind = replace(proved, sampled_loop=replace(proved.sampled_loop, **around))
        assert behind.rest_limit is None
        assert replace(behind, claims=replace(proved.claims, **asked)).rest_limit.width == 6 * 10**6
    assert (
        replace(
            proved, sampled_loop=replace(proved.sampled_loop, law=replace(proved.sampled_loop.law, applied=()))
        ).rest_limit
        is None
    )


LAG, ROCK = Lag(time_constant=0.2), Diffusion(length=1.0, diffusivity=1.0)
THROUGH = {"diffusion": F(1)}
BEHIND = {
    "lag": (F("0.184"), {"lag": F("0.2")}, (LAG,), 8),
    "late, lag": (F("0.184"), {"lag": F("0.05"), "delay": F("0.184")}, (Delay(samples=1), Lag(time_constant=0.05)), 16),
    "rock": (F("0.05"), THROUGH, (ROCK,), 30),
    "lag, rock": (F("0.05"), {"lag": F("0.2"), **THROUGH}, (LAG, ROCK), 30),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BEHIND)
def test_behind_a_lag_and_rock_a_fault_that_sticks_does_not_wind_up(name):
    """Ahead of its reference the fault rests, and without the limit the pressure falls on. One that moves is free."""
    step, around, stages, substeps = BEHIND[name]
    found = qd.guarantee(REAL, step=step, **around).proof
    told = {"actuator": Actuator(stages=stages), "substeps": substeps, "duration": 4000.0, "samples": 500}
    free = replace(found.controller, rest_limit=None)
    runs = {
        (plant, one.rest_limit is None): simulate(REAL, one, plant=plant, **told)
        for plant in ("printed", "stick-slip")
        for one in (found.controller, free)
    }
    with_limit, without = (runs["printed", alone].pressure for alone in (False, True))
    assert np.abs(with_limit - without).max() <= 1e-12 * np.abs(without).max()  # their sums are rounded differently
    assert runs["stick-slip", True].pressure.min() < 1.5 * runs["stick-slip", False].pressure.min()
    assert runs["stick-slip", False].pressure.min() > -1.02 * float(found.rest_limit.width)
    for run in (runs["stick-slip", False], runs["printed", False]):
        assert run.metrics.max_slip_error < found.claims.slip_error
        assert run.metrics.max_slip_rate_error < found.claims.slip_rate_error


def test_the_compensated_step_is_told_what_is_applied():
    """Deadbeat, p = (−e1/T_s − e2)/(T_sB0) − d, d ← d + a[(e2 − e2⁻)/(T_sB0) − p⁻ − d] with the p⁻ that was applied."""
    made = qd.guarantee(REAL, controller="cta", plant="printed").compensation
    weight, authority, per_slip = float(made.weight), float(made.authority), float(made.proof.rest_limit.per_slip)
    assert dict(made.limited.sampling.settings)["rest_width"] == made.proof.rest_limit.width
    law, gain = replace(made.controller, sampling=None), 0.184 * authority
    scheme = Compensated(
        weight=weight, authority=authority, rest_width=15000.0, rest_per_slip=per_slip, rest_resolution=1.0
    )
    run = simulate(REAL, law, scheme=scheme, duration=18.4, samples=101)
    errors = zip(run.slip - run.reference, run.slip_rate - run.reference_rate, run.reference, strict=True)
    level, before, highest, last, cuts, found = 0.0, None, 0.0, 0.0, 0, []
    for e1, e2, reference in errors:
        level = 0.0 if before is None else level + weight * ((e2 - before[0]) / gain - before[1] - level)
        asked = (-e1 / 0.184 - e2) / gain - level
        highest, last = highest - per_slip * abs(reference - last), reference
        applied = cut(asked, highest, 15000.0)
        highest, before = max(highest, applied), (e2, applied)
        cuts += applied != asked
        found.append(applied)
    assert 5 < cuts < 95
    assert run.pressure == pytest.approx(found, rel=1e-6, abs=1e-3)
    with pytest.raises(ParameterError, match="width of a limit at rest must be positive"):
        Compensated(rest_width=0.0)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ((0, 1, 0), "width of a limit at rest must be positive. Received 0 Pa"),
        ((-1, 1, 0), "width of a limit at rest must be positive. Received -1 Pa"),
        ((1, -1, 0), "per_slip of a limit at rest must be 0 or more. Received -1 Pa/m"),
        ((1, 1, -1), "resolution of a limit at rest must be 0 or more. Received -1 m"),
    ],
)
def test_a_limit_that_makes_no_sense_is_refused(wrong, said):
    width, per_slip, resolution = map(F, wrong)
    with pytest.raises(ParameterError, match=said):
        RestLimit(width=width, per_slip=per_slip, resolution=resolution)
