"""Polytopes of the stick-slip plant for coqc: what it accepts, and that it refuses what is forged."""

import re
import shutil
import subprocess
from fractions import Fraction as F
from pathlib import Path

import numpy as np
import pytest

from quakedesign.lyapunov.exact.certificate_files import read_json
from quakedesign.rocq.rocq_export import library, rocq_text, statement_text

CERTIFICATES = Path(__file__).parents[2] / "proofs" / "certificates"
COQC = shutil.which("coqc")
needs_coqc = pytest.mark.skipif(COQC is None, reason="coqc is not installed: files for Rocq are written, not verified")
TRIED = (0, 2, 4, 5, 44)  # facets; 4 needs the gain of the target, 44 is no larger at rest (a sum is exactly 1)


def compiled(text, folder, name="certificate"):
    """Compile a file in a folder and return what coqc says."""
    path = folder / f"{name}.v"
    path.write_text(text, encoding="utf-8")
    run = subprocess.run([COQC, path.name], cwd=folder, capture_output=True, text=True, check=False)
    return run.returncode, run.stdout, run.stderr


@pytest.fixture(scope="module")
def raw():
    return read_json(CERTIFICATES / "stick_slip_real-fault.json")


@pytest.fixture(scope="module")
def text(raw):
    return statement_text(raw)


def numbers(words):
    """Rationals of a definition."""
    return [F(*map(int, pair.split(" # "))) if "#" in pair else F(0) for pair in re.findall(r"-?\d+ # \d+|0%Q", words)]


def sentence(text, name):
    return re.search(rf"^Definition {name} .*?\.$", text, re.MULTILINE | re.DOTALL)[0]


def entries(text, name):
    """Head, entries and tail of a list."""
    head, inner = sentence(text, name)[:-2].split(":=\n  [", 1)
    return head, inner.split(";\n   [" if name.startswith("hints") else ";\n   ")


# ---------------------------------------------------------------- without coqc


def test_loop_facets_and_claims_are_those_of_the_file(raw, text):
    plant, law, fault = numbers(sentence(text, "plant")), raw["loop"], raw["fault"]
    assert plant[0] == F(law["step"])
    assert plant[1] == F(raw["disturbance"]["amplitude"])
    friction = {name: F(value) for name, value in fault["friction"].items()}
    assert plant[2] == friction["least"] / (F(fault["density"]) * F(fault["length"]))
    assert plant[3] == friction["largest"] / friction["least"]
    gains = ("rate_gain", "target_gain", "return_rate", "level_gain", "slip_gain", "rest_slip", "slip_noise")
    assert plant[14:] == [F(law[name]) for name in gains]
    _, facets = entries(text, "facets")
    assert [numbers(line)[:3] for line in facets] == [[F(v) for v in row] for row in raw["set"]["facets"]]
    assert numbers(sentence(text, "claimed"))[:5] == [F(value) for value in raw["claims"].values()]


def test_responses_enclose_those_of_an_ordinary_differential_equation(text):
    """Runge-Kutta steps of xi'' = S0 xi - w0 xi', not the exponential of a matrix."""
    plant = [float(v) for v in numbers(sentence(text, "plant"))]
    slope, damping, step = sum(plant[4:6]) / 2, sum(plant[8:10]) / 2, plant[0]
    known = re.findall(r"Near \((-?\w+)\) (\w+)", sentence(text, "known"))
    middles = np.array([int(middle, 0) / 2**80 for middle, _ in known])
    assert max(int(radius, 0) for _, radius in known) < 2**20
    state, flow = np.array([0.0, 1.0, 0.0, 0.0]), [[0, 1, 0, 0], [slope, -damping, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]]
    one, many = np.array(flow), 64
    h, seen = step / 16 / many, [state[:2]]
    for _ in range(16):
        for _ in range(many):
            a = one @ state
            b = one @ (state + h / 2 * a)
            c = one @ (state + h / 2 * b)
            state = state + h / 6 * (a + 2 * b + 2 * c + one @ (state + h * c))
        seen.append(state[:2])
    np.testing.assert_allclose(middles[:-2].reshape(-1, 2), seen[::-1], rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(middles[-2:], state[2:], rtol=1e-10)


def test_multipliers_bound_the_push_on_the_polytope(raw, text):
    """In rationals: what is left of U is at most a billionth of its bound anywhere in the polytope."""
    law = {name: F(value) for name, value in raw["loop"].items()}
    facets = [[F(v) for v in row] for row in raw["set"]["facets"]]
    extents = [1 / abs(sum(row)) for row in facets[:5]]
    low, high = numbers(sentence(text, "proposed"))
    rate, c = numbers(sentence(text, "plant"))[10], law["return_rate"]
    row = [law["target_gain"] * c, law["rate_gain"], F(1)]
    cuts = (([1], [F(0)]), ([-1, 1], [F(0), rate / c]), ([-1], [-rate / c]))
    pairs = re.findall(r"Hint false \[(.*?)\]", sentence(text, "proposed"))
    for i, hint in enumerate(pairs):
        signs, turns = cuts[i // 2]
        lines = [*((line, F(1)) for line in facets), ([F(0), F(-1), F(0)], F(0))]
        lines += [([F(s), F(0), F(0)], end) for s, end in zip(signs, turns, strict=True)]
        left, total = [v if i % 2 else -v for v in row], F(0) if i % 2 else law["target_gain"] * rate
        for share in filter(None, hint.split(";")):
            _, number, amount = share.split()
            line, end = lines[int(number)]
            weight = F(int(amount, 0), 2**40)
            left, total = [a - weight * b for a, b in zip(left, line, strict=True)], total + weight * end
        bound = high if i % 2 else -low
        size = (max(extents[0], extents[3]), extents[1], max(extents[2], extents[4]))
        assert total + sum(abs(a) * b for a, b in zip(left, size, strict=True)) <= bound * (1 + F(1, 10**9))
    assert len(pairs) == 6


# ---------------------------------------------------------------- with coqc

WRONG = """
Definition tiny : loop := Loop (1 # 4) (1 # 10) (1 # 1) (1 # 1) 0%Q 0%Q 0%Q 0%Q 0%Q 0%Q 0%Q 0%Q 0%Q 0%Q
  (1 # 1) (1 # 1) (1 # 1) 0%Q 0%Q 0%Q 0%Q.
Definition lone_facet a b c := Facet a b c 0%Q false 0%Q false 0%Q.
Definition axes := [lone_facet (1 # 2) 0 0; lone_facet 0 (1 # 4) 0; lone_facet 0 0 (1 # 1); lone_facet (-1 # 5) 0 0;
  lone_facet 0 0 (-1 # 1)].
Goal boxed axes = true. Proof. vm_compute. reflexivity. Qed.
Goal boxed (tl axes) = false. Proof. vm_compute. reflexivity. Qed.
Goal boxed (lone_facet (1 # 2) (1 # 9) 0 :: tl axes) = false. Proof. vm_compute. reflexivity. Qed.
Goal boxed (lone_facet (-1 # 2) 0 0 :: tl axes) = false. Proof. vm_compute. reflexivity. Qed.
Goal signs tiny axes = true. Proof. vm_compute. reflexivity. Qed.
Goal above closely (Near (-5) 5) = Near 0 0 /\\ above closely (Near (-5) 6) = Near 0 6. Proof. now vm_compute. Qed.
Goal near_times (near_number (1 # 3)) (near_number 0) = Near 0 0. Proof. vm_compute. reflexivity. Qed.
Definition place := arena_of tiny axes 1 (slice_table tiny axes 1).
Definition own (n : Z) := lifted closely (own_row (nth (Z.to_nat n) axes (lone_facet 0 0 0))).
Definition none := lifted closely (Vector 0 0 0 0)%Q.
Definition value v := number closely v.
Goal at_most_one place (own 1) (none, value 0) (Hint true []) = true. Proof. vm_compute. reflexivity. Qed.
Goal at_most_one place (own 1) (none, value (1 # 1000)) (Hint true []) = false. Proof. vm_compute. reflexivity. Qed.
Goal at_most_one place (own 1) (none, value 0) (Hint false [Share 1 0x10000000000]) = true.
Proof. vm_compute. reflexivity. Qed.
Goal at_most_one place (own 1) (none, value 0) (Hint false [Share 0 0x10000000000]) = false.
Proof. vm_compute. reflexivity. Qed.
Goal at_most_one place (own 1) (none, value (1 # 1000)) (Hint false []) = false. Proof. vm_compute. reflexivity. Qed.
Goal at_most_one place (own 1) (lifted closely (Vector 0 (1 # 9) 0 0)%Q, value 0) (Hint true []) = false.
Proof. vm_compute. reflexivity. Qed.
"""

CHECKED = """
Definition flat_ := map (fun i => arena_of plant facets i (slice_table plant facets i)) [0; 1; 2]%Z.
Definition seven_ := map (fun e => nth (Z.to_nat (fst e)) flat_ (nil, zero_row closely, false)) (sliding_ends plant).
Definition four_ := map (fun e => let '(i, first, _) := e in arena_of plant facets i (rest_table plant facets i first))
  (resting_ends plant).
Definition good f slide stop :=
  slides_inside plant seven_ known (gaps plant closely known) f slide && rests_inside plant four_ f stop.
Goal signs plant facets && boxed facets && begins_inside plant facets = true. Proof. vm_compute. reflexivity. Qed.
"""


def cut(text, forge=lambda text: text):
    """The data of a certificate with the hints of a few facets, and that they are good."""
    kept = [sentence(text, name) for name in ("plant", "facets", "known")]
    lines = []
    for name in ("facets", "hints_of_slides", "hints_of_rests"):
        _, found = entries(text, name)
        found = [line if name == "facets" else "[" * (i > 0) + line for i, line in enumerate(found)]
        found[-1] = found[-1].removesuffix("]")
        lines.append(found)
    goals = "\n".join(
        f"Goal good ({lines[0][i]}) {lines[1][i]} {lines[2][i]} = true. Proof. vm_compute. reflexivity. Qed."
        for i in TRIED
    )
    return forge("\n".join([*kept, CHECKED, goals]))


def forged(before, after, text):
    assert text.count(before) >= 1
    return text.replace(before, after, 1)


@needs_coqc
@pytest.mark.slow
def test_coqc_accepts_facets_of_the_file_and_no_forged_number(text, tmp_path):
    plain = cut(text)
    code, _, err = compiled("\n".join([*library(("polytope.v",)), WRONG, plain]), tmp_path)
    assert (code, err) == (0, "")
    (tmp_path / "base.v").write_text("\n".join(library(("polytope.v",))), encoding="utf-8")
    assert compiled("\n".join(library(("polytope.v",))), tmp_path, "base")[0] == 0
    begin = "From Coq Require Import ZArith QArith Reals List.\nImport ListNotations.\nRequire Import base.\n"
    assert compiled(begin + plain, tmp_path, "whole")[0] == 0
    smaller = re.sub(r"Facet \((\d+) # 8388608\)", lambda m: f"Facet ({int(m[1]) * 21 // 20} # 8388608)", plain)
    for number, changed in enumerate(
        (
            forged("(1 # 3125)", "(11 # 31250)", plain),  # a larger disturbance
            forged("(262438400 # 1)", "(202438400 # 1)", plain),  # another gain
            re.sub(r"Share (\d+) 0x\w+", r"Share \1 1", plain),  # no multipliers
            re.sub(r"Hint false \[.*?\]", "Hint true []", plain),
            smaller,
        )
    ):
        assert changed != plain
        assert compiled(begin + changed, tmp_path, f"forged{number}")[0] != 0


def known_elsewhere(text):
    """Responses of which the first is off by a millionth of a millionth."""
    found = sentence(text, "known").replace("Definition known", "Definition other")
    return re.sub(r"Near \((0x\w+)\)", lambda m: f"Near ({hex(int(m[1], 16) + 2**40)})", found, count=1)


@needs_coqc
def test_a_claim_that_does_not_follow_is_refused(text, tmp_path):
    head = "\n".join(sentence(text, name) for name in ("plant", "facets", "claimed"))
    low, high = re.search(r"hints_of_rests (\S+ # \S+|\S+) (\(\S+ # \d+\))", sentence(text, "proposed")).groups()
    end = (
        f"Definition some := Proposals [] [] {low} {high} [].\n"
        "Goal follows plant facets some claimed = true. Proof. vm_compute. reflexivity. Qed.\n"
    )
    changed = [
        claim.replace("Definition claimed", f"Definition claimed{i}")
        for i, claim in enumerate(
            re.sub(
                rf"^(.*?Claims(?: \S+ # \S+){{{n}}} )\((-?\d+) # (\d+)\)",
                lambda m: f"{m[1]}({int(m[2]) * 19} # {int(m[3]) * 20})",
                sentence(text, "claimed"),
            )
            for n in range(5)
        )
    ]
    wrong = "\n".join(
        f"{claim}\nGoal follows plant facets some claimed{i} = false. Proof. vm_compute. reflexivity. Qed."
        for i, claim in enumerate(changed)
    )
    code, _, err = compiled("\n".join([*library(("polytope.v",)), head, end, wrong]), tmp_path)
    assert (code, err) == (0, "")


@needs_coqc
@pytest.mark.slow
def test_responses_that_do_not_follow_from_the_flow_are_refused(text, tmp_path):
    flow = re.search(r"^Lemma solved_flow : (follows_from_flow plant known .*) = true\.$", text, re.MULTILINE)[1]
    other = known_elsewhere(text)
    goals = {flow: "true", flow.replace("known", "other"): "false", flow.replace("(1 # ", "(1 # 4000"): "false"}
    proved = (
        f"Goal {goal} = {answer}. Proof. vm_cast_no_check (eq_refl {answer}). Qed." for goal, answer in goals.items()
    )
    head = "\n".join([sentence(text, "plant"), sentence(text, "known"), other])
    code, _, err = compiled("\n".join([*library(("polytope.v",)), head, *proved]), tmp_path)
    assert (code, err) == (0, "")
    assert len(goals) == 3


@needs_coqc
@pytest.mark.slow
@pytest.mark.parametrize(
    ("stated", "wrong"),
    [
        ("Near (Z.shiftr p digits) (Z.shiftr r digits + 2)", "Near (Z.shiftr p digits) (Z.shiftr r digits)"),
        ("then - n1 f * (bend L", "then n1 f * (bend L"),
        ("added left (multiple (Zneg p) (fst c))", "added left (multiple (Zpos p) (fst c))"),
        ("size N F * num (slip_gain L * slip_noise L)%Q", "num 0%Q"),
        ("Q2R (authority L * beta L) * push z r noise - Q2R (slope_low L) * stop", "0"),
    ],
    ids=["rounding", "reference", "multipliers", "noise", "rest"],
)
def test_another_statement_of_the_theorem_is_refused(stated, wrong, tmp_path):
    (theorem,) = library(("polytope.v",))
    assert theorem.count(stated) == 1
    assert compiled(theorem.replace(stated, wrong), tmp_path)[0] != 0


@needs_coqc
@pytest.mark.slow
def test_a_forged_certificate_is_refused(raw, tmp_path):
    """A disturbance that is larger by a tenth, which no check before coqc refuses when the file is written."""
    larger = F(raw["disturbance"]["amplitude"]) * F(11, 10)
    other = {**raw, "disturbance": {**raw["disturbance"], "amplitude": str(larger)}}
    code, _, err = compiled(rocq_text(other), tmp_path)
    assert code != 0
    assert "Error" in err
