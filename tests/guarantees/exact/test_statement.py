"""Claims by hand: what follows from bounds, what covers what, and rounding to the outer side."""

from dataclasses import replace
from fractions import Fraction as F

import pytest

from quakedesign.errors import ParameterError, UnsupportedError
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.fault import load_fault
from quakedesign.guarantees import Bounds, Claims, NoProof, SampledLoop, TrackingProof, guarantee
from quakedesign.guarantees.exact import tracking_proof as continuous
from quakedesign.guarantees.exact import tracking_proof as statement
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.exact.tracking_proof import above, sentence_of
from quakedesign.laws import ImplicitStep, LinearLaw, Power, compensated, summed_integrals
from quakedesign.loop import ContinuousLaw, Instants
from quakedesign.loop.loop_setup import Pump
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.plant import uncertain_plant

TASK = uncertain_plant(load_fault("real-fault"))
CLAIMS = Claims(
    slip_error=UpperBound(F(1, 3)),
    slip_rate_error=UpperBound(F(1, 7)),
    peak_slip_rate=UpperBound(F(2, 7)),
    least_pressure=LowerBound(F(-10, 3)),
    largest_pressure=UpperBound(F(20, 3)),
    least_asked=LowerBound(F(-13, 3)),
    largest_asked=UpperBound(F(17, 3)),
    largest_step=UpperBound(F(5, 3)),
)
BOUNDS = Bounds(slip_error=F(0), slip_rate_error=F(1, 7), push=3 * TASK.authority, small_gain=F(1, 2))
NONE = NoProof(reason="none")
HELD = SampledLoop(law=summed_integrals((F(5), F(3), F(7), F(2)), F(1, 10)), step=F(1, 10))
SIGN = ImplicitStep(pull=(Power(factor=(F(1, 3), F(1, 3)), exponent=F(0), argument="slip"),),
                    slopes=(F(0), F(0)), remainder=F(0))  # fmt: skip
ROOTED = SampledLoop(law=compensated(SIGN, F(1, 2), F(1)), step=F(1))
NAMES = tuple(Claims.__dataclass_fields__)


def test_claims_are_the_bounds_of_the_errors_beside_the_reference_and_the_pressure_at_rest():
    found = Claims.of(TASK, BOUNDS)
    assert (found.slip_error, found.slip_rate_error) == (0, F(1, 7))
    assert found.peak_slip_rate == F(1, 7) + TASK.reference_rates[0]
    low, high = TASK.rest_pressure
    assert (found.least_pressure, found.largest_pressure) == (low - 3, high + 3)
    assert found.pressures == ((low - 3, high + 3),)
    behind = Claims.of(TASK, replace(BOUNDS, valve_push=7 * TASK.authority))
    assert behind.pressures == ((low - 3, high + 3), (low - 7, high + 7))
    assert behind.to_dict()["asked_pressure"] == [str(low - 7), str(high + 7)]
    assert "asked_pressure" not in found.to_dict()


@pytest.mark.parametrize("name", NAMES)
def test_claims_cover_what_is_tighter_in_every_entry_and_nothing_else(name):
    kind, outward = (LowerBound, -1) if name.startswith("least") else (UpperBound, 1)
    other = replace(CLAIMS, **{name: kind(getattr(CLAIMS, name) + F(outward, 10**12))})
    assert CLAIMS.covers(CLAIMS)
    assert other.covers(CLAIMS)
    assert not CLAIMS.covers(other)


def test_claims_that_say_nothing_of_the_valve_cover_those_that_do_and_not_the_other_way_round():
    short = replace(CLAIMS, least_asked=None, largest_asked=None)
    assert short.covers(CLAIMS)
    assert not CLAIMS.covers(short)
    assert short.rounded() == replace(CLAIMS.rounded(), least_asked=None, largest_asked=None)


def test_rounded_claims_are_a_thousandth_weaker_with_four_digits():
    found = CLAIMS.rounded()
    assert found.covers(CLAIMS)
    assert (found.slip_error, found.slip_rate_error) == (F("0.3337"), F("0.143"))  # 0.33366… and 1001/7000 itself
    assert found.peak_slip_rate == F("0.286")
    assert (found.least_pressure, found.largest_pressure) == (F("-3.344"), F("6.677"))  # ∓ 10/1000
    assert (found.least_asked, found.largest_asked) == (F("-4.344"), F("5.677"))


@pytest.mark.parametrize(("value", "rounded"), [("12345.1", "12350"), ("-12345.1", "-12340"), ("0", "0"), ("1", "1")])
def test_four_digits_are_not_below(value, rounded):
    assert above(F(value)) == F(rounded)


@pytest.mark.parametrize(
    ("amplitude", "change", "said"),
    [
        (F("0.00032"), None, "for every disturbance of at most 0.00032 m/s^2 (4 kPa of shear), for every"),
        (
            F("0.00032"),
            F("0.0002208"),
            "at most 0.00032 m/s^2 (4 kPa of shear) that starts at 0 and changes by at most 0.00022 m/s^3 (class rate)",
        ),
        (
            F(1, 3),
            F(2, 3),
            "at most 0.333 m/s^2 (4.16 MPa of shear) that starts at 0 and changes by at most 0.666 m/s^3 (class rate)",
        ),
        (F(0), None, "with zero-order hold over 1 s, without disturbance, for every friction law"),
        (F(0), F(0), "with zero-order hold over 1 s, without disturbance, for every friction law"),
    ],
)
def test_a_sentence_says_which_disturbances_and_none_that_are_larger(amplitude, change, said):
    assert said in sentence_of(
        replace(TASK, amplitude=amplitude, change=change), CLAIMS, "with zero-order hold over 1 s"
    )


def test_parameters_are_said_to_be_constant_for_a_spring_that_stiffens_at_once_pulls_more_than_any_disturbance():
    """At the end of the task, by a tenth: 0.1·k̂·785 mm, k̂ = 0.48/s², which no sampled law can know of for a period."""
    assert "for every friction law and all constant parameters of the box" in sentence_of(
        TASK, CLAIMS, "with zero-order hold over 1 s"
    )
    assert TASK.stiffness[0] * TASK.target_slip / 10 == F("0.03768") > 100 * TASK.amplitude


def test_noise_is_said_and_must_be_of_what_is_measured():
    alone = LinearLaw(
        states=("z",),
        update=((F(1),),),
        measured=((F(1), F(0)),),
        output=(F(1),),
        feedback=(F(1), F(0)),
        implicit_step=None,
    )
    both = SampledLoop(law=replace(alone, feedback=(F(1), F(1))), step=F(1), slip_noise=F(1, 3), rate_noise=F(2, 3))
    said = TrackingProof(task=TASK, sampled_loop=both, claims=CLAIMS).sentence()
    told = "with zero-order hold over 1 s, with any noise of at most 0.333333 m in the measured slip, "
    assert told + "with any noise of at most 0.666666 m/s in the measured slip rate, for every" in said
    rough = TrackingProof(task=TASK, sampled_loop=replace(both, slip_noise=F(0)), claims=CLAIMS).sentence()
    assert "m/s in the measured slip rate, with exact measurements of slip, for every" in rough
    rough = TrackingProof(task=TASK, sampled_loop=replace(both, rate_noise=F(0)), claims=CLAIMS).sentence()
    assert "0.333333 m in the measured slip, with exact measurements of slip rate, for every" in rough
    assert (both.noise, replace(both, slip_noise=F(0)).noise) == (
        {"slip_noise": F(1, 3), "rate_noise": F(2, 3)},
        {"rate_noise": F(2, 3)},
    )
    quiet = SampledLoop(law=alone, step=F(1))
    assert (quiet.noise, quiet.setup) == ({}, ExactSetup())
    assert replace(quiet, lag=F(1, 2), ramp=F(1, 4)).setup == ExactSetup(lag=F(1, 2))
    said = TrackingProof(task=TASK, sampled_loop=quiet, claims=CLAIMS).sentence()
    assert "over 1 s, with exact measurements of the slip alone, for every" in said
    assert SampledLoop(law=alone, step=F(1), slip_noise=F(1)).noise == {"slip_noise": 1}
    with pytest.raises(ParameterError, match="needs a law that measures the slip rate"):
        replace(quiet, rate_noise=F(1))
    for name in ("slip_noise", "rate_noise"):
        with pytest.raises(ParameterError, match="must be 0 or more"):
            replace(both, **{name: F(-1, 10**9)})


def test_claims_are_shown_as_the_exact_numbers():
    assert CLAIMS.to_dict() == {
        "slip_error": "1/3", "slip_rate_error": "1/7", "peak_slip_rate": "2/7", "pressure": ["-10/3", "20/3"],
        "asked_pressure": ["-13/3", "17/3"], "largest_step": "5/3",
    }  # fmt: skip


def test_a_sentence_says_when_and_has_every_claim_on_its_outer_side():
    held = SampledLoop(law=HELD.law, step=F(1, 10), delay=F(1, 50), lag=F(3, 100))
    said = TrackingProof(task=TASK, sampled_loop=held, claims=CLAIMS).sentence()
    where = "on the plant without stick, from rest, with zero-order hold over 0.1 s"
    exact = "with exact measurements of slip and slip rate, for every disturbance"
    assert said.startswith(f"{where}, with a delay of 0.02 s, through a lag of 0.03 s, {exact}")
    assert TrackingProof(task=TASK, sampled_loop=HELD, claims=CLAIMS).sentence().startswith(f"{where}, {exact}")
    assert said.endswith(", for all t >= 0")
    assert "never exceeds 286 mm/s, the slip stays within 334 mm of the reference" in said
    assert "the pressure between -3.34 Pa and 6.67 Pa, at the valve between -4.34 Pa and 5.67 Pa, commanded" in said


def test_a_law_runs_once_a_step_without_delay_and_lag_unless_it_has_an_implicit_root():
    held = SampledLoop(law=HELD.law, step=F(1, 10))
    assert (held.delay, held.lag) == (0, 0)
    assert (held.controller.law, held.controller.step) == (held.law, F(1, 10))
    with pytest.raises(UnsupportedError, match="states the implicit step, not the gains"):
        _ = ROOTED.controller


@pytest.mark.parametrize(
    ("held", "found", "verdict"),
    [
        (HELD, BOUNDS, Verdict.PROVED),
        (HELD, replace(BOUNDS, push=4 * TASK.authority), Verdict.UNDECIDED),
        (HELD, NONE, Verdict.UNDECIDED),
        (ROOTED, BOUNDS, Verdict.PROVED),
        (ROOTED, replace(BOUNDS, push=4 * TASK.authority), Verdict.UNDECIDED),
    ],
)
def test_claims_are_proved_where_the_bounds_give_them_and_the_root_is_as_said(held, found, verdict, monkeypatch):
    monkeypatch.setattr(statement, "certified_bounds", lambda *_: found)
    assert TrackingProof(task=TASK, sampled_loop=held, claims=Claims.of(TASK, BOUNDS)).check() is verdict


def test_a_root_beyond_its_lines_at_the_claims_is_undecided(monkeypatch):
    """w = e2 − sign(e1 + w)/3 is 0 for e1 = 0 where |e2| ≤ 1/3."""
    wide = replace(BOUNDS, slip_rate_error=F(1, 2))
    monkeypatch.setattr(statement, "certified_bounds", lambda *_: wide)
    assert TrackingProof(task=TASK, sampled_loop=ROOTED, claims=Claims.of(TASK, wide)).check() is Verdict.UNDECIDED
    assert TrackingProof(task=TASK, sampled_loop=HELD, claims=Claims.of(TASK, wide)).check() is Verdict.PROVED
    told = replace(BOUNDS, slip_rate_error=F(1, 3) - F(1, 10**9))
    for noise, verdict in ((F(0), Verdict.PROVED), (F(1, 10**6), Verdict.UNDECIDED)):
        loud = TrackingProof(task=TASK, sampled_loop=replace(ROOTED, rate_noise=noise), claims=Claims.of(TASK, told))
        monkeypatch.setattr(statement, "certified_bounds", lambda *_: told)
        assert loud.check() is verdict
    monkeypatch.setattr(statement, "certified_bounds", lambda *_: wide)
    none = guarantee(TASK, ROOTED)
    assert isinstance(none, NoProof)
    assert "leaves its sector at errors up to 0 m and 0.501 m/s" in none.reason


def test_a_root_that_is_told_another_slip_may_leave_its_line(monkeypatch):
    """w = e2 − sign(e1 + w) is −e1 where |e1| + |e2| ≤ 1; with E = 1/2 and R = 1/7 noise of 1/3 is not too much."""
    sign = replace(SIGN, pull=(replace(SIGN.pull[0], factor=(F(1), F(1))),), slopes=(F(1), F(1)))
    bounds = replace(BOUNDS, slip_error=F(1, 2))
    monkeypatch.setattr(statement, "certified_bounds", lambda *_: bounds)
    for noise, verdict in ((F(0), Verdict.PROVED), (F(1, 3), Verdict.PROVED), (F(1, 2), Verdict.UNDECIDED)):
        held = SampledLoop(law=compensated(sign, F(1, 2), F(1)), step=F(1), slip_noise=noise)
        assert TrackingProof(task=TASK, sampled_loop=held, claims=Claims.of(TASK, bounds)).check() is verdict


def test_a_guarantee_claims_the_bounds_a_little_wider_or_has_none(monkeypatch):
    for held in (HELD, ROOTED):
        monkeypatch.setattr(statement, "certified_bounds", lambda *_: BOUNDS)
        claims = Claims.of(TASK, BOUNDS).rounded()
        assert guarantee(TASK, held) == TrackingProof(task=TASK, sampled_loop=held, claims=claims)
        monkeypatch.setattr(statement, "certified_bounds", lambda *_: NONE)
        assert guarantee(TASK, held) is NONE


def test_a_loop_that_is_not_seen_to_be_stable_has_no_guarantee(monkeypatch):
    def refuse(*_):
        raise ParameterError("not stable.")

    monkeypatch.setattr(statement, "certified_bounds", refuse)
    found = guarantee(TASK, HELD)
    assert found.reason == "with zero-order hold over 0.1 s even the nominal loop is not stable, or decays too slowly"


def test_bounds_are_asked_for_the_loop_its_root_and_the_noise_that_there_is(monkeypatch):
    asked = []
    monkeypatch.setattr(statement, "certified_bounds", lambda *given: asked.append(given) or NONE)
    late = replace(ROOTED, delay=F(1, 3), lag=F(1, 5), rate_noise=F(1, 9))
    claim = TrackingProof(task=TASK, sampled_loop=late, claims=CLAIMS)
    assert claim.theorem_bounds() is NONE
    assert asked == [(TASK, claim.loop, SIGN, {"rate_noise": F(1, 9)}, F(0))]
    assert tuple(claim.loop.sampled) == ("root", "rate_noise")
    assert [segment.duration for segment in claim.loop.segments] == [F(1, 3), F(2, 3)]


def test_pressures_at_the_valve_are_those_in_the_fault_where_nothing_lies_between():
    proof = TrackingProof(task=TASK, sampled_loop=HELD, claims=CLAIMS)
    assert proof.valve_pressures == (CLAIMS.least_asked, CLAIMS.largest_asked)
    short = replace(CLAIMS, least_asked=None, largest_asked=None)
    direct = TrackingProof(task=TASK, sampled_loop=HELD, claims=short)
    assert direct.valve_pressures == (CLAIMS.least_pressure, CLAIMS.largest_pressure)


@pytest.mark.parametrize(("off", "proved"), [(F(1, 10**9), True), (F(0), False), (F(-1), False)])
def test_a_fault_that_may_open_has_no_guarantee(off, proved, monkeypatch):
    """With claims as wide as one likes: what counts is how far below σ′ the pressure follows to stay."""
    ends = {"least_pressure": LowerBound(F(-(10**9))), "largest_pressure": UpperBound(F(10**9))}
    wide = replace(CLAIMS, **ends, least_asked=None, largest_asked=None, largest_step=None)
    bounds = replace(BOUNDS, push=(TASK.normal_stress - off - TASK.rest_pressure[1]) * TASK.authority)
    assert wide.follow(TASK, bounds) is proved
    monkeypatch.setattr(statement, "_bounds", lambda *_: bounds)
    found = TrackingProof(task=TASK, sampled_loop=HELD, claims=wide)
    assert found.check() is (Verdict.PROVED if proved else Verdict.UNDECIDED)
    law = ContinuousLaw(states=(), rates=(), measured=(), output=(), feedback=(F(-1), F(-1)))
    monkeypatch.setattr(continuous, "_continuous_bounds", lambda *_: bounds)
    assert continuous.ContinuousProof(task=TASK, law=law, claims=wide).check() is found.check()
    for none in (guarantee(TASK, HELD), continuous.continuous_peaks(TASK, law)):
        assert isinstance(none, NoProof)
        assert none.reason.endswith("the effective normal stress is 50 MPa: the fault may open")


def test_jitter_is_said_and_makes_inputs_of_all_that_is_measured():
    held = replace(HELD, jitter=F(1, 300), delay_jitter=F(1, 150))
    said = TrackingProof(task=TASK, sampled_loop=held, claims=CLAIMS).sentence()
    told = "slip rate, each measurement within 0.00333333 s of its instant, each pressure within 0.01 s"
    assert told in said
    assert "5.67 Pa, commanded changes of at most 1.67 Pa a sample" in said
    late = TrackingProof(task=TASK, sampled_loop=replace(HELD, delay_jitter=F(1, 150)), claims=CLAIMS).sentence()
    assert "slip and slip rate, each pressure within 0.00666666 s of its due time, for every" in late
    assert (held.noise, HELD.noise) == ({"slip_noise": 0, "rate_noise": 0}, {})
    assert tuple(held.loop(TASK).sampled) == ("slip_noise", "rate_noise")
    alone = replace(HELD.law, feedback=(F(1), F(0)), measured=tuple((row[0], F(0)) for row in HELD.law.measured))
    assert replace(held, law=alone).noise == {"slip_noise": 0}
    paced = replace(held, pump=Pump(rate=F(5)), ramp=F(1, 50))
    assert paced.instants == Instants(measured=F(1, 300), arrived=F(1, 100), ramp=F(1, 50))
    assert (HELD.instants, replace(HELD, pump=Pump(least=F(-1), largest=F(1))).instants) == (None, None)
    assert (
        "with a pump of 5 Pa/s, whose limits are never"
        in TrackingProof(task=TASK, sampled_loop=paced, claims=CLAIMS).sentence()
    )
    mean = replace(HELD, averaging=F(1, 30), jitter=F(1, 300))
    assert (mean.timing_error, mean.instants) == (F(1, 50), Instants(measured=F(1, 50), arrived=F(1, 300)))
    assert tuple(mean.noise) == ("slip_noise", "rate_noise")
    said = TrackingProof(task=TASK, sampled_loop=mean, claims=CLAIMS).sentence()
    assert "slip rate, each measurement averaged over 0.0333333 s around its instant, each measurement" in said
    for name in ("jitter", "delay_jitter", "averaging", "ramp"):
        with pytest.raises(ParameterError, match="jitter, delay jitter, averaging and ramp must be 0 or more"):
            replace(HELD, **{name: F(-1, 10**9)})


def test_what_a_law_is_told_is_off_by_noise_and_by_the_reference_until_it_is_measured():
    held = replace(HELD, slip_noise=F(1, 3), rate_noise=F(1, 7), jitter=F(1, 50))
    first, second = TASK.reference_rates
    assert held.measured_errors(TASK, (F(1), F(2))) == (F(4, 3) + first / 50, F(15, 7) + second / 50)


def test_what_comes_late_may_leave_a_root_its_lines(monkeypatch):
    """w = e2 − sign(e1 + w)/3 is 0 where |e2| ≤ 1/3, of what is compared with a reference r″ away as well."""
    told = replace(BOUNDS, slip_rate_error=F(1, 3) - F(1, 10**12))
    monkeypatch.setattr(statement, "certified_bounds", lambda *_: told)
    for jitter, verdict in ((F(0), Verdict.PROVED), (F(1, 10), Verdict.UNDECIDED)):
        late = TrackingProof(task=TASK, sampled_loop=replace(ROOTED, jitter=jitter), claims=Claims.of(TASK, told))
        assert late.check() is verdict


@pytest.mark.parametrize("changes", [{"jitter": F(1, 50)}, {"delay_jitter": F(1, 50)}, {"ramp": F(1, 50)}])
def test_a_limit_at_rest_waits_for_what_is_late(changes):
    held = replace(HELD, law=replace(HELD.law, applied=(F(0), F(0))))
    plain = TrackingProof(task=TASK, sampled_loop=held, claims=Claims.of(TASK, BOUNDS))
    later = replace(plain, sampled_loop=replace(plain.sampled_loop, **changes))
    moved = later.rest_limit.width - plain.rest_limit.width
    assert float(moved) == pytest.approx(float(plain.rest_limit.per_slip * TASK.reference_rates[0]) / 50, rel=0.01)
