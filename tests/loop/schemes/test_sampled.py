"""What the sampled schemes share: a sensor for the period of the loop, and single steps by hand."""

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.laws import control_law, published
from quakedesign.loop import Actuator, Delay, Diffusion, Lag, RateLimit, Saturation, discrete_law, simulation_scheme
from quakedesign.loop.schemes.base import AperiodicClock, Sampled
from quakedesign.loop.schemes.explicit import Explicit
from quakedesign.loop.sensing import Differentiator, OutputFeedback
from quakedesign.simulation import simulate
from quakedesign.simulation.closed_loop import ClosedLoop
from quakedesign.simulation.integrators import ClassicRungeKutta

LAB = load_fault("lab-fault")
LAW = published("lab-fault")["cta"]
IDLE = dict.fromkeys(published("lab-fault")["elqr"].gain_units, 0.0)
SLIP, RATE, SLIP_INTEGRAL, *_ = IDLE
SENSOR = OutputFeedback(differentiator=Differentiator(bound=100.0, step=1e-4))


def test_a_sensor_of_another_period_does_not_pass_silently():
    with pytest.raises(ParameterError, match=r"that of the sensor, 0\.0001 s\. Received 0\.001 s"):
        simulate(LAB, LAW, step=1e-3, scheme="explicit", measurement=SENSOR, duration=0.1)


def test_a_sensor_can_be_told_to_simulate_or_to_the_scheme():
    runs = [
        simulate(LAB, LAW, step=1e-4, duration=0.01, compiled=False, **told)
        for told in (
            {"scheme": "implicit", "measurement": SENSOR},
            {"scheme": simulation_scheme("implicit", measurement=SENSOR)},
        )
    ]
    assert (runs[0].slip == runs[1].slip).all()
    assert runs[0].metrics.peak_slip_rate > 0


@pytest.mark.parametrize("substeps", [0, -1, 101, True, 1.5])
def test_substeps_are_a_whole_number_from_one_to_a_hundred(substeps):
    assert [Explicit(substeps=able).substeps for able in (1, 100)] == [1, 100]
    assert Explicit().substeps == 1
    with pytest.raises(ParameterError, match="substeps"):
        Explicit(substeps=substeps)


@pytest.mark.parametrize("authority", [0.0, -1.0, float("inf"), float("nan")])
def test_an_authority_is_positive_and_finite(authority):
    assert [Explicit(authority=able).authority for able in (5e-324, 0.5, 1e308, None)] == [5e-324, 0.5, 1e308, None]
    with pytest.raises(ParameterError, match="authority must be positive and finite"):
        Explicit(authority=authority)


def stepped(scheme, law, state, step, *, counter=0, plant=None, method=ClassicRungeKutta):
    """Pressure at the start of a step [Pa], and slip, rate and states of the law at its end."""
    loop = ClosedLoop(LAB, law)
    if plant is not None:
        vars(loop)["printed"] = plant
    memory = scheme.memory(loop, step)
    given = ca.SX.sym("given", 2 + len(loop.integrals) + len(memory))
    asked = scheme.pressure(loop, counter, given, step)
    end = scheme.advance(loop, method, counter, given, step)
    found = ca.Function("step", [given], [asked, end])([*state, *[0] * len(loop.integrals), *memory.values()])
    return float(found[0]), found[1].full().ravel()[: 2 + len(loop.integrals)]


def linear(**gains):
    return control_law("elqr")(gains=IDLE | gains)


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize(("clock", "steps"), [(None, 1), (AperiodicClock(shortest=8, longest=16), 8)])
def test_a_pump_changes_as_far_as_it_can_until_the_next_sample_is_expected(clock, steps, sense):
    """A law that asks for 10 MPa behind a pump of 20 Pa/s: 20 Pa/s times 0.25 s, as often as steps are sure to pass."""
    scheme = Explicit(clock=clock, actuator=Actuator(stages=(RateLimit(rate=20.0),)))
    reached, _ = stepped(scheme, linear(**{SLIP: 1e7}), (-sense, 0.0), 0.25)
    assert reached == pytest.approx(sense * 20 * 0.25 * steps, rel=1e-14)


def test_a_law_is_told_the_reference_of_now_and_of_the_next_sample_expected():
    """A reference of t, t² and t³ at 1.5 s, and the next sample four steps of 0.5 s later."""
    loop = SimpleNamespace(reference=lambda t: (t, t**2, t**3))
    told = Sampled._inputs(loop, 3, 0.5, (10.0, 20.0), 4)
    assert {symbol: float(value) for symbol, value in told.items()} == {
        discrete_law.slip: 10.0,
        discrete_law.rate: 20.0,
        discrete_law.slip_error: 8.5,
        discrete_law.rate_error: 17.75,
        discrete_law.acceleration: 3.375,
        discrete_law.next_reference: 3.5,
        discrete_law.next_reference_rate: 12.25,
        discrete_law.step: 2.0,
    }


@pytest.mark.parametrize("substeps", [1, 3, 10])
@pytest.mark.parametrize("part", [0.0, 0.25])
def test_what_is_held_acts_from_its_part_of_the_step_on_and_time_goes_on_within_it(substeps, part):
    """Rates of p and t: in 0.5 s from 2 s on slip grows by p times what is left of it, the rate by (2.5² - 2²)/2."""
    late = Actuator(stages=(Delay(samples=0, part=part),))
    scheme = Explicit(substeps=substeps, actuator=late)
    law, at = linear(**{SLIP: 8.0}), (-1.0, 0.0)
    asked, _ = stepped(Explicit(), law, at, 0.5, counter=4)
    assert abs(asked) == pytest.approx(8, rel=1e-2)
    acting, end = stepped(scheme, law, at, 0.5, counter=4, plant=lambda t, _, p: ca.vertcat(p, t))
    assert acting == (0 if part else asked)
    assert end[0] + 1 == pytest.approx(asked * 0.5 * (1 - part), rel=1e-13)
    assert end[1] == pytest.approx((2.5**2 - 2**2) / 2, rel=1e-13)


class Euler:
    """One explicit step of first order, whose error tells how many there are."""

    @staticmethod
    def advance(field, state, step):
        return state + step * field(0.0, state)


@pytest.mark.parametrize(
    ("substeps", "part", "lengths"),
    [(1, 0.0, [1.0]), (4, 0.0, [0.25] * 4), (3, 0.25, [0.25] * 4), (4, 0.125, [0.125] + [0.21875] * 4)],
)
def test_every_section_of_a_step_takes_its_share_of_the_substeps_rounded_up(substeps, part, lengths):
    scheme = Explicit(substeps=substeps, actuator=Actuator(stages=(Delay(samples=0, part=part),)))
    found = stepped(scheme, linear(), (0.0, 0.0), 1.0, plant=lambda t, *_: ca.vertcat(t, 1), method=Euler)[1]
    begins = [sum(lengths[:i]) for i in range(len(lengths))]
    assert found[0] == pytest.approx(sum(t * h for t, h in zip(begins, lengths, strict=True)), rel=1e-13)
    assert found[1] == pytest.approx(1, rel=1e-13)


def test_a_stage_too_fast_for_its_substeps_and_a_sensor_of_another_period_are_refused():
    """Steps of at most 2.5 time constants."""
    lag, loop = Actuator(stages=(Lag(time_constant=0.1),)), ClosedLoop(LAB, linear())
    assert Explicit(substeps=4, actuator=lag).memory(loop, 0.999)
    with pytest.raises(ParameterError, match="substep"):
        Explicit(substeps=4, actuator=lag).memory(loop, 1.001)
    with pytest.raises(ParameterError, match="that of the sensor"):
        Explicit(measurement=SENSOR).memory(loop, 1e-3)


def test_the_input_gain_that_a_scheme_takes_for_granted_is_the_smallest():
    loop = ClosedLoop(LAB.with_box("ten-percent"), linear())
    least = LAB.friction.bounds[0] * LAB.authority * 0.9
    assert Explicit().nominal(loop) == pytest.approx(least, rel=1e-12)


@pytest.mark.parametrize(("slip", "winds"), [(-1.0, False), (1.0, False), (-1e-3, True), (1e-3, True)])
def test_what_a_law_sums_up_stays_where_a_limit_keeps_the_pressure_from_following(slip, winds):
    """Gains of 1 Pa/m and 1 Pa/(m s), a limit of 0.5 Pa: an error of 1 m is not added, one of 1 mm is."""
    scheme = Explicit(actuator=Actuator(stages=(Saturation(lowest=-0.5, highest=0.5),)))
    law = linear(**{SLIP: 1.0, SLIP_INTEGRAL: 1.0})
    pressure, end = stepped(scheme, law, (slip, 0.0), 0.25)
    assert abs(pressure) == pytest.approx(min(0.5, abs(slip)), rel=1e-12)
    assert end[2] == pytest.approx(0.25 * slip if winds else 0.0, rel=1e-9)


def test_a_sum_that_moves_no_pressure_goes_on_while_a_limit_holds():
    scheme = Explicit(actuator=Actuator(stages=(Saturation(lowest=-0.5, highest=0.5),)))
    for slip in (-1.0, 1.0):
        assert stepped(scheme, linear(**{SLIP: 1.0}), (slip, 0.0), 0.25)[1][2] == pytest.approx(0.25 * slip, rel=1e-9)


@pytest.mark.parametrize("law", ["elqr", None])
def test_between_samples_by_no_clock_nothing_of_the_law_moves(law):
    """A sample at every second step, while slip grows: pressure and sum change there alone."""
    loop = ClosedLoop(LAB, linear(**{SLIP: 8.0, SLIP_INTEGRAL: 1.0}) if law else None, 5.0)
    vars(loop)["printed"] = lambda *_: ca.DM([1, 0])
    scheme = Explicit(clock=AperiodicClock(shortest=2, longest=2))
    memory, count = scheme.memory(loop, 0.25), len(loop.integrals)
    given, number = ca.SX.sym("given", 2 + count + len(memory)), ca.SX.sym("number")
    parts = [scheme.pressure(loop, number, given, 0.25), scheme.advance(loop, ClassicRungeKutta, number, given, 0.25)]
    step, state, pressures, sums = ca.Function("step", [number, given], parts), [1.0, 0.0], [], []
    state += [0.0] * count + list(memory.values())
    for k in range(6):
        pressure, after = step(k, state)
        pressures.append(float(pressure))
        state = after.full().ravel().tolist()
        sums.append(state[2])
    if law:
        assert [abs(p) for p in pressures[::2]] == pytest.approx([8.0, 12.0 + 0.5, 16.0 + 0.5 + 0.75], rel=1e-3)
        assert sums[::2] == pytest.approx([0.5, 0.5 + 0.75, 0.5 + 0.75 + 1.0], rel=1e-3)
        assert sums[1::2] == sums[::2]
    assert pressures[1::2] == pressures[::2] if law else pressures == [5.0] * 6


def test_two_sections_of_as_many_substeps_are_two_repetitions_in_a_run():
    """They differ in pressure and time alone, and machine code knows a repetition by what it is given."""
    halves = Actuator(stages=(Delay(samples=0, part=0.5),))
    setting = {"substeps": 4, "scheme": "explicit", "actuator": halves, "duration": 0.01}
    run = simulate(LAB, published("lab-fault")["elqr"], **setting)
    assert run.metrics.peak_slip_rate > 0
    assert "diverged" not in run.events


def test_outputs_and_settings_are_those_of_what_lies_around_the_law():
    assert Explicit().described == {}
    assert Explicit().settings == {"substeps": 1}
    lagged = Explicit(actuator=Actuator(stages=(Lag(time_constant=1.0),)), authority=2.0)
    assert lagged.described == {"well_pressure": ("pressure at the well", "Pa")}
    assert lagged.settings == {"substeps": 1, "actuator": "Lag(time_constant=1.0)", "authority": 2.0}
    rock = Actuator(stages=(Diffusion(length=2.0, diffusivity=3.0, storage=0.1),))
    assert len(Explicit(actuator=rock).described) == 3
    clock = AperiodicClock(shortest=1, longest=2)
    told = Explicit(clock=clock, measurement=SENSOR).settings
    assert told == {"substeps": 1, "clock": repr(clock), "measurement": repr(SENSOR)}
    assert repr(clock) == "AperiodicClock(shortest=1, longest=2, seed=0)"


def test_the_well_has_what_the_pump_holds_and_the_fault_what_the_rock_lets_through():
    """With a delay within the step the well still has, at its start, what was held before."""
    for part, well in ((0.0, 1.0), (0.5, 0.0)):
        stages = (Saturation(lowest=-1.0, highest=1.0), Delay(samples=0, part=part), Lag(time_constant=1.0))
        scheme, loop = Explicit(actuator=Actuator(stages=stages)), ClosedLoop(LAB, linear(**{SLIP: 1e6}))
        memory = scheme.memory(loop, 0.25)
        given = ca.SX.sym("given", 2 + len(loop.integrals) + len(memory))
        outputs = scheme.outputs(loop, 0, given, 0.25)
        assert list(outputs) == ["well_pressure"]
        read = ca.Function("read", [given], [outputs["well_pressure"], scheme.pressure(loop, 0, given, 0.25)])
        found = read([-1.0, 0.0, *[0] * len(loop.integrals), *memory.values()])
        assert [abs(float(value)) for value in found] == [well, 0.0]
    assert Explicit().outputs(loop, 0, given, 0.25) == {}


def test_behind_a_lag_slip_feels_what_has_come_through():
    """Rates of p and 1: under a pressure held p = held·(1 - exp(-t/τ)), up to what RK4 leaves out, (t/τ)⁵/120 of it."""
    scheme, loop = Explicit(actuator=Actuator(stages=(Lag(time_constant=2.0),))), ClosedLoop(LAB, linear(**{SLIP: 8.0}))
    vars(loop)["printed"] = lambda _, x, p: ca.vertcat(p, x.shape[0] - 1)
    held, _ = stepped(Explicit(), loop.controller, (-1.0, 0.0), 0.25)
    memory = scheme.memory(loop, 0.25)
    before = [-1.0, 0.0, *[0.0] * len(loop.integrals), *memory.values()]
    given = ca.SX.sym("given", len(before))
    end = scheme.advance(loop, ClassicRungeKutta, 0, given, 0.25)
    after = ca.Function("step", [given], [end])(before).full().ravel()
    come, left_out = -np.expm1(-0.25 / 2.0), abs(held) * (0.25 / 2.0) ** 5 / 100
    assert len(after) == len(before)
    assert after[:2] == pytest.approx([-1 + held * (0.25 - 2.0 * come), 0.25], abs=2.0 * left_out)
    assert after[-1] == pytest.approx(held * come, abs=left_out)
    changed = [name for name, a, b in zip(memory, before[-len(memory) :], after[-len(memory) :], strict=True) if a != b]
    assert changed == ["held_0", "flow_0"]
    assert after[-2] == pytest.approx(held, rel=1e-14)


def test_an_authority_that_is_told_is_remembered_in_place_of_the_nominal_one():
    loop = ClosedLoop(LAB, linear())
    assert Explicit(authority=2.0).memory(loop, 0.25)["authority_0"] == 2.0
    assert Explicit().memory(loop, 0.25)["authority_0"] == Explicit().nominal(loop) != 2.0
