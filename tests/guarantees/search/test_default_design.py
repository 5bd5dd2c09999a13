"""The default e-LQR: for the fault's own T_s, for a shorter one where that is too long, and how far designs reach."""

import importlib.util
from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import pytest

import quakedesign as qd
from quakedesign.cli.design_commands import positive
from quakedesign.errors import ParameterError
from quakedesign.exact import UpperBound
from quakedesign.fault import Disturbance, load_fault
from quakedesign.guarantees import NoProof, TrackingProof, design_sampled_law, guarantee
from quakedesign.guarantees.search.linear_design import reached
from quakedesign.lyapunov import Verdict
from quakedesign.plant import uncertain_plant
from quakedesign.report import page as account
from quakedesign.report import sentences as headlines
from quakedesign.report.sentences import grade
from quakedesign.synthesis import assess

REAL, LAB = load_fault("real-fault"), load_fault("lab-fault")
SLOW = load_fault(Path(__file__).parents[2] / "data" / "undersampled_fault.toml")

SPECIFICATION = importlib.util.spec_from_file_location("attacker", Path(__file__).with_name("attacker.py"))
attacker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(attacker)


@cache
def designed(name):
    return qd.design({"real": REAL, "slow": SLOW}[name], "elqr", plant="printed")


@pytest.fixture
def unreached(monkeypatch):
    """Without how far other designs would go, which is another test's."""
    designed("real")  # cached with it
    for name in ("longest_step", "longest_delay"):
        monkeypatch.setattr(f"quakedesign.guarantees.search.default_designs.{name}", lambda *_, **__: None)


def premises(design):
    return {p.name: p for p in design.premises}


@pytest.mark.slow
def test_the_default_of_the_real_fault_is_guaranteed_as_asked_for():
    design = designed("real")
    found = design.guarantee
    assert (design.verdict, found.check()) == (Verdict.PROVED, Verdict.PROVED)
    assert design.certificate is None
    assert design.controller.step == found.sampled_loop.step == F("0.184")
    assert design.controller.rest_limit == found.rest_limit
    assert found.rest_limit is not None
    assert found.claims.slip_rate_error < F(3, 10**4)
    assert all(p.holds for p in design.premises)
    assert premises(design)["sampling_time"].certified >= F("0.88")  # 0.98 s is the longest that long searches proved
    assert premises(design)["delay"].certified >= F("0.5")


@pytest.mark.slow
def test_a_law_has_one_bound_however_it_is_asked_for(monkeypatch):
    found = designed("real").guarantee
    assert found.varying_gain is not None
    assert found.claims.slip_rate_error < guarantee(found.task, found.sampled_loop).claims.slip_rate_error * F(3, 4)
    monkeypatch.setattr("quakedesign.guarantees.tracking_result.worst_tracking", lambda *_, **__: None)
    proved = qd.guarantee(REAL, plant="printed").proof
    assert proved == assess(REAL, designed("real").controller).guarantee == found


@pytest.mark.slow
def test_both_objectives_are_what_they_are_called(unreached):
    laws = [qd.design(REAL, "elqr", objective=name, plant="printed") for name in ("peak", "tracking")]
    peak, tracking = (law.guarantee.claims for law in laws)
    assert peak.slip_rate_error < tracking.slip_rate_error
    assert peak.slip_rate_error <= F(2, 10**4)
    with pytest.raises(ParameterError, match="tracking, peak"):
        qd.design(REAL, "elqr", objective="speed")


@pytest.mark.slow
def test_a_fault_sampled_too_slowly_gets_a_design_for_the_longest_step_that_works(monkeypatch):
    design = designed("slow")
    assert not isinstance(design_sampled_law(uncertain_plant(SLOW), F(1, 10)), TrackingProof)
    step = design.controller.step
    assert F(2, 100) < step < F(1, 10)
    assert design.guarantee.check() is Verdict.PROVED
    assert "even the nominal loop is not stable" in design.details["reason"]
    found = premises(design)["sampling_time"]
    assert (found.holds, found.certified) == (False, step)
    assert design.other_step == f"NOT for the fault's T_s = 0.1 s: it the law runs every {float(step):.4g} s"
    said = f"not guaranteed at T_s = 0.1 s; designed for T_s = {float(step):.4g} s"
    assert f": {said}: proved; gains" in repr(design)
    assert f": {said}: proved</b>" in design._repr_html_()
    entry = SimpleNamespace(design=design, proof=design.guarantee)
    assert grade(entry).startswith(f"{said}; guaranteed: slip rate <= ")
    assert "fails" not in grade(entry)
    assert not positive(SimpleNamespace(of=lambda _: (SimpleNamespace(design=design, run=None),)))
    proved = SimpleNamespace(proved=True, lines=lambda: ["proved: it"], limit_lines=list)
    first = SimpleNamespace(design=design, guarantee=proved)
    assert headlines.guarantee_lines(first)[0] == f"{said}: {design.details['reason']}"
    assert designed("real").other_step == ""
    said = headlines.limit_lines(SimpleNamespace(design=design, guarantee=SimpleNamespace(limit_lines=list)))[0]
    assert f"T_s up to at least {float(step):.3g} s, and at T_s = {float(step):.6g} s for delays up to at least" in said
    late = replace(premises(design)["delay"], certified=F(0))
    without = SimpleNamespace(design=design.with_premise(late), guarantee=SimpleNamespace(limit_lines=list))
    assert headlines.limit_lines(without)[0].endswith(" s no guarantee was found with a delay")
    assert late.sides == ("0 s", "0 s")
    assert account.badge(entry) == "not guaranteed at T_s = 0.1 s"
    real = SimpleNamespace(design=designed("real"), proof=designed("real").guarantee)
    assert account.badge(real) == "guaranteed for the sampled loop"
    assert grade(real).startswith("guaranteed: slip rate <= ")
    # the same law held over the fault's own T_s has none
    assert (
        guarantee(uncertain_plant(SLOW), replace(design.guarantee.sampled_loop, step=F(1, 10))).check()
        is Verdict.UNDECIDED
    )


@pytest.mark.slow
@pytest.mark.parametrize("step", ["0.01", pytest.param("0.02", marks=pytest.mark.slow)])
def test_sampled_faster_that_fault_is_guaranteed(step):
    claim = design_sampled_law(uncertain_plant(SLOW), F(step))
    assert claim.check() is Verdict.PROVED
    assert claim.claims.peak_slip_rate < 1e-5  # its natural earthquake: 0.31 m/s


@pytest.mark.slow
def test_an_independent_simulator_does_not_leave_the_guarantee_of_the_shorter_step():
    claim = designed("slow").guarantee
    held = attacker.numbers(claim)
    choose = attacker.slowly(held, 6, attacker.switching(held, 2_000, 240, seed=8))
    largest, _ = attacker.run(held, 40, 6, choose, 2_000)
    assert 0 < largest[0].max() <= claim.claims.slip_error
    assert 0 < largest[1].max() <= claim.claims.slip_rate_error


def test_a_time_that_nothing_holds_is_undecided_with_a_reason(monkeypatch):
    fails = NoProof(reason="small gain 1.2")
    monkeypatch.setattr("quakedesign.guarantees.search.default_designs.design_sampled_law", lambda *_, **__: fails)
    monkeypatch.setattr("quakedesign.guarantees.search.default_designs.longest_step", lambda *_, **__: None)
    design = qd.design(REAL, "elqr", plant="printed")
    assert (design.verdict, design.controller) == (Verdict.UNDECIDED, None)
    assert design.details["reason"] == "small gain 1.2"
    assert design.guarantee.sentence().startswith("none: ")


@pytest.mark.slow
@pytest.mark.parametrize(
    "fault",
    [
        pytest.param(REAL.with_disturbance(Disturbance()), id="quiet", marks=pytest.mark.slow),
        pytest.param(replace(REAL, sampling_time=1e-9), id="sampled fast", marks=pytest.mark.slow),
        pytest.param(replace(REAL, damping=5e16), id="overdamped"),
    ],
)
def test_unusual_faults_are_designed_or_refused_with_a_reason(fault):
    found = design_sampled_law(uncertain_plant(fault), F(repr(fault.sampling_time)))
    if isinstance(found, TrackingProof):
        assert found.check() is Verdict.PROVED
    else:
        assert found.reason


def searched(longest, first, most=None):
    """Times that are tried where a design has a guarantee up to a longest one, and the last that has."""
    asked = []
    claim = designed("real").guarantee

    def attempt(time):
        asked.append(time)
        if time > longest:
            return NoProof(reason="too long")
        return replace(claim, sampled_loop=replace(claim.sampled_loop, step=time))

    found = reached(attempt, first, most=most)
    return asked, found[-1].sampled_loop.step if found else None


@pytest.mark.slow
@pytest.mark.parametrize("first", ["40", "1", "1/10"])
def test_the_longest_time_is_found_within_a_sixteenth(first):
    asked, found = searched(F(3), F(first))
    assert F(15, 16) * 3 <= found <= 3
    assert len(asked) <= 12


def test_no_longer_time_than_allowed_is_tried():
    asked, found = searched(F(100), F(1), most=F(7))
    assert asked == [1, 2, 4, 7]
    assert found == 7
    assert searched(F(0), F(1)) == ([F(1, 2**n) for n in range(12)], None)


@pytest.mark.parametrize(("small_gains", "tried"), [((6, 5.9), 2), ((6, 4, 3.9), 3), ((None, 6, 3), 5), ((3, 0), 5)])
def test_times_that_bring_a_loop_no_nearer_to_a_guarantee_are_not_halved_on(small_gains, tried):
    told, asked = iter((*small_gains, *[None] * 5)), []

    def attempt(time):
        asked.append(time)
        gain = next(told)
        return NoProof(reason="too long", small_gain=None if gain is None else UpperBound(F(gain)))

    assert reached(attempt, F(1), attempts=5) == ()
    assert asked == [F(1, 2**n) for n in range(tried)]
