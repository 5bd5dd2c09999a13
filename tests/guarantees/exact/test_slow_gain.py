"""A slow input gain by hand: parts, spread, gains that are joined, claims that follow from themselves, files."""

import json
from dataclasses import replace
from decimal import ROUND_CEILING, Context
from fractions import Fraction as F
from math import ceil, exp

import pytest

from quakedesign.errors import ParameterError
from quakedesign.exact import UpperBound
from quakedesign.fault import load_fault
from quakedesign.guarantees import Bounds, Claims, NoProof, SampledLoop, TrackingProof, VaryingGain, guarantee
from quakedesign.guarantees.exact import small_gain as module
from quakedesign.guarantees.exact import tracking_proof as statement
from quakedesign.guarantees.exact.guarantee_files import guarantee_text
from quakedesign.guarantees.exact.sampled_loop import GainSpread, channels_of
from quakedesign.laws import summed_integrals
from quakedesign.loop import PeriodicLoop
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.plant import uncertain_plant
from quakedesign.plant.fault_plant import FaultPlant, Friction

SLOW = VaryingGain(parts=2, growth=F(1, 9))
FRICTION = Friction(static=F(4), least=F(4), largest=F(4), weakening=F(5), strengthening=F(2), rate_slope=F(0))
BY_HAND = FaultPlant(  # N̂ from 1/2 to 3/2, b = 2, β from 1 to 3, r′ up to 2
    name="by hand", density=F(1), shear_modulus=F(1), length=F(1), damping=F(0), normal_stress=F(1),
    spreads=(F(0), F(0), F(1, 2)), friction=FRICTION, shape=(F(0), F(0), F(3), F(-2)), target_slip=F(4),
    operation_time=F(3), amplitude=F(0), change=None, growths=(F(0), F(0)),
)  # fmt: skip
TASK = uncertain_plant(load_fault("real-fault"))
HELD = SampledLoop(law=summed_integrals((F(5), F(3), F(7), F(2)), F(1, 10)), step=F(1, 10), slip_noise=F(1, 10**6))
BOUNDS = Bounds(slip_error=F(1, 2), slip_rate_error=F(1, 7), push=TASK.authority, small_gain=F(1, 2))
NONE = NoProof(reason="none")
GAINS = {("slip_error", "aged"): (F(1),)}


@pytest.mark.parametrize(("parts", "growth"), [(0, 1), (17, 1), (-1, 1), (2, 0), (2, F(-1, 9))])
def test_other_parts_and_growths_are_refused(parts, growth):
    with pytest.raises(ParameterError, match="needs 1 to 16 parts and a positive growth"):
        VaryingGain(parts=parts, growth=F(growth))


@pytest.mark.parametrize(("parts", "gains"), [(1, ["4"]), (2, ["3", "5"]), (3, ["8/3", "4", "16/3"])])
def test_parts_have_their_middles(parts, gains):
    found = replace(SLOW, parts=parts).models(BY_HAND)
    assert found == tuple(replace(BY_HAND.model, gain=F(gain)) for gain in gains)
    assert VaryingGain(parts=16, growth=F(1, 9)).models(BY_HAND)[15].gain == 2 * (3 - F(1, 16))


def test_friction_of_the_rate_has_no_slow_gain():
    with pytest.raises(ParameterError, match="needs friction that depends on the slip alone"):
        SLOW.models(replace(BY_HAND, friction=replace(FRICTION, rate_slope=F(1, 10))))


@pytest.mark.parametrize("slopes", [(5, 2), (2, 5)])
def test_the_spread_is_that_of_the_steeper_slope(slopes):
    """κ = 5·(3/2)/2, half a part 1/2; σ ≤ e^{ασ}/(eα), with four digits of 1/e from above."""
    friction = replace(FRICTION, weakening=F(slopes[0]), strengthening=F(slopes[1]))
    found = SLOW.spread(replace(BY_HAND, friction=friction), F(1, 3))
    assert found.present == F(1, 2) + 2 * F(15, 4) / 3
    assert found.past == F(15, 4) * 2 * 9 * F(ceil(10**4 * exp(-1)), 10**4)


def loop_of(rate):
    inputs = {"acceleration": (F(0), F(1)), "drift": (F(1), F(0))}
    return PeriodicLoop(states=("a", "b"), flow=((F(0), F(1)), (F(2), rate)), segments=(), inputs=inputs, outputs={})


def test_a_loop_that_grows_has_more_on_its_diagonal_and_one_input():
    found = module.grown(loop_of(F(-3)), F(1, 2))
    assert found.flow == ((F(1, 2), 1), (2, F(-5, 2)))
    assert (found.inputs, found.sampled, found.fading) == ({"aged": (0, 1)}, {}, {})


def test_gains_of_one_part_follow_those_of_the_other(monkeypatch):
    monkeypatch.setattr(module, "norms", lambda loop: {("y", name): (name, loop.flow[1][1]) for name in loop.inputs})
    whole = {"acceleration": (), "drift": (), "aged": ()}
    for rates in ([-3], [-3, -5]):
        parts = [(F(rate), rate + F(1, 2)) for rate in rates]
        expected = {("y", name): tuple(v for part in parts for v in (name, part[name == "aged"])) for name in whole}
        assert module.varying_gain_norms([loop_of(F(rate)) for rate in rates], F(1, 2)) == expected


def test_a_spread_takes_the_place_of_the_half_range_and_brings_an_input_of_the_past():
    spread = GainSpread(present=F(1, 3), past=F(1, 5))
    plain, (first, *others) = channels_of(TASK, None, F(1)), channels_of(TASK, None, F(1), {}, spread)
    assert first == replace(plain[0], coefficients={**TASK.half_ranges, "push": F(1, 3)})
    assert [channel.name for channel in plain] == ["acceleration", "drift"]
    assert others[0] == plain[1]
    assert [(channel.name, channel.constant, channel.coefficients) for channel in others[1:]] == [
        ("aged", 0, {"push": F(1, 5)})
    ]


def test_a_loop_of_another_model_has_its_gain():
    found = HELD.loop(TASK, replace(TASK.model, gain=5 * TASK.authority))
    assert (found.flow[1][-1], found.segments) == (5, HELD.loop(TASK).segments)


@pytest.fixture
def asked(monkeypatch):
    """Answers to what is asked of the theorem, in turn, and the questions."""
    answers, questions = [], []

    def best_bounds(*given):
        questions.append(given)
        return answers.pop(0)

    monkeypatch.setattr(module, "norms", lambda _: GAINS)
    monkeypatch.setattr(statement, "best_bounds", best_bounds)
    return answers, questions


def claims_of(slip_error, kept=BOUNDS):
    return replace(Claims.of(TASK, kept), slip_error=UpperBound(slip_error))


def test_bounds_are_asked_for_the_spread_of_the_slip_error_that_is_claimed(asked):
    answers, questions = asked
    answers.append(BOUNDS)
    claim = TrackingProof(task=TASK, sampled_loop=HELD, claims=claims_of(F(1, 3)), varying_gain=SLOW)
    assert claim.theorem_bounds() is BOUNDS
    spread = SLOW.spread(TASK, F(1, 3))
    assert questions == [(TASK, {key: 2 * v for key, v in GAINS.items()}, None, F(1, 10), HELD.noise, spread, F(0))]


@pytest.mark.parametrize(
    ("slow", "claimed", "verdict"),
    [
        (SLOW, F(1, 2) + F(1, 10**9), Verdict.PROVED),
        (SLOW, F(1, 2), Verdict.UNDECIDED),
        (SLOW, F(1, 2) - F(1, 10**9), Verdict.UNDECIDED),
        (None, F(1, 2), Verdict.PROVED),
    ],
)
def test_the_claim_on_which_the_spread_rests_exceeds_the_bound(asked, monkeypatch, slow, claimed, verdict):
    asked[0].append(BOUNDS)
    monkeypatch.setattr(statement, "certified_bounds", lambda *_: BOUNDS)
    assert TrackingProof(task=TASK, sampled_loop=HELD, claims=claims_of(claimed), varying_gain=slow).check() is verdict
    assert len(asked[1]) == (slow is not None)


def upward(value):
    """Four digits, upward."""
    context = Context(prec=4, rounding=ROUND_CEILING)
    return F(context.divide(context.create_decimal(1) * value.numerator, value.denominator))


@pytest.mark.parametrize("found", [["0.5", "0.5005"], ["0.5", "0.75", "0.875", "0.87"], ["0"]])
def test_claims_are_those_that_their_own_spread_gives(asked, found):
    """Claims are a thousandth wider, and so is what is tried next; the first ones end at the slip error itself."""
    answers, questions = asked
    answers.extend(replace(BOUNDS, slip_error=F(v)) for v in found)
    claims = [upward(F(v) * F(1001, 1000)) for v in found]
    result = guarantee(TASK, HELD, SLOW)
    tried = [F(0), *(upward(v * F(1001, 1000)) for v in claims[:-1])]
    assert all(v > slip for v, slip in zip(claims[:-1], tried, strict=False))
    assert claims[-1] <= tried[-1]
    assert [given[5] for given in questions] == [SLOW.spread(TASK, slip) for slip in tried]
    assert result == TrackingProof(
        task=TASK, sampled_loop=HELD, varying_gain=SLOW,
        claims=replace(Claims.of(TASK, BOUNDS).rounded(), slip_error=UpperBound(claims[-1])),
    )  # fmt: skip


def test_claims_that_never_follow_from_themselves_are_left_after_48_turns(asked):
    asked[0].extend(replace(BOUNDS, slip_error=F(2) ** k) for k in range(99))
    found = guarantee(TASK, HELD, SLOW)
    assert (len(asked[1]), found.small_gain) == (48, None)
    tried = "none of the slip errors tried, up to 7e+13 m"  # 2^46 and 0.2 % is the last
    assert found.reason == f"{tried}, bounds the change of the input gain"


def test_no_bounds_are_no_claims(asked):
    asked[0].append(NONE)
    assert guarantee(TASK, HELD, SLOW) is NONE


def test_loops_that_are_not_stable_have_no_bounds(asked, monkeypatch):
    def refuse(_):
        raise ParameterError("not stable.")

    monkeypatch.setattr(module, "norms", refuse)
    claim = TrackingProof(task=TASK, sampled_loop=HELD, claims=claims_of(F(1)), varying_gain=SLOW)
    for found in (claim.theorem_bounds(), guarantee(TASK, HELD, SLOW)):
        assert (
            found.reason == "with zero-order hold over 0.1 s even the nominal loop is not stable, or decays too slowly"
        )
    assert (claim.check(), asked[1]) == (Verdict.UNDECIDED, [])


def test_the_file_names_a_slow_gain_where_there_is_one():
    claim = TrackingProof(task=TASK, sampled_loop=HELD, claims=claims_of(F(1)))
    assert "slow_gain" not in json.loads(guarantee_text(claim))
    written = json.loads(guarantee_text(replace(claim, varying_gain=SLOW)))
    assert written["slow_gain"] == {"parts": 2, "growth": "1/9"}
