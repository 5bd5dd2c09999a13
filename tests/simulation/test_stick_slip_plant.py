"""The stick–slip plant against closed forms, against another integrator with its own events, and against itself."""

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
from quakedesign.simulation.integrators import ClassicRungeKutta, DormandPrince
from quakedesign.simulation.stick_slip_plant import StickSlipLoop, _crossing, _Quartic, _SplitStep

REAL = load_fault("real-fault")
BLOCK = dataclasses.replace(REAL, damping=0.0, friction=dataclasses.replace(REAL.friction, drop=0.0))
STRENGTH = BLOCK.friction.residual * BLOCK.authority * BLOCK.effective_normal_stress  # of constant friction [m/s²]
FREQUENCY = BLOCK.natural_frequency


def pushed(fault, **load):
    return fault.with_disturbance(Disturbance(**load))


def overshoot(parts, push, halves=3):
    """Slip after a push [unit: μσ'N̂/k̂], by the half period, and the run."""
    half = math.pi / FREQUENCY
    run = simulate(
        pushed(BLOCK, constant=push * STRENGTH),
        step=half / parts,
        duration=halves * half * (1 + 1e-9),
        samples=halves * parts,
    )
    return run.slip[::parts] * FREQUENCY**2 / STRENGTH, run


@pytest.mark.parametrize("push", [0.4, 1.9, 2.1, 3.7])
def test_a_pushed_block_overshoots_to_twice_the_push_and_rests_there(push):
    """From a critically loaded start: x1 = push (1 − cos ωt) until the slip rate vanishes after half a period.

    The spring then pulls back by twice the push, of which friction carries two strengths.
    """
    found, run = overshoot(200, push)
    half = math.pi / FREQUENCY
    assert found == pytest.approx([0, 2 * push, 2 * push, 2 * push], rel=1e-9)
    assert np.all(run.slip_rate[run.time > 1.001 * half] == 0)
    assert len(set(run.slip[run.time > 1.001 * half])) == 1
    assert run.events["stick"] == pytest.approx(half, abs=1.5 * half / 200)
    assert "reverse_slip" not in run.events
    assert ("load_reversed" in run.events) == (push > 2)


def test_the_stop_converges_with_the_order_of_the_integrator():
    errors = []
    for parts in (10, 20, 40):
        step = math.pi / FREQUENCY / (parts + 0.37)
        run = simulate(pushed(BLOCK, constant=1.7 * STRENGTH), step=step, duration=1.5 * math.pi / FREQUENCY)
        errors.append(abs(run.slip[-1] * FREQUENCY**2 / STRENGTH - 3.4))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 4.5)
    assert errors[-1] < 1e-6


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
    run = simulate(pushed(REAL, **load), duration=2000.0, samples=10**6)
    assert not np.any(run.slip)
    assert not np.any(run.slip_rate)
    assert run.metrics.time_at_rest_fraction == 1
    assert set(run.events) == {"stick"}


def test_a_load_beyond_the_band_backward_is_named_and_does_not_move_it():
    swing = pushed(BLOCK, constant=-1.3 * STRENGTH, amplitude=1.2 * STRENGTH, frequency=0.1)
    run = simulate(swing, duration=50.0, step=0.01, samples=10**6)
    reversed_at = (math.pi + math.asin(0.7 / 1.2)) / 0.1  # −1.3 + 1.2 sin 0.1 t = −2
    assert run.events["load_reversed"] == pytest.approx(reversed_at, abs=0.011)
    assert not np.any(run.slip)
    assert not np.any(run.slip_rate)


def test_as_long_as_slip_is_forward_the_digits_are_those_of_the_smooth_plant():
    smooth, set_valued = (natural_earthquake(REAL, pressure=1e6, plant=name) for name in ("printed", "stick-slip"))
    stop = np.argmax(smooth.slip_rate < 0) if np.any(smooth.slip_rate < 0) else len(smooth.time)
    assert stop > 500
    assert np.array_equal(smooth.slip[:stop], set_valued.slip[:stop])
    assert np.array_equal(smooth.slip_rate[:stop], set_valued.slip_rate[:stop])
    assert smooth.metrics.peak_slip_rate == set_valued.metrics.peak_slip_rate


def test_an_earthquake_ends_where_the_slip_rate_falls_to_zero():
    """Underdamped, the smooth plant swings back; friction holds the real one there."""
    light = dataclasses.replace(REAL, damping=REAL.damping / 20)
    smooth, held = (natural_earthquake(light, plant=name) for name in ("printed", "stick-slip"))
    assert "reverse_slip" in smooth.events
    assert set(held.events) == {"stick"}
    assert held.slip[-1] == pytest.approx(np.max(smooth.slip), rel=1e-4)
    assert held.slip_rate[-1] == 0


class Oracle:
    """The inclusion by scipy: DOP853 in both modes, switched at located events; equations typed in again."""

    def __init__(self, fault, gains):
        self.fault, self.gains = fault, gains

    def pressure(self, y):
        return -float(np.dot(self.gains, y))

    def acceleration(self, t, y):
        fault, load, law = self.fault, self.fault.disturbance, self.fault.friction
        coefficient = law.residual + law.drop * math.exp(-max(y[0], 0.0) / law.critical_slip)
        start = (law.residual + law.drop) * fault.effective_normal_stress
        shaking = load.constant + load.amplitude * math.sin(load.frequency * t) + load.slip_growth * y[0]
        friction = coefficient * (fault.effective_normal_stress - self.pressure(y))
        spring = fault.specific_stiffness * y[0] + fault.specific_damping * y[1]
        return shaking + fault.authority * (start - friction) - spring

    def reference(self, t):
        stage = t / self.fault.reference.operation_time
        return self.fault.reference.target_slip * stage**3 * (10 - 15 * stage + 6 * stage**2)

    def run(self, y, times):
        """States at times, shape (4, n), and the number of stops."""
        t, end, found, stops = 0.0, times[-1], np.empty((4, len(times))), 0
        slides = self.acceleration(t, y) > 0
        while t < end:
            solution = solve_ivp(
                lambda now, z, s=slides: self.field(now, z, s),
                (t, end),
                y,
                method="DOP853",
                events=self.end(slides),
                dense_output=True,
                rtol=1e-12,
                atol=1e-18,
                max_step=0.05,
            )
            covered = (times >= t) & (times <= solution.t[-1])
            if np.any(covered):
                found[:, covered] = solution.sol(times[covered])
            t, y = solution.t[-1], solution.y[:, -1].copy()
            stops += slides
            y[1] = 0.0
            slides = not slides
        return found, stops

    def field(self, t, y, slides):
        rates = [y[1], self.acceleration(t, y)] if slides else [0.0, 0.0]
        return [*rates, y[0] - self.reference(t), y[2]]

    def end(self, slides):
        def stop(t, y):
            return y[1]

        def release(t, y):
            return self.acceleration(t, y)

        event = stop if slides else release
        event.terminal, event.direction = True, -1 if slides else 1
        return event


@pytest.mark.slow
def test_a_shaken_block_agrees_with_scipys_events():
    """A load that grows with the slip releases the block again and again: about ten stops."""
    growth = 0.98 * BLOCK.specific_stiffness
    fault = pushed(BLOCK, constant=-0.3 * STRENGTH, amplitude=0.8 * STRENGTH, frequency=0.31, slip_growth=growth)
    run = simulate(fault, step=0.02, duration=200.01, samples=400)
    expected, stops = Oracle(fault, [0.0] * 4).run([0.0] * 4, run.time)
    assert stops > 8
    assert set(run.events) == {"stick"}
    assert np.max(np.abs(run.slip - expected[0])) < 1e-10 * np.ptp(expected[0])


@pytest.mark.slow
def test_the_published_linear_law_rests_most_of_the_time_and_agrees_with_scipy():
    """ERRATA 14: e-LQR with the paper's shaking, where the printed plant runs backward."""
    controller = published("real-fault")["elqr"]
    run = simulate(REAL, controller, step=0.0046, duration=200.0, samples=400)
    expected, _ = Oracle(REAL, [float(gain) for gain in controller.gains.values()]).run([0.0] * 4, run.time)
    assert set(run.events) == {"stick"}
    assert run.metrics.time_at_rest_fraction > 0.9
    assert np.max(np.abs(run.slip - expected[0])) < 1e-9 * np.max(expected[0])


@pytest.mark.slow
@pytest.mark.parametrize("law", ["cta", "dia", "elqr"])
def test_published_controllers_follow_the_reference_without_reverse_slip(law):
    """In the paper's runs δ' < 0 nearly half of the time; on the stick–slip plant the fault rests instead."""
    controller = published("real-fault")[law]
    smooth, held = (simulate(REAL, controller, duration=20000.0, plant=name) for name in ("printed", "stick-slip"))
    assert smooth.metrics.reverse_slip_fraction > 0.3
    assert held.metrics.reverse_slip_fraction == 0
    assert held.metrics.time_at_rest_fraction > 0.5
    assert set(held.events) == {"stick"}
    assert held.metrics.max_slip_error < 1.05 * smooth.metrics.max_slip_error
    assert held.metrics.pressure_total_variation < smooth.metrics.pressure_total_variation


def test_the_monitor_agrees_with_numpy():
    run = simulate(
        pushed(BLOCK, amplitude=0.9 * STRENGTH, frequency=0.3, slip_growth=0.98 * BLOCK.specific_stiffness),
        duration=100.0,
        step=0.05,
        samples=10**6,
        settled_from=10.0,
    )
    kept = run.time > 10.0
    assert run.metrics.time_at_rest_fraction == np.mean(run.slip_rate[kept] == 0)
    assert 0.05 < run.metrics.time_at_rest_fraction < 0.95
    assert not np.any(run.slip_rate < 0)
    assert run.events["stick"] == run.time[1:][np.argmax(run.slip_rate[1:] == 0)]
    assert Metrics.unit("time_at_rest_fraction") == ""
    assert simulate(REAL, duration=10.0, plant="printed").metrics.time_at_rest_fraction is None


@few("law", ["cta", "elqr"], every=2)
def test_both_backends_give_the_same_digits(law, monkeypatch):
    monkeypatch.setattr("quakedesign.simulation.compiled._WORTH", 0)
    setting = {"duration": 1001 * REAL.sampling_time, "samples": 40}
    fast, slow = (simulate(REAL, published("real-fault")[law], compiled=c, **setting) for c in (None, False))
    if fast.provenance["backend"] != "compiled":
        pytest.skip(fast.provenance["backend_reason"])
    for name, (values, _, _) in fast.signals().items():
        assert np.array_equal(values, slow.signals()[name][0]), name
    assert fast.provenance["plant"] == "stick-slip"


def test_an_opened_fault_has_no_friction():
    opened = REAL.effective_normal_stress * 1.01
    free = REAL.friction.bounds[1] * REAL.authority * REAL.effective_normal_stress
    free -= REAL.specific_stiffness * 0.1 + REAL.specific_damping * 0.2
    free += REAL.disturbance.slip_growth * 0.1
    assert float(StickSlipLoop(REAL).plant(0, ca.DM([0.1, 0.2]), opened)[1]) == pytest.approx(free, rel=1e-12)


def test_an_unknown_plant_is_refused():
    with pytest.raises(ParameterError, match=r"stick-slip, printed.*'sticky'"):
        simulate(REAL, plant="sticky")


@pytest.mark.parametrize(("earlier", "now"), [("coulomb", "stick-slip"), ("smooth", "printed")])
def test_the_names_of_an_earlier_version_are_understood(earlier, now):
    assert simulate(REAL, duration=1.0, plant=earlier).provenance["plant"] == now


class Unit(StickSlipLoop):
    """A friction of one: x2' = load(t) − 1 while it slips."""

    load_of_time = staticmethod(lambda t: 0 * t)

    @property
    def plant(self):
        return lambda time, x, _: ca.vertcat(x[1], self.load_of_time(time) - 1)


def one_step(load, rate, length, *, method=ClassicRungeKutta, law_states=1):
    """Slip, rate, states of a law that grow by 1 a second, and a work that grows by 2, after a step."""
    loop = Unit(REAL, published("real-fault")["cta"])
    object.__setattr__(loop, "load_of_time", load)

    def motion(plant, passed, now):
        return ca.vertcat(plant(passed * length, now[:2], 0), ca.DM.ones(law_states), 2)

    start = ca.DM([0, rate, *[0] * law_states, 0])
    return ca.evalf(loop.advance(method, motion, start, length, works=1)).full().ravel()


@pytest.mark.parametrize("law_states", [0, 1])
@pytest.mark.parametrize(
    ("load", "rate", "length", "slip", "end"),
    [
        (lambda _: 0, 2.0, 1.0, 1.5, 1.0),  # brakes by 1
        (lambda _: 0, 1.5, 1.0, 1.0, 0.5),
        (lambda _: 0, 0.5, 1.0, 0.125, 0.0),  # to rest after half of the step
        (lambda _: -1, 1.0, 1.0, 0.25, 0.0),  # at rest under a load that is just carried
        (lambda _: -3, 2.0, 1.0, 0.5, 0.0),  # brakes by 4, and rests though the load would pull it backward
        (lambda _: 3, 0.0, 1.0, 1.0, 2.0),
        (lambda _: 1, 0.0, 1.0, 0.0, 0.0),
        (lambda t: 4 * t, 0.0, 1.0, 4 / 6 * 0.75**3, 2 * 0.75**2),  # sets off after a quarter
        (lambda t: 1.6 * t, 0.0, 1.0, 1.6 / 6 * 0.375**3, 0.8 * 0.375**2),  # later than half
        (lambda t: 1 + t, 0.0, 1.0, 1 / 6, 1 / 2),
        (lambda t: t, 0.0, 1.0, 0.0, 0.0),  # carried up to the end
        (lambda t: 3 * t, 0.5, 0.25, 0.5 * 0.25 - 0.25**2 / 2 + 0.25**3 / 2, 0.5 - 0.25 + 1.5 * 0.25**2),
    ],
)
def test_under_a_friction_of_one_a_step_is_made_of_parabolas(load, rate, length, slip, end, law_states):
    found = one_step(load, rate, length, law_states=law_states)
    assert found[:2] == pytest.approx([slip, end], rel=1e-13, abs=1e-15)
    assert (found[1] == 0) == (end == 0)
    assert found[2:] == pytest.approx([*[length] * law_states, 2 * length], rel=1e-13)


def test_a_pressure_on_its_way_goes_on_as_if_the_fault_had_not_stopped():
    """It decays as exp(−t/2); the fault stops after 0.3 of the step."""
    loop = Unit(REAL, published("real-fault")["cta"])

    def motion(plant, passed, now):
        return ca.vertcat(plant(0.5 * passed, now[:2], 0), -now[2] / 2)

    found = ca.evalf(loop.advance(DormandPrince, motion, ca.DM([0, 0.15, 1]), 0.5)).full().ravel()
    assert found[1] == 0
    assert found[2] == pytest.approx(math.exp(-0.25), rel=1e-7)


def test_a_pressure_that_rises_at_rest_releases_the_fault():
    """A pressure of 1.6 t is carried up to 1; the rate is then 0.8 τ², τ = t − 0.625."""

    class Eased(StickSlipLoop):
        plant = property(lambda self: lambda _, x, pressure: ca.vertcat(x[1], pressure - 1))

    def motion(plant, passed, now):
        return ca.vertcat(plant(passed, now[:2], now[2]), 1.6)

    loop = Eased(REAL, published("real-fault")["cta"])
    found = ca.evalf(loop.advance(ClassicRungeKutta, motion, ca.DM([0, 0, 0]), 1.0)).full().ravel()
    assert found == pytest.approx([1.6 / 6 * 0.375**3, 0.8 * 0.375**2, 1.6], rel=1e-12)


@pytest.mark.parametrize("law_states", [0, 1])
def test_a_stop_after_a_release_is_counted_from_the_start_of_the_step(law_states):
    """Sliding from a quarter of the step on at 0.5, braked by 1: half a step later it rests, 0.125 further."""
    braked = lambda _, x, __: ca.vertcat(x[1], -1)  # noqa: E731
    step = _SplitStep(braked, braked, DormandPrince, _motion, 1.0, 1)
    start = ca.DM([0, 0.5, *[0.25] * law_states, 0.5])
    stop, stopped = step.stop(0.25, start, step.slid(0.25, 0.75, start))
    assert float(ca.evalf(stop)) == pytest.approx(0.75, rel=1e-12)
    found = ca.evalf(stopped).full().ravel()
    assert found == pytest.approx([0.125, 0, *[0.75] * law_states, 1.5], rel=1e-12, abs=1e-15)


def _motion(plant, passed, now):
    """States of the law that grow by 1 a second, and a work that grows by 2."""
    return ca.vertcat(plant(passed, now[:2], 0), ca.DM.ones(now.shape[0] - 3), 2)


@pytest.mark.parametrize("law_states", [0, 1])
def test_it_stops_at_the_root_of_a_slip_rate_that_is_a_quartic_in_time(law_states):
    """x2 = 0.6 − t − 2 t⁴, which Dormand and Prince's method carries exactly."""
    rate = np.polynomial.Polynomial([0.6, -1, 0, 0, -2])
    root = next(z.real for z in rate.roots() if abs(z.imag) < 1e-9 and 0 < z.real < 1)
    found = one_step(lambda t: -8 * t**3, 0.6, 1.0, method=DormandPrince, law_states=law_states)
    assert found[:2] == pytest.approx([rate.integ()(root), 0.0], rel=1e-12, abs=0)


@pytest.mark.parametrize("root", [1e-6, 0.1, 0.5, 1 / 3, 0.9, 1 - 1e-6])
@pytest.mark.parametrize("further", [(-3.0, 2.0, -1.0), (1.5, 4.0, 2.5), (1.5, -0.5, -2.0)])
def test_the_quartic_stops_at_its_root_and_has_the_values_that_make_it(root, further):
    """(s − root)(s − a)(s − b)(s − c) up to its sign, with a, b and c outside of the step."""
    made = np.polynomial.Polynomial.fromroots([root, *further])
    made = made if made(0) > 0 else -made
    ends = made(0), made(1), made.deriv()(0), made.deriv()(1), made.integ()(1)
    quartic = _Quartic.of(*(ca.DM(v) for v in ends))
    assert [float(quartic.at(s)) for s in (0.2, 0.7)] == pytest.approx([made(0.2), made(0.7)], rel=1e-10)
    assert float(quartic.integral(0.4)) == pytest.approx(made.integ()(0.4), rel=1e-10)
    assert float(quartic.slope(0.4)) == pytest.approx(made.deriv()(0.4), rel=1e-10)
    found = float(quartic.root())
    assert found == pytest.approx(root, abs=1e-8)
    assert made.integ()(found) == pytest.approx(made.integ()(root), rel=1e-13, abs=1e-15)  # stationary at the root


def test_a_flat_root_is_found_where_it_is():
    """−(s − 17/32)³, whose slope vanishes at the first point that Newton's method takes."""
    flat = -np.polynomial.Polynomial.fromroots([17 / 32] * 3)
    ends = flat(0), flat(1), flat.deriv()(0), flat.deriv()(1), flat.integ()(1)
    assert float(_Quartic.of(*(ca.DM(v) for v in ends)).root()) == pytest.approx(17 / 32, abs=1e-5)


def test_a_standstill_at_the_start_stops_at_once_and_a_straight_fall_where_the_line_does():
    assert float(_Quartic.of(*(ca.DM(v) for v in (0.0, -1.0, -1.0, -1.0, -0.5))).root()) == pytest.approx(0, abs=1e-16)
    assert float(_Quartic.of(*(ca.DM(v) for v in (3.0, -1.0, -4.0, -4.0, 1.0))).root()) == 0.75


@pytest.mark.parametrize(
    ("before", "after", "share"),
    [
        (-1.0, 3.0, 0.25),
        (-1.0, 0.5, 1 / 1.5),
        (-1.0, 0.0, 1.0),
        (0.0, 2.0, 0.0),
        (0.0, 0.0, 1.0),
        (-1.0, -2.0, 1.0),
    ],
)
def test_a_push_that_ends_positive_has_left_zero_on_its_secant(before, after, share):
    assert float(_crossing(ca.DM(before), ca.DM(after))) == share


@pytest.mark.parametrize(
    ("push", "rate", "stress"),
    [
        (-0.5, 0.0, 0.5),
        (-1.0, 0.0, 0.0),
        (-1.75, 0.0, -0.75),
        (-2.5, 0.0, -1.5),
        (0.5, 0.0, 1.0),
        (-0.5, 1e-9, 1.0),
    ],
)
def test_at_rest_the_shear_stress_is_what_carries_the_load(push, rate, stress):
    """In units of the strength; the fault begins on the verge of slip, so that a push adds to one."""
    loop = StickSlipLoop(pushed(BLOCK, constant=push * STRENGTH))
    strength = BLOCK.friction.residual * BLOCK.effective_normal_stress
    found = loop.shear_stress(0.0, ca.DM([0.0, rate]), 0.0, BLOCK.friction.residual)
    assert float(found) / strength == pytest.approx(stress, rel=1e-12, abs=1e-12)
    eased = loop.shear_stress(0.0, ca.DM([0.0, 1.0]), 0.25 * BLOCK.effective_normal_stress, BLOCK.friction.residual)
    assert float(eased) / strength == pytest.approx(0.75, rel=1e-12)
    opened = loop.shear_stress(0.0, ca.DM([0.0, 1.0]), 2 * BLOCK.effective_normal_stress, BLOCK.friction.residual)
    assert float(opened) == 0


def test_at_rest_the_stress_is_that_of_the_slip_so_far_and_of_no_other_state():
    """A damping that is not zero, no slip rate, and the spring pulls back by k̂ x/N̂ of the strength on the verge."""
    loop = StickSlipLoop(pushed(dataclasses.replace(BLOCK, damping=REAL.damping)))
    slip = 0.5 * STRENGTH / FREQUENCY**2
    strength = BLOCK.friction.residual * BLOCK.effective_normal_stress
    found = loop.shear_stress(0.0, ca.DM([slip, 0.0, 7.0]), 0.0, BLOCK.friction.residual)
    assert float(found) / strength == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize("symbolic", [False, True])
def test_friction_that_differs_from_the_nominal_holds_the_fault_all_the_same(symbolic):
    """With 1.2 of the input gain: 2.4 strengths between both ends; a push of −0.6 strengths leaves half the stress."""
    numbers = (1.3, 0.7, 1.2)
    given = ca.SX.sym("factors", 3)
    loop = StickSlipLoop(pushed(BLOCK, constant=-0.6 * STRENGTH))
    varied = loop.with_factors(tuple(ca.vertsplit(given)) if symbolic else numbers)
    forward, backward = varied.resting_load(0.0, ca.SX(0.01), 0.0)
    stress = varied.shear_stress(0.0, ca.SX([0.0, 0.0]), 0.0, BLOCK.friction.residual)
    found = ca.Function("found", [given], [backward - forward, stress])(list(numbers))
    assert float(found[0]) == pytest.approx(2.4 * STRENGTH, rel=1e-12)
    assert float(found[1]) == pytest.approx(0.5 * BLOCK.friction.residual * BLOCK.effective_normal_stress, rel=1e-12)


def test_damping_does_not_keep_a_fault_at_rest():
    """x2' = 2 − 5 x2 from rest."""

    class Damped(StickSlipLoop):
        plant = property(lambda self: lambda _, x, __: ca.vertcat(x[1], 2 - 5 * x[1]))

    moved = Damped(REAL).advance(
        ClassicRungeKutta, lambda plant, passed, now: plant(passed, now, 0), ca.DM([0, 0]), 0.1
    )
    assert float(moved[1]) == pytest.approx(0.4 * (1 - math.exp(-0.5)), rel=1e-3)
