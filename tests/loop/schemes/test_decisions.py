"""What a law of samples decides at one sample, by hand, and how it runs."""

from dataclasses import replace
from fractions import Fraction as F

import casadi as ca
import pytest
import sympy as sp

from quakedesign.errors import ParameterError
from quakedesign.fault import load_fault
from quakedesign.laws import Sampling, control_law
from quakedesign.loop import discrete_law, schemes, simulation_scheme
from quakedesign.loop.discrete_law import (
    DiscreteLaw,
    acceleration,
    applied_pressure,
    authority,
    rate_error,
    slip,
    slip_error,
    step,
)
from quakedesign.loop.schemes import scheme_of_run
from quakedesign.loop.schemes.compensated import Compensated
from quakedesign.loop.schemes.explicit import Explicit
from quakedesign.loop.schemes.implicit import end_rate, end_slip

ONE, TWO = sp.symbols("xi_1 xi_2", real=True)
LAW = DiscreteLaw(-2 * slip_error - 3 * rate_error - 5 * ONE, (slip_error + 4 * ONE,), (ONE,))
KNOWN = {
    slip_error: 1.0,
    rate_error: 3.0,
    ONE: 0.5,
    step: 0.5,
    authority: 4.0,
    applied_pressure: 7.0,
    acceleration: 6.0,
    slip: 9.0,
}


def known(**own):
    return {symbol: ca.SX(value) for symbol, value in KNOWN.items()}


def numbers(entries):
    return [float(ca.DM(ca.SX(entry))) for entry in entries]


def test_the_explicit_scheme_takes_the_law_at_the_measured_state_and_one_forward_step():
    found = Explicit.derive(LAW)
    assert found == (LAW.pressure, *LAW.rates)
    decision = Explicit.decide(found, LAW, known(), [])
    assert numbers([decision.pressure]) == [-2 - 9 - 2.5]
    assert numbers(decision.integrals) == [0.5 + 0.5 * (1 + 2)]
    assert decision.own == []


@pytest.mark.parametrize(
    ("pressure", "integrals", "share", "slope"),
    [
        (LAW.pressure, (ONE,), 5, -5),
        (LAW.pressure - 7 * TWO, (ONE, TWO), 12, 0),
        (LAW.pressure + 5 * ONE, (), 0, 0),
    ],
)
def test_the_compensated_scheme_derives_the_pull_with_integral_states_at_zero(pressure, integrals, share, slope):
    pull, ahead, found = Compensated.derive(DiscreteLaw(pressure, (slip_error,) * len(integrals), integrals))
    assert (ahead, found) == (0, slope)
    assert sp.expand(pull - step * authority * (-(2 + share * step) * end_slip - 3 * end_rate)) == 0


OWN = [1.0, 2.0, 0.25, 0.125, 0.3]  # a sample was taken; e2 then, feed-forward then, d, weight
LIMIT = [1e6, 0.5, 0.125, -1e6, 1e6, 0.5, 22.0, 9.0]  # width, per slip, resolution; least, largest and fastest
# of the pressure; largest p + r/2 so far, last slip; now r = 9 − 1


def decided(law, own=OWN, limit=LIMIT):
    decision = Compensated.decide(Compensated.derive(law), law, known(), [ca.SX(v) for v in (*own, *limit)])
    assert numbers(decision.own[5:11]) == limit[:6]
    return numbers([decision.pressure]), numbers(decision.integrals), numbers(decision.own[:5])


def test_the_compensated_scheme_follows_the_disturbance_and_answers_it():
    """T_sB0 = 2: w = 3 + 2(−(2 + 5/2)(1 + w/2) − 3w) is −12/23; d + a((3 − 2)/2 − (7 − 1/4) − d)."""
    estimate = 0.125 + 0.3 * (0.5 - 6.75 - 0.125)
    pressure, after, own = decided(LAW)
    assert pressure == pytest.approx([(-12 / 23 - 3) / 2 - estimate], rel=1e-14)
    assert after == pytest.approx([estimate / 5], rel=1e-14)
    assert own == pytest.approx([1, 3, 0, estimate, 0.3], rel=1e-14)
    assert decided(LAW, [0.0, *OWN[1:]])[2] == [1, 3, 0, 0, 0.3]
    several = replace(LAW, rates=(slip_error, ONE), integrals=(ONE, TWO))
    assert decided(several)[1] == [0, 0]


@pytest.mark.parametrize(
    ("asked", "limit", "applied", "highest"),
    [
        (5, LIMIT, 5, 22),
        (5, [3.0, *LIMIT[1:]], 15, 22),  # no less than 22 − 4 − 3
        (5, [3.0, *LIMIT[1:7], 8.9], 15, 22),
        (5, [3.0, *LIMIT[1:7], 8.7], 5, 22),  # the fault moved by more than the resolution
        (50, LIMIT, 50, 54),
        (50, [*LIMIT[:4], 40.0, *LIMIT[5:]], 40, 44),  # no more than is proved
        (-50, [*LIMIT[:3], -40.0, *LIMIT[4:]], -40, 22),
        (5, [3.0, *LIMIT[1:4], 11.0, *LIMIT[5:]], 11, 22),  # which counts more than the limit at rest
        (50, [*LIMIT[:4], 40.0, 0.5, 22.0, 8.4], 50, 54),  # the fault moved faster than is proved
    ],
)
def test_at_rest_the_pressure_has_a_limit(asked, limit, applied, highest):
    law = DiscreteLaw.of(None, float(asked))
    decision = Compensated.decide(Compensated.derive(law), law, known(), [ca.SX(v) for v in (*OWN, *limit)])
    assert numbers([decision.pressure, *decision.own[11:]]) == [applied, highest, 9]


def test_a_feed_forward_is_added_and_known_not_to_be_a_disturbance():
    estimate = 0.125 + 0.3 * (0.5 - 6.75 - 0.125)
    pressure, _, own = decided(replace(LAW, pressure=LAW.pressure + 11 * acceleration))
    assert pressure == pytest.approx([(-12 / 23 - 3) / 2 - estimate + 66], rel=1e-14)
    assert own == pytest.approx([1, 3, 66, estimate, 0.3], rel=1e-14)


def test_a_constant_pressure_is_no_law_to_compensate():
    assert decided(DiscreteLaw.of(None, 5.0)) == ([5], [], [1, 3, 5, 0, 0.3])


def test_the_compensated_scheme_starts_without_a_sample_and_in_the_middle_of_the_box():
    scheme, fault = simulation_scheme("compensated", weight=0.25), load_fault("real-fault")
    assert scheme.initial_memory[:5] == (0, 0, 0, 0, 0.25)
    assert scheme.initial_memory[6:] == (0, 0, -1e30, 1e30, 0, 0, 0)
    assert scheme.own_size == len(scheme.initial_memory) == 13
    limited = simulation_scheme("compensated", rest_width=7.0, rest_per_slip=3.0, rest_resolution=2.0)
    assert limited.initial_memory[5:] == (7, 3, 2, -1e30, 1e30, 0, 0, 0)
    within = simulation_scheme("compensated", rest_width=7.0, rest_least=-4.0, rest_largest=5.0, rest_fastest=6.0)
    assert within.initial_memory[5:] == (7, 0, 0, -4, 5, 6, 0, 0)
    assert within.settings.items() >= {"rest_least": -4, "rest_largest": 5, "rest_fastest": 6}.items()
    assert "rest_least" not in limited.settings
    assert [limited.settings[f"rest_{name}"] for name in ("width", "per_slip", "resolution")] == [7, 3, 2]
    assert "rest_width" not in scheme.settings
    assert scheme.settings["weight"] == 0.25
    assert Compensated().weight == 0.5
    assert Compensated(weight=1).weight == 1
    low, high = fault.authority_range
    assert low < high
    assert scheme.nominal(type("Loop", (), {"fault": fault})) == pytest.approx((low * high) ** 0.5)


def test_schemes_are_found_by_name_and_settings_are_theirs():
    assert schemes()["explicit"] is Explicit
    assert isinstance(simulation_scheme("compensated", weight=0.1), Compensated)
    assert isinstance(simulation_scheme("quakedesign.loop.schemes.explicit:Explicit"), Explicit)
    with pytest.raises(ParameterError, match="scheme must be one of compensated, continuous, explicit"):
        simulation_scheme("other")
    with pytest.raises(ParameterError, match=r"weight is a setting of compensated, stick-slip\. .* scheme explicit"):
        simulation_scheme("explicit", weight=0.1)
    with pytest.raises(ParameterError, match="other is a setting of no scheme"):
        simulation_scheme("continuous", other=1)


FREE = control_law("cta").from_values(("7", "5", "2.3", "1.1"), scale="1/1000")
SETTINGS = (("weight", F(1, 4)), ("authority", F(3, 10**8)))
OWNED = replace(FREE, sampling=Sampling(step=F(1, 10), scheme="compensated", settings=SETTINGS))
TOLD = {"weight": 0.25, "authority": 3e-8}


def test_a_law_runs_as_asked_for_unless_it_is_one_of_samples():
    for controller in (None, FREE):
        assert scheme_of_run(controller, None, None) == ("explicit", None, {})
        assert scheme_of_run(controller, None, 0.5, "implicit") == ("implicit", 0.5, {})
        assert scheme_of_run(controller, "continuous", 0.5) == ("continuous", 0.5, {})
    told = simulation_scheme("compensated", **TOLD)
    assert scheme_of_run(OWNED, None, None) == scheme_of_run(OWNED, "compensated", 0.1) == ("compensated", 0.1, TOLD)
    assert scheme_of_run(OWNED, told, 0.1) == scheme_of_run(OWNED, told, None) == (told, 0.1, {})
    plain = replace(FREE, sampling=Sampling(step=F(1, 10)))
    assert scheme_of_run(plain, None, None, "implicit") == ("explicit", 0.1, {})


@pytest.mark.parametrize(
    ("scheme", "period", "received"),
    [
        ("explicit", None, r"Received the scheme explicit and the step 0\.1 s"),
        (None, 0.2, r"Received the scheme compensated and the step 0\.2 s"),
        (
            simulation_scheme("explicit"),
            0.1,
            r"Received the scheme explicit, weight None, authority None and the step 0\.1 s",
        ),
        (
            simulation_scheme("compensated", weight=0.5, authority=3e-8),
            None,
            r"weight 0\.5, authority 3e-08 and the step 0\.1 s",
        ),
    ],
)
def test_a_law_of_samples_runs_as_it_was_designed(scheme, period, received):
    with pytest.raises(
        ParameterError, match=r"compensated, weight 0\.25, authority 3e-08 and the step 0\.1 s.*" + received
    ):
        scheme_of_run(OWNED, scheme, period)


def test_values_are_those_of_the_expressions():
    assert numbers(discrete_law.values((slip_error * rate_error, sp.Integer(2)), known())) == [3, 2]
