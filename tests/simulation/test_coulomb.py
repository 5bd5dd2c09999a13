"""Set-valued friction against closed forms, against another integrator with its own events, and against itself."""

import dataclasses
import math

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from thinned import few

from quakedesign.errors import ParameterError
from quakedesign.fault import Disturbance, load_fault
from quakedesign.laws import published
from quakedesign.simulation import Metrics, natural_earthquake, simulate
from quakedesign.simulation.coulomb import CoulombLoop, _onset, _StepMotion, _stop
from quakedesign.simulation.integrators import ClassicRungeKutta

REAL = load_fault("real-fault")
BLOCK = dataclasses.replace(REAL, damping=0.0, friction=dataclasses.replace(REAL.friction, drop=0.0))
STRENGTH = BLOCK.friction.residual * BLOCK.authority * BLOCK.effective_normal_stress  # of constant friction [m/s²]
FREQUENCY = BLOCK.natural_frequency


def pushed(fault, **load):
    return fault.with_disturbance(Disturbance(**load))


def turning_points(parts, push=9.3, halves=8):
    """Slips [units of μσ'N̂/k̂] at multiples of half a period, and the run."""
    half = math.pi / FREQUENCY
    run = simulate(
        pushed(BLOCK, constant=push * STRENGTH),
        step=half / parts,
        duration=halves * half * (1 + 1e-9),
        samples=halves * parts,
        plant="coulomb",
    )
    return run.slip[::parts] * FREQUENCY**2 / STRENGTH, run


def test_a_block_on_a_spring_loses_two_friction_lengths_every_half_cycle():
    """A push of 9.3 μN: half amplitudes 9.3, 7.3, 5.3, 3.3, 1.3 about 9.3, 11.3, 9.3 …, then rest in the band."""
    found, run = turning_points(320)
    assert np.allclose(found, [0, 18.6, 4.0, 14.6, 8.0, 10.6, 10.6, 10.6, 10.6], rtol=0, atol=1e-10)
    assert abs(1 + 9.3 - found[-1]) <= 1
    half = math.pi / FREQUENCY
    assert np.all(run.slip_rate[run.time > 5.001 * half] == 0)
    assert len(set(run.slip[run.time > 5.001 * half])) == 1
    assert run.events["reverse_slip"] == pytest.approx(half, abs=1.5 * half / 320)
    assert run.events["stick"] == pytest.approx(5 * half, abs=1.5 * half / 320)


def test_the_turning_points_converge_with_the_order_of_the_integrator():
    exact = np.array([0, 18.6, 4.0, 14.6, 8.0, 10.6, 10.6, 10.6, 10.6])
    errors = [np.max(np.abs(turning_points(parts)[0] - exact)) for parts in (20, 40, 80)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 4.8)


@pytest.mark.parametrize("push", [0.4, 1.9, 2.1, 3.7])
def test_it_comes_back_only_if_the_spring_can_pull_it(push):
    """From a critically loaded start the block overshoots to twice the push; it stays if that is at most 2 μN."""
    found, run = turning_points(200, push, halves=3)
    assert found[1] == pytest.approx(2 * push, rel=1e-9)
    assert found[2] == pytest.approx(2 * push if push <= 2 else 4.0, rel=1e-9)
    assert ("reverse_slip" in run.events) == (push > 2)


@few(
    "load",
    [
        {"constant": -1e-3},
        {"constant": -1.0, "amplitude": 0.9, "frequency": 0.3},
        {"constant": -2 * STRENGTH * (1 - 1e-12)},
        {},
    ],
    every=2,
)
def test_a_load_that_friction_carries_never_moves_it(load):
    run = simulate(pushed(REAL, **load), duration=2000.0, samples=10**6, plant="coulomb")
    assert not np.any(run.slip)
    assert not np.any(run.slip_rate)
    assert run.metrics.stick_fraction == 1
    assert set(run.events) == {"stick"}


def test_a_load_just_beyond_the_band_moves_it_backward():
    run = simulate(pushed(BLOCK, constant=-2 * STRENGTH * (1 + 1e-9)), duration=30.0, step=0.01, plant="coulomb")
    assert np.min(run.slip) < 0
    assert run.events["reverse_slip"] == 0.01


def test_as_long_as_slip_is_forward_the_digits_are_those_of_the_smooth_plant():
    smooth, set_valued = (natural_earthquake(REAL, pressure=1e6, plant=name) for name in ("smooth", "coulomb"))
    stop = np.argmax(smooth.slip_rate < 0) if np.any(smooth.slip_rate < 0) else len(smooth.time)
    assert stop > 500
    assert np.array_equal(smooth.slip[:stop], set_valued.slip[:stop])
    assert np.array_equal(smooth.slip_rate[:stop], set_valued.slip_rate[:stop])
    assert smooth.metrics.peak_slip_rate == set_valued.metrics.peak_slip_rate


def test_an_earthquake_ends_where_the_slip_rate_falls_to_zero():
    """Underdamped, the smooth plant swings back; friction holds the real one there."""
    light = dataclasses.replace(REAL, damping=REAL.damping / 20)
    smooth, held = (natural_earthquake(light, plant=name) for name in ("smooth", "coulomb"))
    assert "reverse_slip" in smooth.events
    assert set(held.events) == {"stick"}
    assert held.slip[-1] == pytest.approx(np.max(smooth.slip), rel=1e-4)
    assert held.slip_rate[-1] == 0


class Oracle:
    """The inclusion by scipy: DOP853 in each of the three modes, switched at located events; eqs. typed in again."""

    def __init__(self, fault, gains):
        self.fault, self.gains = fault, gains

    def pressure(self, y):
        return -float(np.dot(self.gains, y))

    def acceleration(self, t, y, direction):
        fault, load, law = self.fault, self.fault.disturbance, self.fault.friction
        coefficient = law.residual + law.drop * math.exp(-max(y[0], 0.0) / law.critical_slip)
        start = (law.residual + law.drop) * fault.effective_normal_stress
        shaking = load.constant + load.amplitude * math.sin(load.frequency * t) + load.slip_growth * y[0]
        friction = direction * coefficient * (fault.effective_normal_stress - self.pressure(y))
        spring = fault.specific_stiffness * y[0] + fault.specific_damping * y[1]
        return shaking + fault.authority * (start - friction) - spring

    def reference(self, t):
        stage = t / self.fault.reference.operation_time
        return self.fault.reference.target_slip * stage**3 * (10 - 15 * stage + 6 * stage**2)

    def run(self, y, times):
        t, end, found = 0.0, times[-1], np.empty((4, len(times)))
        while t < end:
            direction = self.direction(t, y)
            solution = solve_ivp(
                lambda now, z, d=direction: self.field(now, z, d),
                (t, end),
                y,
                method="DOP853",
                events=self.ends(direction),
                dense_output=True,
                rtol=1e-12,
                atol=1e-18,
                max_step=0.05,
            )
            covered = (times >= t) & (times <= solution.t[-1])
            if np.any(covered):
                found[:, covered] = solution.sol(times[covered])
            t, y = solution.t[-1], solution.y[:, -1].copy()
            if direction:
                y[1] = 0.0
            self.leaving = 0 if direction else (1 if self.acceleration(t, y, 0) > 0 else -1)
        return found

    leaving = 0

    def direction(self, t, y):
        if y[1] != 0:
            return int(np.sign(y[1]))
        if self.leaving:
            return self.leaving
        return int(self.acceleration(t, y, 1) > 0) - int(self.acceleration(t, y, -1) < 0)

    def field(self, t, y, direction):
        rates = [y[1], self.acceleration(t, y, direction)] if direction else [0.0, 0.0]
        return [*rates, y[0] - self.reference(t), y[2]]

    def ends(self, direction):
        def stop(t, y):
            return y[1]

        def forward(t, y):
            return self.acceleration(t, y, 1)

        def backward(t, y):
            return -self.acceleration(t, y, -1)

        found = [stop] if direction else [forward, backward]
        for event in found:
            event.terminal = True
            event.direction = -direction if direction else 1
        return found


@pytest.mark.slow
def test_a_shaken_block_agrees_with_scipys_events():
    """Stick, slip forward and slip backward under a harmonic load: about thirty changes between them."""
    fault = pushed(BLOCK, constant=-STRENGTH, amplitude=1.6 * STRENGTH, frequency=0.31)
    run = simulate(fault, step=0.02, duration=200.01, samples=400, plant="coulomb")
    expected = Oracle(fault, [0.0] * 4).run([0.0] * 4, run.time)
    assert {-1, 0, 1} <= set(np.sign(expected[1]))
    assert {"reverse_slip", "stick"} <= set(run.events)
    assert np.max(np.abs(run.slip - expected[0])) < 1e-10 * np.ptp(expected[0])


@pytest.mark.slow
def test_the_published_linear_law_sticks_most_of_the_time_and_agrees_with_scipy():
    """ERRATA 14: e-LQR with the paper's shaking, where the smooth plant runs backward."""
    controller = published("real-fault")["elqr"]
    run = simulate(REAL, controller, step=0.0046, duration=200.0, samples=400, plant="coulomb")
    expected = Oracle(REAL, [float(gain) for gain in controller.gains.values()]).run([0.0] * 4, run.time)
    assert "reverse_slip" not in run.events
    assert run.metrics.stick_fraction > 0.9
    assert np.max(np.abs(run.slip - expected[0])) < 1e-9 * np.max(expected[0])


@pytest.mark.slow
@pytest.mark.parametrize("law", ["cta", "dia", "elqr"])
def test_published_controllers_follow_the_reference_without_reverse_slip(law):
    """In the paper's runs δ' < 0 nearly half of the time; with friction in both directions the fault rests instead."""
    controller = published("real-fault")[law]
    smooth, held = (simulate(REAL, controller, duration=20000.0, plant=name) for name in ("smooth", "coulomb"))
    assert smooth.metrics.reverse_slip_fraction > 0.3
    assert held.metrics.reverse_slip_fraction == 0
    assert held.metrics.stick_fraction > 0.5
    assert set(held.events) == {"stick"}
    assert held.metrics.max_slip_error < 1.05 * smooth.metrics.max_slip_error
    assert held.metrics.pressure_total_variation < smooth.metrics.pressure_total_variation


def test_the_monitor_agrees_with_numpy():
    run = simulate(
        pushed(BLOCK, amplitude=3 * STRENGTH, frequency=0.3),
        duration=100.0,
        step=0.05,
        samples=10**6,
        settled_from=10.0,
        plant="coulomb",
    )
    kept = run.time > 10.0
    assert run.metrics.stick_fraction == np.mean(run.slip_rate[kept] == 0)
    assert run.metrics.reverse_slip_fraction == np.mean(run.slip_rate[kept] < 0)
    assert run.metrics.reverse_slip_fraction > 0.05
    assert run.events["stick"] == run.time[1:][np.argmax(run.slip_rate[1:] == 0)]
    assert Metrics.unit("stick_fraction") == ""


@few("law", ["cta", "elqr"], every=2)
def test_both_backends_give_the_same_digits(law, monkeypatch):
    monkeypatch.setattr("quakedesign.simulation.compiled._WORTH", 0)
    setting = {"duration": 1001 * REAL.sampling_time, "samples": 40, "plant": "coulomb"}
    fast, slow = (simulate(REAL, published("real-fault")[law], compiled=c, **setting) for c in (None, False))
    if fast.provenance["backend"] != "compiled":
        pytest.skip(fast.provenance["backend_reason"])
    for name, (values, _, _) in fast.signals().items():
        assert np.array_equal(values, slow.signals()[name][0]), name
    assert fast.provenance["plant"] == "coulomb"
    assert fast.name.endswith("Coulomb friction")


def test_an_opened_fault_has_no_friction_in_any_direction():
    field = CoulombLoop(REAL).directed
    opened = REAL.effective_normal_stress * 1.01
    rates = {float(field(0, [0.1, 0.2], opened, direction)[1]) for direction in (1, -1)}
    free = REAL.friction.bounds[1] * REAL.authority * REAL.effective_normal_stress
    free -= REAL.specific_stiffness * 0.1 + REAL.specific_damping * 0.2
    free += REAL.disturbance.slip_growth * 0.1
    assert len(rates) == 1
    assert rates.pop() == pytest.approx(free, rel=1e-12)


def test_an_unknown_plant_is_refused():
    with pytest.raises(ParameterError, match=r"smooth, coulomb.*'sticky'"):
        simulate(REAL, plant="sticky")


def one_step(load, friction, rate, length):
    """Slip, rate, a state of the law that grows by 1 a second, and a work that grows by 2, after a step."""
    loop = CoulombLoop(REAL, published("real-fault")["cta"])
    assert len(loop.integrals) == 1
    vars(loop)["directed"] = lambda time, x, _, sense: ca.fabs(sense) * ca.vertcat(x[1], load(time) - sense * friction)

    def motion(plant, passed, now):
        return ca.vertcat(plant(passed * length, now[:2], 0), 1, 2)

    return loop.advance(ClassicRungeKutta, motion, ca.DM([0, rate, 0, 0]), length).full().ravel()


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize(
    ("load", "rate", "length", "slip", "end"),
    [
        (lambda _: 0, 2.0, 1.0, 1.5, 1.0),  # brakes by 1
        (lambda _: 0, 1.5, 1.0, 1.0, 0.5),
        (lambda _: 0, 0.5, 1.0, 0.125, 0.0),  # to rest after half of the step
        (lambda _: -1, 1.0, 1.0, 0.25, 0.0),  # at rest under a load that is just carried
        (lambda _: -3, 2.0, 1.0, 0.25, -1.0),  # brakes by 4, and after half of the step gets faster by 2 backward
        (lambda _: 3, 0.0, 1.0, 1.0, 2.0),
        (lambda _: 1, 0.0, 1.0, 0.0, 0.0),
        (lambda t: 4 * t, 0.0, 1.0, 4 / 6 * 0.75**3, 2 * 0.75**2),  # sets off after a quarter
        (lambda t: 1.6 * t, 0.0, 1.0, 1.6 / 6 * 0.375**3, 0.8 * 0.375**2),  # later than half
        (lambda t: 1 + t, 0.0, 1.0, 1 / 6, 1 / 2),
        (lambda t: t, 0.0, 1.0, 0.0, 0.0),  # carried up to the end
    ],
)
def test_under_a_friction_of_one_a_step_is_made_of_parabolas(sense, load, rate, length, slip, end):
    found = one_step(lambda t: sense * load(t), 1.0, sense * rate, length)
    assert found[:2] == pytest.approx([sense * slip, sense * end], rel=1e-13, abs=1e-15)
    assert (found[1] == 0) == (end == 0)
    assert found[2:] == pytest.approx([length, 2 * length], rel=1e-14)


def test_where_it_stops_twice_in_a_step_it_stays_at_the_first_stop_with_the_work_up_to_there():
    """x2 = 0.6 - 4 t + 4 t²: forward to the first root, then backward until a load that grows would turn it again."""
    stop = (4 - 6.4**0.5) / 8
    motion = np.polynomial.Polynomial([0.6, -4, 4])
    found = one_step(lambda t: -3 + 8 * t, 1.0, 0.6, 0.7)
    assert found == pytest.approx([motion.integ()(stop), 0.0, 0.7, 2 * stop], rel=1e-12, abs=0)


@pytest.mark.parametrize("root", [1e-6, 0.1, 0.5, 1 / 3, 0.9, 1 - 1e-6])
@pytest.mark.parametrize("further", [(-3.0, 2.0), (1.5, 4.0), (1.5, -0.5)])
def test_the_cubic_stops_at_its_root(root, further):
    """(s - root)(s - a)(s - b) up to its sign, with a and b outside of the step."""
    cubic = np.polynomial.Polynomial.fromroots([root, *further])
    cubic = cubic if cubic(0) > 0 else -cubic
    ends = [cubic(0), cubic(1), cubic.deriv()(0), cubic.deriv()(1)]
    assert float(_stop(*(ca.DM(v) for v in ends))) == pytest.approx(root, rel=1e-15, abs=5e-16)


def test_a_standstill_at_the_start_stops_at_once_and_a_straight_fall_where_the_line_does():
    assert float(_stop(*(ca.DM(v) for v in (0.0, -1.0, -1.0, -1.0)))) == pytest.approx(0, abs=1e-16)
    assert float(_stop(*(ca.DM(v) for v in (3.0, -1.0, -4.0, -4.0)))) == 0.75


@pytest.mark.parametrize(
    ("before", "after", "share"),
    [
        (-1.0, 3.0, 0.25),
        (-1.0, 0.5, 1 / 1.5),
        (0.5, 2.0, 0.0),
        (-1.0, 0.0, 0.0),
        (0.0, 2.0, 0.0),
        (1.0, 2.0, 0.0),
        (-1.0, -2.0, 0.0),
        (1.0, -1.0, 0.0),
    ],
)
def test_a_push_that_ends_positive_has_left_zero_on_its_secant(before, after, share):
    assert float(_onset(ca.DM(before), ca.DM(after))) == share


@pytest.mark.parametrize(
    ("push", "rate", "stress"),
    [
        (-0.5, 0.0, 0.5),
        (-1.0, 0.0, 0.0),
        (-1.75, 0.0, -0.75),
        (-2.5, 0.0, -1.0),
        (0.5, 0.0, 1.0),
        (-0.5, 1e-9, 1.0),
        (-0.5, -1e-9, -1.0),
    ],
)
def test_at_rest_the_shear_stress_is_what_carries_the_load(push, rate, stress):
    """In units of the strength; the fault begins on the verge of slip, so that a push adds to one."""
    loop = CoulombLoop(pushed(BLOCK, constant=push * STRENGTH))
    strength = BLOCK.friction.residual * BLOCK.effective_normal_stress
    found = loop.shear_stress(0.0, ca.DM([0.0, rate]), 0.0, BLOCK.friction.residual)
    assert float(found) / strength == pytest.approx(stress, rel=1e-12, abs=1e-12)
    eased = loop.shear_stress(0.0, ca.DM([0.0, 1.0]), 0.25 * BLOCK.effective_normal_stress, BLOCK.friction.residual)
    assert float(eased) / strength == pytest.approx(0.75, rel=1e-12)
    opened = loop.shear_stress(0.0, ca.DM([0.0, 1.0]), 2 * BLOCK.effective_normal_stress, BLOCK.friction.residual)
    assert float(opened) == 0


def test_at_rest_the_stress_is_that_of_the_slip_so_far_and_of_no_other_state():
    """A damping that is not zero, no slip rate, and the spring pulls back by k̂ x/N̂ of the strength on the verge."""
    loop = CoulombLoop(pushed(dataclasses.replace(BLOCK, damping=REAL.damping)))
    slip = 0.5 * STRENGTH / FREQUENCY**2
    strength = BLOCK.friction.residual * BLOCK.effective_normal_stress
    found = loop.shear_stress(0.0, ca.DM([slip, 0.0, 7.0]), 0.0, BLOCK.friction.residual)
    assert float(found) / strength == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize("symbolic", [False, True])
def test_friction_that_differs_from_the_nominal_opposes_motion_all_the_same(symbolic):
    """With 1.2 of the input gain: 2.4 strengths between the senses; a push of -0.6 strengths leaves half the stress."""
    numbers = (1.3, 0.7, 1.2)
    given = ca.SX.sym("factors", 3)
    loop = CoulombLoop(pushed(BLOCK, constant=-0.6 * STRENGTH))
    varied = loop.with_factors(tuple(ca.vertsplit(given)) if symbolic else numbers)
    backward, forward = (varied.directed(0.0, ca.SX([0.01, 0.0]), 0.0, sense)[1] for sense in (-1, 1))
    stress = varied.shear_stress(0.0, ca.SX([0.0, 0.0]), 0.0, BLOCK.friction.residual)
    found = ca.Function("found", [given], [backward - forward, stress])(list(numbers))
    assert float(found[0]) == pytest.approx(2.4 * STRENGTH, rel=1e-12)
    assert float(found[1]) == pytest.approx(0.5 * BLOCK.friction.residual * BLOCK.effective_normal_stress, rel=1e-12)


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("length", [0.25, 1.0, 4.0])
def test_where_the_cubic_misses_the_stop_a_linear_step_comes_closer(length, sense):
    """x2 = 0.6 - s - 2 s⁴ at share s, which RK4 carries exactly; the root of the cubic is off by some 0.06."""

    def directed(time, x, _, now):
        return ca.fabs(now) * ca.vertcat(x[1], -sense * (1 + 8 * (time / length) ** 3) / length)

    def motion(plant, passed, now):
        return plant(passed * length, now[:2], 0)

    course, rate = (
        _StepMotion(directed, ClassicRungeKutta, motion, length),
        np.polynomial.Polynomial([0.6, -1, 0, 0, -2]),
    )
    root = next(z.real for z in rate.roots() if abs(z.imag) < 1e-9 and 0 < z.real < 1)
    start = ca.DM([0, sense * 0.6])
    ahead = course.move(sense, 0.0, 1.0, start)
    assert float(ahead[1]) == pytest.approx(sense * rate(1), rel=1e-12)
    share, turning = course.stop(sense, start, ahead, -1)
    assert float(share) == pytest.approx(root, abs=0.01)
    assert float(turning[1]) == 0
    known, turning = course.stop(sense, start, ahead, 0.47)
    rest = -rate(0.47) / rate.deriv()(0.47)
    assert float(known) == pytest.approx(0.47 + rest, rel=1e-12)
    reached = course.move(sense, 0.0, 0.47, start)
    assert float(turning[0] - reached[0]) == pytest.approx(sense * length * rest * rate(0.47), rel=1e-10)
    for onset in (0.0, 1.0):
        assert 0 <= float(course.stop(sense, start, ahead, onset)[0]) <= 1


def test_damping_does_not_keep_a_fault_at_rest():
    loop = CoulombLoop(REAL)
    vars(loop)["directed"] = lambda _, x, __, sense: ca.fabs(sense) * ca.vertcat(x[1], 3 - 5 * x[1] - sense)
    moved = loop.advance(ClassicRungeKutta, lambda plant, passed, now: plant(passed, now, 0), ca.DM([0, 0]), 0.1).full()
    assert moved[1, 0] == pytest.approx(0.4 * (1 - math.exp(-0.5)), rel=1e-2)


@pytest.mark.parametrize("length", [0.25, 4.0])
@pytest.mark.parametrize(("onset", "share"), [(0.9, 1.0), (0.25, 1.0)])
def test_a_stop_is_never_later_than_the_step(length, onset, share):
    """x2 = 2 - s at share s, with a linear step that would lead to a stop at 2."""

    def motion(plant, passed, now):
        return plant(passed * length, now[:2], 0)

    course = _StepMotion(lambda _, x, __, sense: ca.vertcat(x[1], -sense / length), ClassicRungeKutta, motion, length)
    start = ca.DM([0, 2])
    found, turning = course.stop(1, start, course.move(1, 0.0, 1.0, start), onset)
    assert float(found) == pytest.approx(share, rel=1e-14)
    slip = 2 * onset - onset**2 / 2 + (share - onset) * (2 - onset)
    assert float(turning[0]) == pytest.approx(length * slip, rel=1e-12)
