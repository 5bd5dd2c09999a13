"""Files of the kind stick_slip in both checkers: what is proved, what is refused, and numbers that both derive."""

import json
from fractions import Fraction as F
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from standalone_guarantee import CHECK
from stick_slip_box import CLAIMS, STICK, box, changed, package_refuses, period_of, refused, times

from quakedesign.checking import check_files
from quakedesign.errors import CertificateError, ParameterError
from quakedesign.guarantees import read_guarantee
from quakedesign.guarantees.exact import stick_slip_set as package
from quakedesign.guarantees.exact.guarantee_files import guarantee_text
from quakedesign.lyapunov.exact.claim import Verdict

PATH = Path(__file__).parents[2] / "proofs" / "certificates" / "stick_slip_real-fault.json"
APERIODIC = PATH.with_name("stick_slip_aperiodic_real-fault.json")


@cache
def stored():
    return json.loads(PATH.read_text())


def test_the_sentence_gives_the_disturbance_as_a_shear_stress():
    """0.00032 m/s^2 times the mass per area of 2500 kg/m^3 and 5 km is 4 kPa."""
    assert "0.00032 m/s^2 (4 kPa of shear)" in read_guarantee(stored()).sentence()


@pytest.mark.slow
def test_both_prove_the_file_with_noise_and_refuse_more_of_it():
    path = PATH.with_name("stick_slip_noise_real-fault.json")
    found, document = CHECK.check(path.read_text()), json.loads(path.read_text())
    assert found.verdict == "proved"
    said = "\n".join(found.statement)
    assert "slip measured within 1e-06 m, slip rate exactly" in said
    assert "never exceeds 0.0001864 m/s" in said
    looser = [(("claims", name), times("2")) for name in CLAIMS]
    more = changed(document, *((("loop", name), times("3/2")) for name in ("slip_noise", "rest_slip")), *looser)
    assert refused(more, "facet")
    assert package_refuses(more)
    other = changed(document, (("loop", "rest_slip"), times("11/10")))  # another law, which is told to be another
    assert CHECK.check(json.dumps(other)).statement != found.statement
    for name in CLAIMS:
        assert refused(changed(document, (("claims", name), times("99/100"))), f"claim {name} must follow")


@pytest.mark.slow
def test_both_prove_the_aperiodic_file_and_no_wider_range():
    found, document = CHECK.check(APERIODIC.read_text()), json.loads(APERIODIC.read_text())
    claim = read_guarantee(document)
    assert found.verdict == "proved"
    assert claim.check() is Verdict.PROVED
    said = "\n".join(found.statement)
    assert "every 23/250 s to 23/125 s in any order, with zero-order hold" in said
    assert "never exceeds 0.0001853 m/s" in said
    assert "over sampling intervals from 0.092 s to 0.184 s in any order and exact" in claim.sentence()
    looser = [(("claims", name), times("2")) for name in CLAIMS]
    for wider in ((("loop", "longest"), times("6/5")), (("loop", "step"), times("3/4"))):
        assert refused(changed(document, wider, *looser), "facet")
        assert package_refuses(changed(document, wider, *looser))
    narrow = changed(document, (("loop", "longest"), times("9/10")))
    assert "23/250 s to 207/1250 s in any order" in "\n".join(CHECK.check(json.dumps(narrow)).statement)
    assert read_guarantee(narrow).check() is Verdict.PROVED
    for name in CLAIMS:
        assert refused(changed(document, (("claims", name), times("99/100"))), f"claim {name} must follow")


@pytest.mark.parametrize("longest", ["0", "-1/5", "23/250", "1/20", "0.2", "inf", None, "30"], ids=str)
def test_a_longest_interval_that_is_none_is_refused(longest):
    document = json.loads(APERIODIC.read_text())
    document["loop"]["longest"] = longest
    assert refused(document)
    assert package_refuses(document)
    if longest in ("-1/5", "23/250", "1/20"):
        assert refused(document, "longest must be above step")
        with pytest.raises(CertificateError, match="must be 0 or above T_s"):
            read_guarantee(document)


@pytest.mark.parametrize("which", range(5))
def test_both_ask_for_every_facet_at_each_interval_that_decides(which, monkeypatch):
    """A slide breaks facet 3 over one of the five intervals alone."""
    document = json.loads(APERIODIC.read_text())
    ours, claim = period_of(document), read_guarantee(document)
    beyond = F(23, 250) * (1 + F(which, 4))
    zeros = [F(0)] * 3

    def sliding(facet, *_):
        high = ours.interval == beyond and facet is ours.reach.facets[3]
        yield 0, STICK.Function(zeros, F(3, 2) if high else F(1, 2), [STICK.NOTHING] * 3)

    monkeypatch.setattr(ours, "sliding", sliding)
    with pytest.raises(CHECK.Refused, match="facet 3 must hold after a sliding period"):
        ours.verify()

    def rows(period, *_):
        factors, high = package._exact_array([zeros]), period.interval == beyond
        yield package.Rows(0, np.array([3]), factors, package._exact_array([F(3, 2) if high else F(1, 2)]))

    monkeypatch.setattr(package, "sliding_rows", rows)
    monkeypatch.setattr(package, "resting_rows", lambda *_: iter(()))
    with pytest.raises(ParameterError, match="facet 3 in a period that slides"):
        package.stick_slip_bounds(claim.task, claim.sampled_loop, claim.invariant_set)


def test_a_sliding_mode_has_no_range_of_intervals():
    document = json.loads(PATH.with_name("stick_slip_cta_real-fault.json").read_text())
    document["loop"]["longest"] = "1/5"
    assert refused(document, "sampled periodically")
    with pytest.raises(CertificateError, match="0 for a sliding mode"):
        read_guarantee(document)


@pytest.mark.slow
def test_both_prove_the_stored_file_and_say_the_same_entries():
    found = CHECK.check(PATH.read_text())
    claim = read_guarantee(stored())
    assert found.verdict == "proved"
    assert claim.check() is Verdict.PROVED
    said = "\n".join(found.statement)
    for part in (
        'fault "real-fault" (a name',
        "friction any function of the slip alone within its bounds and slopes, whether the fault slides or sticks",
        "every 23/125 s",
        "any acceleration of at most 0.00032 m/s^2; from rest, along the reference, for all t >= 0",
        "never exceeds 0.0001607 m/s",
        "at most 1.91e-05 m behind and 3.458e-05 m ahead of the reference",
        "pressure from -1.427e+07 Pa to 1.408e+07 Pa",
    ):
        assert part in said


@pytest.mark.parametrize("path", [PATH, APERIODIC], ids=["periodic", "aperiodic"])
def test_both_derive_the_same_ranges(path, monkeypatch):
    document = json.loads(path.read_text())
    ours, claim = period_of(document), read_guarantee(document)
    known, ranges = [], package.ranges
    monkeypatch.setattr(package, "ranges", lambda *given: known.append(given) or ranges(*given))
    monkeypatch.setattr(package, "facet_rows", lambda *_: iter(()))
    proved = package.stick_slip_bounds(claim.task, claim.sampled_loop, claim.invariant_set)
    (given,) = known
    found, push = ranges(*given), given[2]
    assert [float(v) for v in ours.push] == pytest.approx([float(v) for v in push], rel=1e-12)
    for mine, theirs in (
        (ours.slope, found.slope),
        (ours.damping, found.damping),
        (ours.chord, found.chord),
        (ours.rest, found.rest_pressure),
    ):
        assert [float(v) for v in mine] == pytest.approx([float(v) for v in theirs], rel=1e-12)
    theirs = package.stop_bounds(claim.task, claim.sampled_loop, replace_ranges(found, ours))
    assert theirs == tuple(ours.stops())
    for name, value in ours.bounds().items():
        assert float(getattr(proved, name)) == pytest.approx(float(value), rel=1e-12)
    longest = F(document["loop"].get("longest", document["loop"]["step"]))
    fastest, (ahead, rate, _, behind, _) = (
        F("15/8") * F("0.785") / 663012,
        claim.invariant_set.box,
    )  # of 10 t³ - 15 t⁴ + 6 t⁵
    assert given[1] == ahead + fastest * longest
    assert given[3] == rate * longest
    assert (proved.slip_ahead, proved.slip_behind) == (ahead + fastest * longest, behind + fastest * longest)


def replace_ranges(found, ours):
    """Those of the other checker, so that what follows from them is the same rational number."""
    return package.Ranges(slope=ours.slope, damping=ours.damping, chord=ours.chord, rest_pressure=found.rest_pressure)


@pytest.mark.parametrize("name", CLAIMS)
def test_a_claim_one_per_cent_smaller_is_refused(name):
    assert refused(changed(stored(), (("claims", name), times("99/100"))), f"claim {name} must follow")


@pytest.mark.slow
def test_the_package_refuses_such_claims_too():
    bounds = read_guarantee(stored()).theorem_bounds()
    for name in CLAIMS:
        smaller = read_guarantee(changed(stored(), (("claims", name), times("99/100"))))
        assert not smaller.claims.follow(bounds)
    assert read_guarantee(stored()).claims.follow(bounds)


NUMBERS = [
    *((("fault", name),) for name in ("density", "shear_modulus", "length", "damping", "normal_stress")),
    *((("fault", "friction", name),) for name in ("static", "least", "largest", "weakening")),
    *((("reference", name),) for name in ("target_slip", "operation_time")),
    (("disturbance", "amplitude"),),
    (("disturbance", "growths", "slip"),),
    *((("loop", name),) for name in ("step", *STICK.LAW[:-1])),  # rest_slip is 0
]


@cache
def told():
    """What both checkers say of the stored file."""
    ((_, lines),) = check_files([PATH]).values()
    return CHECK.check(PATH.read_text()).statement, lines


@pytest.mark.slow
@pytest.mark.parametrize("share", ["51/50", "49/50"])
@pytest.mark.parametrize("path", [path for (path,) in NUMBERS], ids=lambda path: path[-1])
def test_a_number_two_per_cent_off_is_refused_or_told_by_both(path, share, tmp_path):
    document, (own, packages) = changed(stored(), (path, times(share))), told()
    try:
        assert CHECK.check(json.dumps(document)).statement != own
    except CHECK.Refused:
        pass
    file = tmp_path / "changed.json"
    file.write_text(json.dumps(document))
    ((verdict, lines),) = check_files([file]).values()
    assert verdict != "proved" or lines != packages


FACETS, MULTIPLIERS = ("set", "facets"), ("set", "multipliers")
FORMS = [
    ((("more",), "1"), "the file must have exactly the keys"),
    ((("set", "more"), []), "set must have exactly the keys"),
    ((("loop", "delay"), "0"), "loop must have exactly the keys"),
    ((("claims", "slip_error"), "1"), "claims must have exactly the keys"),
    ((("disturbance", "change"), "1"), "the disturbance must have no key change"),
    (((*FACETS, 0, 1), "1/9"), "first five facets"),
    (((*FACETS, 0), ["-5/2", "0", "0"]), "first five facets"),
    (((*FACETS, 1, 1), "0"), "first five facets"),
    ((FACETS, lambda old: [old[0], *old[2:]]), "first five facets|multipliers must have"),
    ((FACETS, lambda old: old[:4]), "there must be 5 to 400 facets"),
    ((FACETS, lambda old: [*old, *[old[5]] * 400]), "there must be 5 to 400 facets"),
    (((*FACETS, 5), ["1", "1"]), "facets must be a list of 3 rationals"),
    (((*FACETS, 5, 0), "2/4"), "facets must be in lowest terms"),
    (((*FACETS, 5, 0), 1), "facets must be a rational"),
    (((*MULTIPLIERS, 1), ["0"] * 4), "multipliers must be a list of 5 rationals"),
    ((MULTIPLIERS, lambda old: old[1:]), "multipliers must have 11 rows"),
    (((*MULTIPLIERS, 1, 0), "-1/7"), "multipliers must be"),
    (((*MULTIPLIERS, 1, 1), "2"), "multipliers must be"),
    (((*MULTIPLIERS, 1, 3), "1/2"), "multipliers must be"),
    (((*MULTIPLIERS, 2, 4), "2"), "multipliers must be"),
    (((*MULTIPLIERS, 2, 4), "-1/2"), "multipliers must be"),
    ((("set", "sliding", 1), []), "sliding must have bases of every polytope"),
    ((("set", "sliding"), lambda old: old[:2]), "sliding must have 3 lists"),
    ((("set", "resting"), lambda old: [*old, old[0]]), "resting must have 7 lists"),
    ((("set", "resting", 4), []), "resting must have bases of every polytope"),
    ((("set", "sliding", 0, 0), [0, 1]), "must be 3 numbers of constraints"),
    ((("set", "resting", 0, 0), [0, 1, 2]), "must be 4 numbers of constraints"),
    ((("set", "sliding", 0, 0, 0), 13), "must be 3 numbers of constraints"),
    ((("set", "sliding", 1, 0, 0), 14), "must be 3 numbers of constraints"),
    ((("set", "resting", 0, 0, 0), 21), "must be 4 numbers of constraints"),
    ((("set", "resting", 3, 0, 0), 22), "must be 4 numbers of constraints"),
    ((("set", "sliding", 0, 0, 0), "3"), "must be 3 numbers of constraints"),
    ((("set", "sliding", 0, 0, 0), True), "must be 3 numbers of constraints"),
    ((("set", "resting", 0), lambda old: old * 5000), "there must be at most 40000 bases"),
    ((("loop", "step"), "0"), "step, rate, target and return gains must be > 0"),
    ((("loop", "rate_gain"), "0"), "step, rate, target and return gains must be > 0"),
    ((("loop", "target_gain"), "0"), "step, rate, target and return gains must be > 0"),
    ((("loop", "return_rate"), "-1"), "step, rate, target and return gains must be > 0"),
    ((("loop", "level_gain"), "-1"), "level_gain and slip_gain must be >= 0"),
    ((("loop", "slip_gain"), "-1"), "level_gain and slip_gain must be >= 0"),
    ((("loop", "rest_slip"), "-1"), "slip_noise must be from 0 to half of rest_slip"),
    ((("loop",), lambda old: old | {"slip_noise": "51/100", "rest_slip": "1"}), "slip_noise must be from 0"),
    ((("loop",), lambda old: old | {"slip_noise": "-1/9", "rest_slip": "1"}), "slip_noise must be from 0"),
]


@pytest.mark.parametrize(("change", "reason"), FORMS, ids=[reason[:40] for _, reason in FORMS])
def test_a_file_of_another_form_is_refused_by_both(change, reason):
    document = changed(box(), change)
    assert refused(document, reason)
    assert package_refuses(document)


def test_a_bounded_change_of_the_disturbance_is_not_read_as_if_it_counted():
    with pytest.raises(CertificateError, match="not used on the stick-slip plant"):
        read_guarantee(changed(box(), (("disturbance", "change"), "1")))


def test_a_law_without_an_implicit_step_is_written_without_its_terms():
    claim = read_guarantee(box())
    assert not claim.sampled_loop.law.pull
    assert "pull" not in json.loads(guarantee_text(claim))["loop"]


def test_floats_are_refused_by_both():
    text = json.dumps(changed(box(), ((*FACETS, 5, 0), 0.2)))
    with pytest.raises(CHECK.Refused, match="a number must be an integer or a rational in a string"):
        CHECK.check(text)
    with pytest.raises(CertificateError):
        read_guarantee(json.loads(text))


def test_the_largest_numbers_of_a_form_are_read():
    """The last constraint of every polytope, 400 facets, 40 000 bases."""
    last = [12, 13, 12, 20, 20, 21, 21, 21, 20, 20]
    document = box()
    for place, most in enumerate(last):
        bases = document["set"]["sliding"][place] if place < 3 else document["set"]["resting"][place - 3]
        bases.append([most, *bases[0][1:]])
    assert len(STICK.read_reach(document["set"]).facets) == 11
    many = changed(box(), (FACETS, lambda old: [*old, *[old[5]] * 389]), (MULTIPLIERS, lambda old: old[:1] * 400))
    assert len(STICK.read_reach(many["set"]).facets) == 400
    room = 40_000 - sum(map(len, (*box()["set"]["sliding"], *box()["set"]["resting"])))
    full = changed(box(), (("set", "sliding", 0), lambda old: [*old, *old[:1] * room]))
    assert len(STICK.read_reach(full["set"]).sliding[0]) == room + 8


CONDITIONS = [
    ("fault must not open", "the fault may open", (("loop", "target_gain"), "12")),
    ("damping must not be negative", "damping", (("fault", "friction", "rate_slope"), "1/4")),
    ("shear stress must not reverse", "shear stress may reverse", (("disturbance", "amplitude"), "2")),
    ("short against the weakening", "too long for this weakening", (("loop", "step"), "1")),
    ("short against the weakening", "too long for this weakening", (("loop",), lambda old: old | {"longest": "1"})),
    ("short against damping and slope", "too long, for this damping", (("fault", "damping"), "150")),
    ("short against damping and slope", "too long, for this damping", (("fault", "damping"), "400")),
    ("short against damping and slope", "too long, for this damping", (("fault", "damping"), "3000")),
    ("short against damping and slope", "too long, for this damping", (("fault", "damping"), "80")),
    ("short against damping and slope", "too long, for this damping",
     (("fault",), lambda old: old | {"damping": "100", "spreads": old["spreads"] | {"damping": "1/100"}})),
    ("large enough for the condition of rest", "too small for the condition of rest",
     (("disturbance", "amplitude"), "1/90")),
    ("facet 0 must hold after a sliding period", "may leave the polytope", (("loop", "slip_gain"), "3/2")),
]  # fmt: skip


@pytest.mark.parametrize(("reason", "theirs", "change"), CONDITIONS)
def test_what_the_theorem_needs_is_asked_for_by_both(reason, theirs, change):
    document = changed(box(), change)
    assert refused(document, reason)
    assert theirs in read_guarantee(document).theorem_bounds().reason


@pytest.mark.parametrize("path", [PATH, APERIODIC], ids=["periodic", "aperiodic"])
@pytest.mark.parametrize(("share", "holds"), [("999/1000", True), ("1001/1000", False)])
def test_the_disturbance_must_outweigh_the_range_of_the_input_gain(path, share, holds, monkeypatch):
    """U⁺ just below and above H over (δS·q·T²/2 + δw·T(1 + S⁺q·T²))·b·(β1 − 1), or β1 in place of β1 − 1."""
    document = json.loads(path.read_text())
    period, claim = period_of(document), read_guarantee(document)
    monkeypatch.setattr(period, "sliding", lambda *_: iter(()))
    monkeypatch.setattr(period, "resting", list)
    monkeypatch.setattr(package, "facet_rows", lambda *_: iter(()))
    loop = {name: float(F(v)) for name, v in document["loop"].items()}
    step = loop.get("longest", loop["step"])
    (low, high), (least, most) = ([float(v) for v in pair] for pair in (period.slope, period.damping))
    q = 1 / (1 - high * step**2 / 2)
    of_push = (high - low) / 2 * q * step**2 / 2 + (most - least) / 2 * step * (1 + high * q * step**2)
    top = 0.3353 / 0.2353
    largest = 0.00032 / (of_push * 8e-8 * 0.2353 * (top if "longest" in loop else top - 1))
    push = period.push[0], F(largest) * F(share)
    period.push = push
    found = package.ranges(*_range_inputs(claim))
    monkeypatch.setattr(package, "feedback_range", lambda *_: push)
    monkeypatch.setattr(package, "ranges", lambda *_: found)
    monkeypatch.setattr(package.Period, "deciding", lambda *_: [])
    if holds:
        period.verify()
        package.stick_slip_bounds(claim.task, claim.sampled_loop, claim.invariant_set)
        return
    with pytest.raises(CHECK.Refused, match="be at least the effect of the range of beta"):
        period.verify()
    with pytest.raises(ParameterError, match="too small for this range of the input gain"):
        package.stick_slip_bounds(claim.task, claim.sampled_loop, claim.invariant_set)


def _range_inputs(claim):
    held, (ahead, rate, *_) = claim.sampled_loop, claim.invariant_set.box
    moved = claim.task.reference_rates[0] * held.longest
    return claim.task, ahead + moved, package.feedback_range(claim.task, held, claim.invariant_set), rate * held.longest


@pytest.mark.parametrize(("sign", "noise", "holds"), [(1, 49, True), (1, 51, False), (-1, 99, True), (-1, 101, False)])
def test_the_set_must_hold_the_loop_at_first(sign, noise, holds):
    """Facets (e1 + d/m)·10^4, which e1 = N and d = mN raise to 2·10^4·N, and (e1 - d/m)·10^4, which d = 0 leaves."""
    period = period_of(stored())
    period.sliding, period.resting = lambda *_: iter(()), list
    period.law.slip_noise = F(noise, 10**6)
    period.reach.facets, period.reach.multipliers = [[F(10**4), F(0), sign * 10**4 / period.law.slip]], [[F(0)] * 5]
    if holds:
        return period.verify()
    with pytest.raises(CHECK.Refused, match="contain the initial state"):
        period.verify()


FORGED = {
    "y less": ((*FACETS, 1), times("101/100")),
    "y more": ((*FACETS, 1), times("99/100")),
    "ahead less": ((*FACETS, 0), times("101/100")),
    "ahead more": ((*FACETS, 0), times("99/100")),
    "level less": ((*FACETS, 2), times("101/100")),
    "another facet less": ((*FACETS, 60), times("101/100")),
    "no multipliers": (MULTIPLIERS, lambda old: [["0"] * 5] * len(old)),
    "few bases": (("set", "sliding", 0), lambda old: old[:2]),
}


@pytest.mark.parametrize("change", FORGED.values(), ids=FORGED)
def test_a_forged_set_is_refused(change):
    assert refused(changed(stored(), change))


@pytest.mark.slow
@pytest.mark.parametrize("change", FORGED.values(), ids=FORGED)
def test_a_forged_set_is_refused_by_the_package(change):
    assert package_refuses(changed(stored(), change))
