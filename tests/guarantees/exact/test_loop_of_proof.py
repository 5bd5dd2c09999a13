"""Setups, statements and results of tracking proofs, by hand, with bounds of the theorem given."""

from dataclasses import replace
from fractions import Fraction as F

import pytest

from quakedesign.errors import CertificateError, ParameterError
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.fault import load_fault
from quakedesign.guarantees import Bounds, Claims, NoProof, SampledLoop, TrackingProof, guarantee
from quakedesign.guarantees.exact import tracking_proof
from quakedesign.guarantees.exact.guarantee_files import guarantee_document, read_guarantee
from quakedesign.guarantees.exact.invariant_set import InvariantPolytope
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.exact.tracking_proof import ContinuousProof, sentence_of
from quakedesign.laws import ImplicitStep, Power, compensated, summed_integrals
from quakedesign.loop.loop_setup import LoopSetup, Pump
from quakedesign.plant import uncertain_plant

TASK = uncertain_plant(load_fault("real-fault"))
BOUNDS = Bounds(slip_error=F(1, 8), slip_rate_error=F(1, 7), push=3 * TASK.authority, small_gain=F(1, 2))
STEPPED = replace(BOUNDS, stepped=5 * TASK.authority)
LAW = summed_integrals((F(5), F(3), F(7), F(2)), F(1, 10))
HELD = SampledLoop(law=LAW, step=F(1, 10))
SIGN = ImplicitStep(
    pull=(Power(factor=(F(1, 3), F(1, 3)), exponent=F(0), argument="slip"),), slopes=(F(0), F(0)), remainder=F(0)
)
ROOTED = compensated(SIGN, F(1, 2), F(1))


def of_reference(law):
    """The law with terms of the reference in every row."""
    return replace(law, of_reference=((F(1), F(0)),) * (len(law.states) + 1))


OF_REFERENCE = of_reference(LAW)
SETS_OUT = replace(LAW, first=((F(1), F(0)),) * len(LAW.states))
CLAIMS = Claims.of(TASK, BOUNDS)


# ---------------------------------------------------------------- setups


def test_the_delay_of_a_setup_counts_from_the_middle_of_the_averaging_time():
    found = ExactSetup.of(LoopSetup(step="1", delay="1/3", averaging_time="1/2"))
    assert (found.delay, found.averaging) == (F(1, 3) + F(1, 4), F(1, 2))


@pytest.mark.parametrize("changes", [{"diffusion": F(1, 50)}, {"longest_step": F(1, 5)}, {"law": of_reference(ROOTED)}])
def test_a_law_of_the_reference_has_no_diffusion_path_aperiodic_sampling_or_implicit_step(changes):
    assert replace(HELD, law=OF_REFERENCE).law.of_reference
    with pytest.raises(ParameterError, match="a law that uses slip, slip rate or reference directly"):
        replace(HELD, **{"law": OF_REFERENCE} | changes)


@pytest.mark.parametrize(
    "changes",
    [
        {"delay": F(1, 50)},
        {"lag": F(1, 50)},
        {"diffusion": F(1, 50)},
        {"initial_slip": F(1, 50)},
        {"initial_slip_rate": F(1, 50)},
        {"ramp": F(1, 50)},
        {"jitter": F(1, 50)},
        {"delay_jitter": F(1, 50)},
        {"averaging": F(1, 50)},
        {"law": SETS_OUT},
        {"law": ROOTED},
        {"pump": Pump(rate=F(1))},
    ],
)
def test_aperiodic_sampling_excludes_each_of_these(changes):
    replace(HELD, longest_step=F(1, 5), slip_noise=F(1), pump=Pump(least=F(-1), largest=F(1)))
    with pytest.raises(ParameterError, match="aperiodic sampling needs a linear law"):
        replace(HELD, **{"longest_step": F(1, 5)} | changes)


def test_the_loop_of_another_model_has_the_input_gain_of_that_model_behind_a_diffusion_path():
    """The response that is left out acts on the fault by the input gain, so twice as much with twice the gain."""
    held = replace(HELD, lag=F(1, 10), diffusion=F(1, 50))
    other = replace(TASK.model, gain=2 * TASK.model.gain)
    own, found = (held.loop(TASK, model).feedthrough["slip_rate_error", "awaited"] for model in (None, other))
    assert found == 2 * own > 0


# ---------------------------------------------------------------- statements


def test_bounds_by_name_are_those_that_are_claimed():
    assert CLAIMS.largest_step is None
    assert dict(CLAIMS.by_name) == {
        "slip_error": F(1, 8),
        "slip_rate_error": F(1, 7),
        "peak_slip_rate": CLAIMS.peak_slip_rate,
        "least_pressure": CLAIMS.least_pressure,
        "largest_pressure": CLAIMS.largest_pressure,
    }


def test_claims_with_a_largest_step_do_not_follow_from_claims_without():
    stepped = replace(CLAIMS, largest_step=UpperBound(F(5)))
    assert CLAIMS.covers(stepped)
    assert not stepped.covers(CLAIMS)
    assert not stepped.covers(replace(CLAIMS, largest_step=UpperBound(F(6))))


def proof(**changes):
    return TrackingProof(task=TASK, sampled_loop=replace(HELD, **changes), claims=CLAIMS)


def test_the_text_of_a_proof_gives_the_intervals():
    assert "real-fault held over 0.1 s: |e1| <= 0.125 m" in repr(proof())
    assert "real-fault held over 0.1 to 0.2 s: |e1|" in repr(proof(longest_step=F(1, 5)))


def test_a_sentence_names_a_diffusion_path_if_there_is_one():
    said = proof(diffusion=F(1, 50)).sentence()
    assert "over 0.1 s, through a diffusion path of L^2/D = 0.02 s, with exact measurements" in said
    assert "diffusion" not in proof().sentence()


@pytest.mark.parametrize(
    ("slip", "rate", "said"),
    [
        (F(0), F(0), "stick, from rest, with zero-order hold"),
        (F(1, 3), F(0), "from every initial state within 0.333333 m and 0 m/s of rest"),
        (F(0), F(2, 3), "from every initial state within 0 m and 0.666666 m/s of rest"),
    ],
)
def test_a_sentence_names_initial_errors_of_the_slip_or_the_slip_rate(slip, rate, said):
    assert said in proof(initial_slip=slip, initial_slip_rate=rate).sentence()


def test_the_shear_of_a_disturbance_is_that_which_is_covered_for_every_area_per_mass():
    """1 m/s² of force per mass is 1/2 Pa on a fault of 2 m²/kg, and 1/4 Pa on one of 4 m²/kg."""
    wide = replace(TASK, density=F(1), length=F(1, 3), spreads=(F(0), F(0), F(1, 3)), amplitude=F(1))
    assert wide.area_per_mass == (2, 4)
    assert "at most 1 m/s^2 (250 mPa of shear)" in sentence_of(wide, CLAIMS, "")


def test_a_proof_in_continuous_time_is_not_of_a_sampled_loop():
    assert (TrackingProof.sampled, ContinuousProof.sampled) == (True, False)
    assert (TrackingProof.covers_healing, NONE.only_pressure_fails) == (False, False)


def test_a_file_states_a_pump_with_its_limits_and_the_ramp_of_its_rate():
    def entries(**changes):
        return guarantee_document(proof(**changes))["loop"]

    limits = Pump(least=F(-1), largest=F(2))
    assert "pump" not in entries(pump=Pump())
    assert entries(pump=limits)["pump"] == {"least": "-1", "largest": "2"}
    assert entries(pump=limits, ramp=F(1, 50))["pump"] == {"least": "-1", "largest": "2"}
    assert entries(pump=Pump(rate=F(5)), ramp=F(1, 50))["pump"] == {"rate": "5", "ramp": "1/50"}


@pytest.mark.parametrize("pump", [{"rate": "5"}, {"least": "-1", "largest": "2", "ramp": "1/50"}, {}])
def test_a_pump_of_a_file_has_a_ramp_if_and_only_if_it_has_a_rate(pump):
    raw = guarantee_document(proof(pump=Pump(rate=F(5)), ramp=F(1, 50), delay_jitter=F(1, 300)))
    raw["claims"]["largest_step"] = "1"
    assert read_guarantee(raw).sampled_loop.ramp == F(1, 50)
    raw["loop"]["pump"] = pump
    with pytest.raises(CertificateError, match="must be given together" if pump else "must have limits or a rate"):
        read_guarantee(raw)


@pytest.mark.parametrize(
    ("changes", "jitter"),
    [
        ({"jitter": F(1, 50)}, {"measured": "1/50", "delay": "0"}),
        ({"delay_jitter": F(1, 50)}, {"measured": "0", "delay": "1/50"}),
        ({"averaging": F(1, 50)}, {"measured": "0", "delay": "0", "mean": "1/50"}),
        ({}, None),
    ],
)
def test_a_file_states_jitter_of_each_kind(changes, jitter):
    assert guarantee_document(proof(**changes))["loop"].get("jitter") == jitter


# ---------------------------------------------------------------- results

NONE = NoProof(reason="none")


@pytest.mark.parametrize(("bounds", "kind"), [(BOUNDS, TrackingProof), (NONE, NoProof)])
def test_a_guarantee_with_aperiodic_sampling_is_that_of_its_set(bounds, kind, monkeypatch):
    monkeypatch.setattr(tracking_proof, "_bounds", lambda *_: bounds)
    held = replace(HELD, longest_step=F(1, 5))
    reach = InvariantPolytope(inputs=(F(1),), facets=((F(1),),), at_samples=(((0,),) * 2,), between=(((0,),) * 2,))
    found = guarantee(TASK, held, invariant_set=reach)
    assert isinstance(found, kind)
    if found.available:
        assert (found.sampled_loop, found.invariant_set, found.claims) == (held, reach, CLAIMS.rounded())


def test_a_pump_without_a_rate_limit_and_a_given_ramp_need_no_search(monkeypatch):
    monkeypatch.setattr(tracking_proof, "certified_bounds", lambda *_: STEPPED)
    limited = replace(HELD, pump=Pump(least=F(-(10**9)), largest=F(10**9)))
    assert guarantee(TASK, limited).sampled_loop == limited
    given = replace(HELD, pump=Pump(rate=F(10**9)), ramp=F(1, 30))
    assert guarantee(TASK, given).sampled_loop == given


@pytest.mark.parametrize(
    ("rate", "needs", "ramps"),
    [
        (F(10**9), F(5), [F(1, 640)]),  # the first ramp, T_s/64, is proved
        (F(1), None, [F(1, 640)]),  # something other than the pump fails
        (F(100), F(5), [F(1, 640), F("0.0525")]),  # 5 Pa at 100 Pa/s and 5 % more
        (F(50), F("4.9"), [F(1, 640), F(1, 10)]),  # the longest ramp, T_s, is tried once
        (F(1), F(5), [F(1, 640)]),  # too slow even for the longest ramp
    ],
)
def test_a_ramp_grows_to_what_the_pump_needs_and_no_further(rate, needs, ramps, monkeypatch):
    tried = []

    def proved(_, held, __):
        tried.append(held.ramp)
        ends = len(tried) == 2 and held.ramp < held.longest_ramp
        return proof() if needs == 5 and (rate == 10**9 or ends) else replace(NONE, required_change=needs)

    monkeypatch.setattr(tracking_proof, "_proved", proved)
    found = guarantee(TASK, replace(HELD, pump=Pump(rate=rate)))
    assert tried == ramps
    if (rate, needs) == (1, 5):
        assert found.reason.startswith("changes of 5 Pa from one sample to the next may be commanded")


def test_a_result_tells_whether_the_pump_is_too_slow_or_the_pressure_too_large(monkeypatch):
    monkeypatch.setattr(tracking_proof, "certified_bounds", lambda *_: STEPPED)
    claims = Claims.of(TASK, STEPPED).rounded()
    slow = guarantee(TASK, replace(HELD, pump=Pump(rate=F(1)), ramp=F(1, 20)))
    assert (slow.required_change, slow.only_pressure_fails) == (claims.largest_step, False)
    small = guarantee(TASK, replace(HELD, pump=Pump(least=F(-1), largest=F(1))))
    assert (small.required_change, small.only_pressure_fails) == (None, True)
    monkeypatch.setattr(tracking_proof, "certified_bounds", lambda *_: replace(STEPPED, push=TASK.authority * 10**9))
    opened = guarantee(TASK, HELD)
    assert (opened.required_change, opened.only_pressure_fails) == (None, True)


def test_a_claim_of_the_pressure_touches_the_effective_normal_stress_and_opens_the_fault():
    for size, opens in ((TASK.normal_stress, True), (TASK.normal_stress - 1, False)):
        claims = replace(CLAIMS, largest_pressure=UpperBound(F(size)), least_pressure=LowerBound(F(0)))
        assert bool(claims.opening_reason(TASK)) is opens
