"""A sliding mode on the stick-slip plant: its implicit step is deadbeat in the set, and both checkers ask for that."""

import json
from dataclasses import replace
from fractions import Fraction as F
from functools import cache
from pathlib import Path
from random import Random

import pytest
from scipy.optimize import brentq
from standalone_guarantee import CHECK
from stick_slip_box import STICK, box, changed, package_refuses, refused, times

from quakedesign.checking import check_files
from quakedesign.errors import CertificateError, UnsupportedError
from quakedesign.exact import UpperBound
from quakedesign.guarantees import read_guarantee
from quakedesign.guarantees.search.compensated_search import recovered

PATH = Path(__file__).parents[2] / "proofs" / "certificates" / "stick_slip_cta_real-fault.json"
PULL = ("loop", "pull")
TERM = {"factor": ["1/2", "1/2"], "power": "0", "of": "slip"}
DEADBEAT = {"target_gain": "3", "rate_gain": "3", "return_rate": "2"}  # of a box: T_s = 1/2 s


@cache
def stored():
    return json.loads(PATH.read_text())


def end_rate(terms, step, slip, rate):
    """Root of F(w) = w - e2 + q(e1 + T w, w) by Brent's method; all q here are sums of signed powers of e1 and e2."""

    def excess(w):
        seen = {"slip": slip + step * w, "rate": w}
        return w - rate + sum(c * ((seen[x] > 0) - (seen[x] < 0)) * abs(seen[x]) ** a for c, x, a in terms)

    most = abs(slip) / step + abs(rate) + 1e-9
    return brentq(excess, -most, most, xtol=1e-15)


def test_the_root_is_deadbeat_for_all_claimed_errors_and_for_no_much_larger_ones():
    claims = {name: float(F(v)) for name, v in stored()["claims"].items()}
    terms = [(float(F(t["factor"][0])), t["of"], float(F(t["power"]))) for t in stored()["loop"]["pull"]]
    random, step, fastest = Random(0), float(F(stored()["loop"]["step"])), 15 / 8 * 0.785 / 663012
    for _ in range(100):
        slip = random.uniform(-claims["slip_behind"], claims["slip_ahead"])
        rate = random.uniform(-fastest, claims["peak_slip_rate"])
        assert end_rate(terms, step, slip, rate) == pytest.approx(-slip / step, abs=1e-12)
    far = [(30 * claims["slip_ahead"], 0.0), (claims["slip_ahead"], 30 * claims["peak_slip_rate"])]
    assert any(abs(end_rate(terms, step, *errors) + errors[0] / step) > 1e-6 for errors in far)


def test_the_file_binds_the_root_and_its_statement_names_it():
    claim = read_guarantee(stored())
    assert claim.sampled_loop.law.pull
    assert claim.sampled_loop.law.return_rate * claim.sampled_loop.step == 1
    with pytest.raises(UnsupportedError, match="sliding mode"):
        _ = claim.controller


@pytest.mark.slow
def test_both_prove_the_stored_file_within_the_aims():
    found = CHECK.check(PATH.read_text())
    assert found.verdict == "proved"
    assert "its implicit step is deadbeat, w = -e1/step, on this set" in "\n".join(found.statement)
    ((verdict, _),) = check_files([PATH], "real-fault").values()
    assert verdict == "proved"
    claims = read_guarantee(stored()).claims
    assert claims.peak_slip_rate <= F("2.4e-4")
    assert claims.slip_error <= F("5e-5")


def test_a_weaker_sign_is_refused_by_both():
    """Of a tenth of its size the sign of e1 does not hold the step at e1 = 0 for all claimed errors."""
    which = next(i for i, term in enumerate(stored()["loop"]["pull"]) if (term["of"], term["power"]) == ("slip", "0"))
    weaker = changed(stored(), ((*PULL, which, "factor"), times("1/10")))
    assert refused(weaker, "the implicit step must be deadbeat in the set")
    assert "deadbeat" in read_guarantee(weaker).theorem_bounds().reason


def test_without_its_root_the_same_file_is_about_a_linear_law():
    document = changed(stored(), (("loop",), lambda old: {name: v for name, v in old.items() if name != "pull"}))
    assert read_guarantee(document).sampled_loop.law.pull == ()


@pytest.mark.parametrize("name", DEADBEAT)
def test_a_root_needs_the_gains_of_a_deadbeat_step(name):
    document = changed(box(), (("loop",), lambda old: old | DEADBEAT | {"pull": [TERM]}))
    assert STICK.read_law(document["loop"]).pull
    assert read_guarantee(document).sampled_loop.law.pull
    other = changed(document, (("loop", name), times("9/8")))
    assert refused(other, "a sliding mode must have target_gain = rate_gain")
    with pytest.raises(CertificateError, match="a sliding mode must have target_gain = rate_gain and return_rate = 1/"):
        read_guarantee(other)


@pytest.mark.parametrize(
    ("pull", "reason"),
    [
        ([], "a sum must be a list of its terms"),
        ([TERM] * 17, "a sum must be a list of its terms, at most 16"),
        ([TERM | {"of": [TERM] * 15}] * 2, "at most 16 terms"),
        ([TERM | {"factor": ["-1", "1"]}], "a factor must be two ends"),
        (TERM, "a sum must be a list of its terms"),
    ],
)
def test_a_root_of_another_form_is_refused_by_both(pull, reason):
    document = changed(box(), (("loop",), lambda old: old | DEADBEAT | {"pull": pull}))
    assert refused(document, reason)
    assert package_refuses(document)


def test_noise_of_the_slip_counts_in_what_the_root_must_cover():
    """|e1| up to the larger slip error and the noise, |e2| up to the larger of the peak and max r'."""
    claim = read_guarantee(stored())
    held = claim.sampled_loop
    noisy = replace(held, law=replace(held.law, rest_slip=F(1)), slip_noise=F(1, 2))
    fastest = claim.task.reference_rates[0]
    assert held.errors(claim.task, F(3), F(2)) == (3, 2)
    assert noisy.errors(claim.task, F(3), F(2)) == (F(7, 2), 2)
    assert held.errors(claim.task, F(3), UpperBound(0)) == (3, fastest)


@pytest.mark.parametrize("slow", [False, True], ids=["peak", "reference"])
@pytest.mark.parametrize("side", [0, 3], ids=["ahead", "behind"])
def test_the_checker_asks_for_the_root_at_all_measured_errors_of_the_set(slow, side, monkeypatch):
    """|e1| up to the larger side of the set, N and T·max r' more, |e2| up to the larger of its peak and max r'."""
    noise, step = F(1, 10**6), F(stored()["loop"]["step"])
    wider = times("1/2")  # of a facet: twice as far
    document = changed(
        stored(),
        *((("loop", name), str(share * noise)) for name, share in (("slip_noise", 1), ("rest_slip", 2))),
        (("set", "facets", side), wider),
        *((("claims", name), "1") for name in ("slip_behind", "slip_ahead", "peak_slip_rate")),
        (("claims", "largest_pressure"), "50000000"),
        (("claims", "least_pressure"), "-50000000"),
        *([(("set", "facets", 1), times("1000"))] if slow else []),
    )
    asked = []
    monkeypatch.setattr(STICK, "root_within", lambda root, *given: asked.append((root, given)) or False)
    with pytest.raises(CHECK.Refused, match="implicit step must be deadbeat"):
        STICK.verify(document)
    ((root, (period, slip, rate)),) = asked
    facets = [[F(v) for v in row] for row in document["set"]["facets"]]
    fastest = F(15, 8) * F("0.785") / 663012
    ahead, behind = (1 / abs(facets[i][0]) + fastest * step for i in (0, 3))
    assert (period, root.slopes, root.remainder) == (step, [1, 1], 0)
    assert slip == pytest.approx(max(behind + noise, ahead - noise) + noise, rel=1e-9)
    assert rate == pytest.approx(max(1 / facets[1][1], fastest), rel=1e-9)
    assert (rate == pytest.approx(fastest, rel=1e-9)) == slow


def test_gains_are_read_off_a_step_of_the_law_alone():
    claim = read_guarantee(stored())
    found = recovered(claim).controller
    assert found.name == "cta"
    assert dict(found.sampling.settings)[
        "slip_weight"
    ] == claim.sampled_loop.law.slip_gain * claim.sampled_loop.step / (claim.sampled_loop.law.target_gain)
    first = claim.sampled_loop.law.pull[0]
    wide = replace(first, factor=(first.factor[0], 2 * first.factor[0]))
    others = claim.sampled_loop.law.pull[1:]
    for pull in (others, (replace(first, argument=(first,)), *others), (wide, *others), ()):
        law = replace(claim.sampled_loop.law, pull=pull)
        with pytest.raises(UnsupportedError, match="scheme compensated or stick-slip"):
            recovered(replace(claim, sampled_loop=replace(claim.sampled_loop, law=law)))
