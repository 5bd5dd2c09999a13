"""On which plant a design and a guarantee are proved: the stick-slip plant where possible, else that without stick."""

import pickle
from dataclasses import replace
from fractions import Fraction as F
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import pytest

import quakedesign as qd
from quakedesign.guarantees import NoProof, StickSlipGuarantee, TrackingGuarantee, guarantee_of, load_guarantee
from quakedesign.guarantees.exact.sampled_loop import ExactSetup
from quakedesign.guarantees.search import compensated_search as COMPENSATED
from quakedesign.guarantees.search.compensated_search import recovered, sorted_terms, sticking_loop
from quakedesign.guarantees.search.stick_slip_design import design_stick_slip
from quakedesign.laws import StickSlipController, control_law
from quakedesign.plant import uncertain_plant
from quakedesign.report.sentences import sentences
from quakedesign.report.summary import _first_sentence
from quakedesign.studies.comparison import Entry

PROOFS = Path(__file__).parents[2] / "proofs" / "certificates"
REAL = qd.load_fault("real-fault")
GUARANTEE, FEEDBACK, SLIDING = (
    import_module(f"quakedesign.synthesis.{name}") for name in ("guarantee", "state_feedback", "sliding_mode_design")
)
ANSWER = import_module("quakedesign.guarantees.stick_slip_result")
NONE = NoProof(reason="no polytope")


@pytest.fixture(scope="module")
def sticking():
    return load_guarantee(PROOFS / "stick_slip_real-fault.json")


@pytest.fixture(scope="module")
def plain():
    return load_guarantee(PROOFS / "guarantee_real-fault.json")


def test_a_design_is_that_of_the_stick_slip_plant_where_it_is_proved(monkeypatch, sticking):
    monkeypatch.setattr(FEEDBACK, "design_stick_slip", lambda *_, **__: sticking)
    monkeypatch.setattr(FEEDBACK, "sampled_design", None)  # not searched as well
    design = qd.design(REAL, "elqr")
    assert str(design.verdict) == "proved"
    assert design.guarantee is sticking
    assert isinstance(design.controller, StickSlipController)
    assert design.premises == design.conditions == ()
    assert (design.details["reason"], design.compensation) == (None, None)


def test_a_design_without_that_proof_falls_back_and_says_why(monkeypatch, plain):
    monkeypatch.setattr(FEEDBACK, "design_stick_slip", lambda *_, **__: NONE)
    sampled = SimpleNamespace(runs=plain, reason="", premises=tuple)
    monkeypatch.setattr(FEEDBACK, "sampled_design", lambda *_, **__: sampled)
    design = qd.design(REAL, "elqr")
    assert design.guarantee is plain
    assert design.details["not_at_rest"] == "no polytope"
    assert design.guarantee.sentence().startswith("on the plant without stick, from rest")


@pytest.mark.parametrize(
    "asked",
    [
        {"plant": "printed"},
        {"delay": "20 ms"},
        {"rate_noise": "1 um/s"},
        {"disturbance_class": "rate"},
        {"measured": "slip"},
    ],
    ids=str,
)
def test_loops_that_the_theorem_does_not_know_are_proved_without_stick(monkeypatch, plain, asked):
    monkeypatch.setattr(FEEDBACK, "design_stick_slip", None)
    monkeypatch.setattr(GUARANTEE, "guarantee_stick_slip", None)
    sampled = SimpleNamespace(runs=plain, reason="", premises=tuple)
    monkeypatch.setattr(FEEDBACK, "sampled_design", lambda *_, **__: sampled)
    monkeypatch.setattr(FEEDBACK, "design_sampled_law", lambda *_, **__: plain)
    monkeypatch.setattr(FEEDBACK, "with_worst_case", lambda fault, found: SimpleNamespace(proof=found, proved=True))
    assert qd.design(REAL, "elqr", **asked).guarantee is plain
    assert qd.guarantee(REAL, **asked).proof is plain


def test_a_design_hands_down_what_the_theorem_takes(monkeypatch, sticking):
    seen = {}
    monkeypatch.setattr(FEEDBACK, "design_stick_slip", lambda task, step, **given: seen.update(given) or sticking)
    healed = replace(REAL, friction=replace(REAL.friction, healing=1e-5))
    qd.design(healed, "elqr", objective="peak", slip_noise="1 um")
    assert seen.pop("progress")
    assert seen == {"objective": "peak", "slip_noise": F(1, 10**6), "longest_step": 0, "healing": F(1, 10**5)}


def test_a_guarantee_hands_down_what_the_theorem_takes(monkeypatch, sticking):
    seen, answer = {}, StickSlipGuarantee(fault=REAL, proof=sticking)
    monkeypatch.setattr(GUARANTEE, "guarantee_stick_slip", lambda fault, setup, **given: seen.update(given) or answer)
    assert qd.guarantee(REAL, objective="peak", progress=print) is answer
    assert seen == {"objective": "peak", "sliding": None, "progress": print}


def test_a_sliding_mode_is_guaranteed_on_the_stick_slip_plant_with_its_base_gains(monkeypatch, sticking):
    seen, answer = [], StickSlipGuarantee(fault=REAL, proof=sticking)
    monkeypatch.setattr(GUARANTEE, "guarantee_stick_slip", lambda *_, sliding, **__: seen.append(sliding) or answer)
    monkeypatch.setattr(GUARANTEE, "_sampled", None)
    asked = [{}, {"gains": ("7", "6", "2.3", "1.1")}, {"scheme": "stick-slip"}, {"plant": "stick-slip"}]
    assert all(qd.guarantee(REAL, "cta", **given) is answer for given in asked)
    assert [float(law.gains["k2"]) for law in seen] == [5, 6, 5, 5]
    assert {law.divisor for law in seen} == {F(2353, 125 * 10**9)}


@pytest.mark.parametrize(
    "asked", [{"plant": "printed"}, {"scheme": "compensated"}, {"rate_noise": "1 um/s"}, {"disturbance_class": "rate"}]
)
def test_a_sliding_mode_is_guaranteed_without_stick_where_that_is_asked_for(monkeypatch, asked):
    monkeypatch.setattr(GUARANTEE, "guarantee_stick_slip", None)
    monkeypatch.setattr(GUARANTEE, "_sampled", lambda *_: NONE)
    assert qd.guarantee(REAL, "cta", **asked) is NONE


def test_the_scheme_for_friction_that_sticks_has_no_guarantee_without_stick():
    said = qd.guarantee(REAL, "cta", scheme="stick-slip", plant="printed").proof.reason
    assert said.startswith("the disturbance estimate of the scheme stick-slip is limited at rest")


def test_a_sliding_mode_is_designed_on_the_stick_slip_plant_where_it_is_proved(monkeypatch):
    """The linear law's guarantee is stored; λ is that for which the step is deadbeat, and the design checks itself."""
    stored = load_guarantee(PROOFS / "stick_slip_cta_real-fault.json")
    linear = replace(stored, sampled_loop=replace(stored.sampled_loop, law=replace(stored.sampled_loop.law, pull=())))
    monkeypatch.setattr(COMPENSATED, "design_stick_slip", lambda *_, implicit, **__: linear)
    monkeypatch.setattr(SLIDING, "sampled_sliding_mode", None)  # not searched as well
    design = qd.design(REAL, "cta")
    assert str(design.verdict) == "proved"
    assert design.controller.sampling.scheme == "stick-slip"
    assert design.compensation.controller is design.controller
    assert "in the scheme stick-slip with slip weight 0.5, weight 0.3 and B0 = " in design.compensation.sentence()
    assert "its implicit step is deadbeat" in design.compensation.sentence()
    found = design.guarantee.sampled_loop
    assert sorted_terms(found.law.pull) == sorted_terms(stored.sampled_loop.law.pull)
    assert replace(found, law=replace(found.law, pull=())) == linear.sampled_loop
    again = recovered(design.guarantee)
    assert sticking_loop(again.controller).law.target_gain == found.law.target_gain
    assert guarantee_of(uncertain_plant(REAL), design.controller, setup=ExactSetup(rate_noise=F(1))).reason.endswith(
        "do not cover rate_noise: set it to 0"
    )
    without = replace(design.controller.sampling, settings=design.controller.sampling.settings[:2])
    bare = replace(design.controller, gains=dict(design.controller.gains), sampling=without)
    assert "requires rest_slip, slip_weight in its settings" in guarantee_of(uncertain_plant(REAL), bare).reason


def test_the_controller_of_a_result_is_the_sliding_mode_itself():
    """On both plants, read off stored certificates; it has the scheme of its plant."""
    for name, scheme in (("stick_slip_cta", "stick-slip"), ("guarantee_cta", "compensated")):
        found = load_guarantee(PROOFS / f"{name}_real-fault.json")
        kind = StickSlipGuarantee if scheme == "stick-slip" else TrackingGuarantee
        controller = kind(fault=REAL, proof=found, compensation=recovered(found)).controller
        assert (controller.name, controller.sampling.scheme) == ("cta", scheme)


def test_a_sliding_mode_without_that_proof_falls_back_and_says_why(monkeypatch, plain):
    monkeypatch.setattr(COMPENSATED, "design_stick_slip", lambda *_, **__: NONE)
    made = SimpleNamespace(controller=control_law("cta").base_gains()[0].law, limited=None)
    made.limited = made.controller
    sampled = SimpleNamespace(runs=plain, reason="", premises=tuple)
    monkeypatch.setattr(SLIDING, "sampled_sliding_mode", lambda *_, **__: (made, sampled))
    design = qd.design(REAL, "cta")
    assert design.guarantee is plain
    assert design.details["not_at_rest"] == "no polytope"


def test_where_no_scale_makes_the_step_deadbeat_there_is_no_guarantee(monkeypatch):
    stored = load_guarantee(PROOFS / "stick_slip_cta_real-fault.json")
    linear = replace(stored, sampled_loop=replace(stored.sampled_loop, law=replace(stored.sampled_loop.law, pull=())))
    monkeypatch.setattr(COMPENSATED, "design_stick_slip", lambda *_, **__: linear)
    # nearly deadbeat is not enough
    monkeypatch.setattr(COMPENSATED, "sector_is_valid", lambda step, *_: step.slopes[0] < 1)
    base = control_law("cta").base_gains()[0].law.with_divisor(stored.task.authority)
    found = COMPENSATED.design_sticking(stored.task, base, stored.sampled_loop.step)
    assert found.reason == "the implicit step is not deadbeat for any tried scale λ"


@pytest.mark.parametrize(
    "given",
    [{"gains": (1, 1, 1, 1)}, {"scheme": "compensated"}],
    ids=lambda given: next(iter(given)),
)
def test_other_laws_are_guaranteed_without_stick(monkeypatch, given):
    monkeypatch.setattr(GUARANTEE, "guarantee_stick_slip", None)
    monkeypatch.setattr(GUARANTEE, "_sampled", lambda *_: NONE)
    assert qd.guarantee(REAL, **given) is NONE


def test_a_guarantee_takes_the_first_that_is_proved(monkeypatch, sticking, plain):
    answer = StickSlipGuarantee(fault=REAL, proof=sticking)
    monkeypatch.setattr(GUARANTEE, "guarantee_stick_slip", lambda *_, **__: answer)
    assert qd.guarantee(REAL) is answer
    assert answer.lines()[-1].startswith(
        "no controller with zero-order hold over T_s = 0.184 s keeps the slip rate below 1"
    )
    monkeypatch.setattr(GUARANTEE, "guarantee_stick_slip", lambda *_, **__: replace(answer, proof=NONE))
    monkeypatch.setattr(FEEDBACK, "design_sampled_law", lambda *_, **__: plain)
    monkeypatch.setattr(FEEDBACK, "with_worst_case", lambda fault, found: TrackingGuarantee(fault=fault, proof=found))
    found = qd.guarantee(REAL)
    assert found.proof is plain
    assert "not proved on the stick-slip plant: no polytope" in found.lines()
    assert found.to_dict()["stick_slip"] == "no polytope"
    assert not qd.guarantee(REAL, plant="stick-slip").proved


def test_what_is_said_of_a_run_names_the_plant_of_its_proof(monkeypatch, sticking):
    monkeypatch.setattr(FEEDBACK, "design_stick_slip", lambda *_, **__: sticking)
    design = qd.design(REAL, "elqr")
    for plant, said in (
        ("stick-slip", "for the loop that ran"),
        ("printed", "for this sampled loop on the stick-slip"),
    ):
        run = qd.simulate(REAL, design.controller, duration=20.0, plant=plant)
        told = sentences(Entry(label="e-LQR", origin="designed", design=design, run=run))
        assert any(said in sentence for sentence in told)


def test_the_answer_of_a_summary_names_the_plant(sticking, plain):
    natural = SimpleNamespace(outcome=SimpleNamespace(peak_slip_rate=0.0, kind="at rest"))
    compared = SimpleNamespace(uncontrolled=natural, fault=REAL)

    def said(found):
        best = SimpleNamespace(proof=found, label="e-LQR", design=SimpleNamespace(other_step_first=""))
        return _first_sentence(compared, best)

    assert "guaranteed. With the e-LQR the slip rate never" in said(sticking)
    assert "m/s, whether the fault slides or sticks, and" in said(sticking)
    assert "On the plant without stick, with the e-LQR, the slip rate" in said(plain)
    assert "sticks" not in said(plain)


def test_a_guarantee_for_aperiodic_sampling_is_searched_on_the_stick_slip_plant(monkeypatch):
    given = []
    monkeypatch.setattr(ANSWER, "design_stick_slip", lambda task, step, **wanted: given.append((step, wanted)) or NONE)
    monkeypatch.setattr(GUARANTEE, "_sampled", lambda *_: TrackingGuarantee(fault=REAL, proof=NONE))
    found = qd.guarantee(REAL, step="92 ms", longest_step="184 ms")
    ((step, wanted),) = given
    assert (step, wanted["longest_step"], found.not_at_rest) == (F("0.092"), F("0.184"), "no polytope")


def test_a_sliding_mode_has_no_aperiodic_proof_on_the_stick_slip_plant():
    task, longest = uncertain_plant(REAL), F("0.184")
    found = design_stick_slip(task, F("0.092"), longest_step=longest, implicit=True)
    assert found.reason == "a sliding mode on the stick-slip plant is proved for periodic sampling alone"


def test_an_aperiodic_guarantee_states_its_range_and_the_limit_at_its_longest_interval():
    found = load_guarantee(PROOFS / "stick_slip_aperiodic_real-fault.json")
    answer = StickSlipGuarantee(fault=REAL, proof=found)
    assert "zero-order hold over sampling intervals from 0.092 s to 0.184 s in any order" in answer.lines()[0]
    assert (
        "no controller with zero-order hold over T_s = 0.184 s keeps the slip rate below 101 µm/s" in answer.lines()[-1]
    )
    facts = answer.to_dict()
    assert (facts["step"], facts["longest_step"]) == ("23/250", "23/125")
    law = pickle.loads(pickle.dumps(found.controller))
    assert (law.sampling.step, law.sampling.longest) == (F("0.092"), F("0.184"))
    periodic = load_guarantee(PROOFS / "stick_slip_real-fault.json")
    assert "longest_step" not in StickSlipGuarantee(fault=REAL, proof=periodic).to_dict()
