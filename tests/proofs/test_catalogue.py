"""Shipped certificates: both checkers accept each, the library writes the same bytes, each is what its name says."""

import importlib.util
import json
import math
from dataclasses import replace
from fractions import Fraction as F
from pathlib import Path

import pytest
from thinned import few

from quakedesign.checking import check_files
from quakedesign.fault import load_fault
from quakedesign.guarantees import design_compensated, design_sampled_law, with_varying_gain
from quakedesign.guarantees.exact.guarantee_files import guarantee_text, parse_guarantee, read_guarantee
from quakedesign.laws import family, law
from quakedesign.lyapunov import Verdict, certificate_text, load_certificate, loop_of
from quakedesign.plant import slow_sliding_plant, uncertain_plant
from quakedesign.sos.exact import polynomial_files

ROOT = Path(__file__).parents[2] / "proofs"
FILES = sorted((ROOT / "certificates").glob("*.json"))
POLYNOMIALS = [p for p in FILES if p.stem.startswith("motzkin")]
GUARANTEES = [p for p in FILES if p.stem.startswith("guarantee")]
SLIDING = [p for p in FILES if p.stem.startswith("sliding")]
STICKING = [p for p in FILES if p.stem.startswith("stick_slip")]
PLANTS = [p for p in FILES if p.stem.startswith("uncertain_plant")]
LOOPS = [p for p in FILES if p not in (*POLYNOMIALS, *GUARANTEES, *SLIDING, *STICKING, *PLANTS)]
each = pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
# a proof of each kind is checked by both elsewhere
LONG = {"sliding_crustal-patch", "cta3_1_2_2_0.05_0.02_0.01", "dia_1_20_1_0", "uncertain_plant_pendulum"}
LONG |= {f"stick_slip_{loop}real-fault" for loop in ("", "cta_", "aperiodic_")}
each_loop = pytest.mark.parametrize(
    "path", [pytest.param(p, id=p.stem, marks=[pytest.mark.slow] * (p.stem in LONG)) for p in LOOPS]
)

# L̄ and [b_m, b_M] of every file; four 2-CTA sets are those of Torres-González et al. (2017) for L̄ = 1, the fifth and
# the 2-DIA set of the same bound are the smallest that a synthesis found
STATEMENTS = {
    "super-twisting_1.5_1.1": ("1", "1", "1"),
    "cta_7_5_2.3_1.1": ("1", "1", "1"),
    "cta_13_7.5_2.3_1.1": ("1", "1", "1"),
    "cta_19_10_2.3_1.1": ("1", "1", "1"),
    "cta_25_15_2.3_1.1": ("1", "1", "1"),
    "cta_2.717_1.871_1.27_0.2638": ("1", "1", "1"),
    "dia_1_20_1_0": ("3/10", "1", "57/40"),
    "dia_1.5625_5.248_1.183_0": ("1", "1", "1"),
    "dia_1_20_1_0.1": ("3/10", "1", "1"),
    "dia_2_5_1_0.1": ("39/50", "1", "3"),
    "cta3_1_2_2_0.05_0.02_0.01": ("1/200", "1", "1"),
}

SMALLEST = {"cta_2.717_1.871_1.27_0.2638": (7, 5, 2.3, 1.1), "dia_1.5625_5.248_1.183_0": (38.55, 423.1, 1.031, 0)}

SPECIFICATION = importlib.util.spec_from_file_location("catalogue_check", ROOT / "check.py")
checker = importlib.util.module_from_spec(SPECIFICATION)
SPECIFICATION.loader.exec_module(checker)


def test_the_catalogue_is_complete():
    assert {p.stem for p in LOOPS} == {*STATEMENTS, "elqr_real-fault", "elqr_lab-fault"}
    loops = {"real-fault", "lab-fault", "cta_real-fault", "late_real-fault", "no-clock_lab-fault"}
    assert {p.stem for p in GUARANTEES} == {f"guarantee_{loop}" for loop in loops}
    assert {p.stem for p in SLIDING} == {"sliding_crustal-patch"}
    sticking = {"real-fault", "noise_real-fault", "cta_real-fault", "aperiodic_real-fault"}
    assert {p.stem for p in STICKING} == {f"stick_slip_{loop}" for loop in sticking}
    assert {p.stem for p in PLANTS} == {"uncertain_plant_pendulum", "uncertain_plant_real-fault-2-blocks"}
    assert {p.stem for p in POLYNOMIALS} == {"motzkin_not-sos", "motzkin_multiplier_sos"}


@few("path", [pytest.param(p, id=p.stem, marks=[pytest.mark.slow] * (p.stem in LONG)) for p in FILES], every=3)
def test_both_checkers_agree(path):
    expected = "refuted" if path.stem == "motzkin_not-sos" else "proved"
    ((verdict, _),) = check_files([path]).values()
    assert verdict == expected
    assert checker.check(path.read_text()).verdict == expected


@each
def test_the_library_writes_the_same_bytes(path):
    text = path.read_text()
    if path in POLYNOMIALS:
        assert polynomial_files.text(*polynomial_files.load(text)) == text
    elif path in GUARANTEES:
        assert guarantee_text(parse_guarantee(text)) == text
    elif path in (*SLIDING, *STICKING, *PLANTS):
        assert guarantee_text(parse_guarantee(text)) == text
    else:
        assert certificate_text(load_certificate(path)) == text


@few("name", STATEMENTS, every=3)
def test_a_name_says_law_and_gains(name):
    certificate = load_certificate(ROOT / "certificates" / f"{name}.json")
    wanted, *gains = name.split("_")
    lipschitz, low, high = map(F, STATEMENTS[name])
    assert certificate.loop.law == wanted
    assert list(certificate.loop.gains.values()) == [F(g) for g in gains]
    assert certificate.loop.uncertain == {"beta": (low, high), "d": (-lipschitz, lipschitz)}
    values = dict(certificate.loop.gains)
    derived = loop_of(wanted, law(wanted).loop_field(), gains=values, uncertain=certificate.loop.uncertain)
    assert derived == certificate.loop


@pytest.mark.parametrize("name", SMALLEST)
def test_synthesised_gains_are_less_than_half_of_the_published_ones(name):
    # the published 2-DIA gains (2, 5, 1.44e-4, 0), λ-scaled from L̄ = 1.3968e-4 to 1: (λ^⅓, λ^½, λ) of them
    gains = load_certificate(ROOT / "certificates" / f"{name}.json").loop.gains
    assert math.hypot(*map(float, gains.values())) < math.hypot(*SMALLEST[name]) / 2


@pytest.mark.parametrize("fault", ["real-fault", "lab-fault"])
def test_linear_certificates_cover_their_faults(fault):
    path = ROOT / "certificates" / f"elqr_{fault}.json"
    ((verdict, lines),) = check_files([path], fault).values()
    assert verdict == "proved"
    assert any(fault in line for line in lines)


@few("path", GUARANTEES, ids=lambda p: p.stem, every=3)
def test_a_guarantee_is_about_the_default_design_of_its_fault(path):
    stored, fault = parse_guarantee(path.read_text()), load_fault(path.stem.split("_")[-1])
    assert check_files([path], fault.name)[str(path)][0] == "proved"
    assert stored.task == uncertain_plant(fault)
    assert stored.sampled_loop.step == F(str(fault.sampling_time))
    if stored.sampled_loop.longest_step:
        return  # its search is tested in tests/guarantees/search/test_unclocked.py
    if "cta" in path.stem:
        base = replace(family("cta")[0].law, gains=dict(family("cta")[0].law.gains), divisor=stored.task.authority)
        again = with_varying_gain(design_compensated(stored.task, base, stored.sampled_loop.step).proof)
        assert again.sampled_loop.law.implicit_step.pull == stored.sampled_loop.law.implicit_step.pull
    else:
        again = design_sampled_law(stored.task, stored.sampled_loop.step, setup=stored.sampled_loop.setup)
    assert float(again.claims.slip_rate_error) == pytest.approx(float(stored.claims.slip_rate_error), rel=0.02)
    assert float(again.claims.slip_error) == pytest.approx(float(stored.claims.slip_error), rel=0.02)


# every claim of a few loops, each a file of its own, is made smaller in tests/guarantees/exact/test_files.py
KEYS = ("slip_error", "slip_rate_error", "peak_slip_rate", "largest_pressure", "least_pressure")
SMALLER = list(zip(GUARANTEES, KEYS, strict=True))


@few(("path", "key"), SMALLER, ids=[f"{path.stem}-{key}" for path, key in SMALLER], every=3)
def test_a_smaller_claim_of_a_guarantee_is_refused_by_both(path, key, tmp_path):
    raw = json.loads(path.read_text())
    raw["claims"][key] = str(F(raw["claims"][key]) * F(99, 100))
    changed = tmp_path / "changed.json"
    changed.write_text(json.dumps(raw))
    ((verdict, _),) = check_files([changed]).values()
    assert verdict != "proved"
    with pytest.raises(checker.Refused):
        checker.check(changed.read_text())


@pytest.mark.slow
def test_a_patch_of_the_crust_is_held_below_1_2_times_its_rate_under_25_kpa():
    path = ROOT / "certificates" / "sliding_crustal-patch.json"
    claim = parse_guarantee(path.read_text())
    assert claim.task == slow_sliding_plant(load_fault("crustal-patch"), F(25000))
    assert claim.peak_slip_rate < F("1.2e-6")
    raw = json.loads(path.read_text())
    raw["stress"] = "80000"
    assert read_guarantee(raw).check() is Verdict.UNDECIDED


@pytest.mark.slow
def test_a_box_of_ten_percent_is_held_under_5e_4_of_the_normal_stress():
    """Minutes for the standalone checker: 32 cells through rock."""
    path = ROOT / "certificates" / "boxes" / "sliding_ten-percent.json"
    claim, text = parse_guarantee(path.read_text()), path.read_text()
    assert guarantee_text(claim) == text
    assert claim.task.stress == F(5, 10**4) * claim.task.ranges["normal_stress"][0]
    for name, value in (("direct_effect", "0.010"), ("evolution_effect", "0.015"), ("critical_slip", "0.001")):
        assert claim.task.ranges[name] == (F(value) * F("0.9"), F(value) * F("1.1"))
    assert claim.claims.log_rate == F("0.271")
    assert claim.check() is Verdict.PROVED
    assert checker.check(text).verdict == "proved"


def test_the_polynomial_is_that_of_motzkin():
    known = {(4, 2): 1, (2, 4): 1, (0, 0): 1, (2, 2): -3}  # x⁴y² + x²y⁴ + 1 − 3x²y²
    for path in POLYNOMIALS:
        asked, _ = polynomial_files.load(path.read_text())
        assert asked.polynomial == known
        squared = {(0, 0): 1, (2, 0): 1, (0, 2): 1}
        assert asked.multiplier == ({(0, 0): 1} if path.stem == "motzkin_not-sos" else squared)


@each_loop
def test_a_changed_number_is_refused_by_both(path, tmp_path):
    raw = json.loads(path.read_text())
    gram = next(s for w in raw["witnesses"] for s in w["squares"])["gram"]
    gram[0] = str(F(gram[0]) * F(1001, 1000))
    text = json.dumps(raw)
    changed = tmp_path / "changed.json"
    changed.write_text(text)
    ((verdict, _),) = check_files([changed]).values()
    assert verdict.startswith("invalid")
    with pytest.raises(checker.Refused):
        checker.check(text)


@pytest.mark.parametrize(
    "name", [n for n in STATEMENTS if not n.startswith(("dia_1_20_1_0.1", "dia_2_5", "cta3", *SMALLEST))]
)
def test_most_files_bound_the_settling_time(name):
    certificate = load_certificate(ROOT / "certificates" / f"{name}.json")
    assert certificate.claims["decay"] > 0
