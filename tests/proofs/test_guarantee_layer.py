"""A well behind rock in both checkers: the same gains of the same loop, and claims that are refused by both."""

import json
from dataclasses import replace
from fractions import Fraction as F
from functools import cache

import pytest
from standalone_guarantee import checker
from thinned import few

from quakedesign.fault import load_fault
from quakedesign.guarantees import SampledLoop, TrackingProof, VaryingGain, guarantee
from quakedesign.guarantees.exact.guarantee_files import guarantee_text, parse_guarantee
from quakedesign.guarantees.exact.norms import norms
from quakedesign.guarantees.exact.small_gain import grown
from quakedesign.guarantees.search.float_bounds import gains_of
from quakedesign.laws import ErrorModel, disturbance_estimate
from quakedesign.lyapunov.exact.claim import Verdict
from quakedesign.plant import uncertain_plant

STEP = F("0.184")
TASK = uncertain_plant(load_fault("real-fault"))
LAW = disturbance_estimate(
    (F("3.9e8"), F("1.5e8")),
    F("0.1"),
    ErrorModel.delayed(((F(1), F(0)), (F("0.07"), F("0.752"))), ((F(0), F("0.16")),), F("2.282e-8")),
)
HELD = SampledLoop(law=LAW, step=STEP, diffusion=F("0.1"))
OUTPUTS = ("slip_error", "slip_rate_error", "push", "left_out", "asked")
ORDER = ("acceleration", "drift", "left_out", "awaited", "awaited_told")


@cache
def claim():
    return guarantee(TASK, HELD, VaryingGain(parts=2, growth=F(1, 4)))


def document(held=None):
    one = claim() if held is None else TrackingProof(task=TASK, sampled_loop=held, claims=claim().claims)
    return json.loads(guarantee_text(one))


@few("around", [{"delay": F("0.03")}, {"lag": F("0.02")}], ids=["delay", "lag"], every=2)
def test_both_find_the_same_gains_through_rock(around):
    held = replace(HELD, **around)
    ours = norms(held.loop(TASK))
    estimated = gains_of(held.loop(TASK))
    assert max(estimated["slip_rate_error", "awaited"]) == pytest.approx(
        float(max(ours["slip_rate_error", "awaited"])), rel=0.02
    )
    read = checker.read_task(document())
    theirs = checker.loop_gains(checker.read_loop(document(held)["loop"], read), sum(read.beta) / 2)
    names = [name for name in ORDER if (OUTPUTS[0], name) in ours]
    assert len(names) == len(theirs) == len(ours) / len(OUTPUTS) == 5 - ("lag" in around)
    for name, lines in zip(names, theirs, strict=True):
        for output, line in zip(OUTPUTS, lines, strict=True):
            assert [float(v) for v in line] == pytest.approx([float(v) for v in ours[output, name]], rel=1e-6)


def test_both_have_the_same_loop_in_every_part_of_a_slow_gain(monkeypatch):
    """The one that is asked for the gains of what is past, and all others: matrices, in rationals."""
    asked, raw = [], document()
    monkeypatch.setattr(checker, "gains", lambda loop, *_: asked.append((loop.flow, loop.events)) or [[F(1)]] * 4)
    task = checker.read_task(raw)
    checker.slow_gains(task, checker.read_loop(raw["loop"], task), checker.Slow(2, F(1, 4)))
    ours = []
    for model in claim().varying_gain.models(TASK):
        loop = HELD.loop(TASK, model)
        ours += [*[loop] * 5, grown(loop, F(1, 4))]
    expected = [
        ([list(v) for v in one.flow], [([list(v) for v in part.jump], part.duration) for part in one.segments])
        for one in ours
    ]
    assert asked == expected


@pytest.mark.slow
def test_both_prove_a_loop_through_rock_and_refuse_what_does_not_follow(monkeypatch):
    """Gains are found once for all claims: they depend on none."""
    kept, find = [], checker.slow_gains
    monkeypatch.setattr(checker, "slow_gains", lambda *given: kept[0] if kept else find(*given))
    raw = document()
    kept.append(find(task := checker.read_task(raw), checker.read_loop(raw["loop"], task), checker.Slow(2, F(1, 4))))
    assert claim().check() is Verdict.PROVED
    assert "diffusion path of distance^2/diffusivity = 1/10 s" in checker.verify(raw)[2]
    for key in raw["claims"]:
        forged = document()
        forged["claims"][key] = str(F(raw["claims"][key]) * F(99, 100))
        with pytest.raises(checker.Refused, match=rf"the claim {key} must follow|must stay below its claim"):
            checker.verify(forged)
        assert parse_guarantee(json.dumps(forged)).check() is Verdict.UNDECIDED


@pytest.mark.slow
def test_a_well_that_is_farther_away_than_the_proof_says_is_refused_by_both():
    raw = document()
    raw["loop"]["diffusion"] = "3/10"
    with pytest.raises(checker.Refused, match=r"the small gain must be below 1|claim"):
        checker.verify(raw)
    assert parse_guarantee(json.dumps(raw)).check() is Verdict.UNDECIDED
