"""Files for a proof assistant: what coqc accepts, and that it refuses every change."""

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
from fractions import Fraction as F
from pathlib import Path

import pytest

from quakedesign.cli import main
from quakedesign.errors import OutputError, UnsupportedError
from quakedesign.lyapunov.exact.certificate_files import evidence_of, read_json
from quakedesign.lyapunov.exact.obligations import claimed, different
from quakedesign.rocq import rocq_export as rocq_files
from quakedesign.rocq.gallina import in_integers
from quakedesign.rocq.rocq_export import library, module_name, rocq_text, statement_text, write_rocq
from quakedesign.sos.exact.polynomial import evaluate
from quakedesign.sos.exact.polynomial_files import read
from quakedesign.sos.exact.proofs import as_polynomial

CERTIFICATES = Path(__file__).parents[2] / "proofs" / "certificates"
COQC = shutil.which("coqc")
needs_coqc = pytest.mark.skipif(COQC is None, reason="coqc is not installed: files for Rocq are written, not verified")

# What Coq's real numbers rest on, and its powers and derivatives; nothing else may stand below a certificate.
REALS = {"ClassicalDedekindReals.sig_forall_dec", "FunctionalExtensionality.functional_extensionality_dep"}
ANALYSIS = REALS | {"ClassicalDedekindReals.sig_not_dec", "Classical_Prop.classic"}


def polynomial_file(names, polynomial, kind, proof, *, on=(), equal=(), products=((),), multiplier=None):
    one = {",".join("0" * len(names)): "1"}
    return {
        "format": 1,
        "variables": list(names),
        "polynomial": polynomial,
        "inequalities": list(on),
        "equalities": list(equal),
        "products": [list(p) for p in products],
        "degree": 4,
        "multiplier": multiplier or one,
        kind: proof,
    }


def square(basis, *gram, product=()):
    return {"product": list(product), "basis": basis, "gram": list(gram)}


# (1 + x²)·(x² + 2x + y²) = 6·(x/2)·(1 + x²) + (1 + x²)(1 − x + x²) + (1 + x²)(y + 1)·(y − 1) where x/2 ≥ 0, y − 1 = 0
CONSTRAINED = polynomial_file(
    "xy",
    {"2,0": "1", "1,0": "2", "0,2": "1"},
    "sos",
    {
        "squares": [
            square([[0, 0], [1, 0]], "6", "0", "6", product=[0]),
            square([[0, 0], [1, 0], [2, 0]], "1", "-1/2", "0", "2", "-1/2", "1"),
        ],
        "cofactors": [{"0,0": "1", "0,1": "1", "2,0": "1", "2,1": "1"}],
        "multiplier": [square([[0, 0], [1, 0]], "1", "0", "1")],
    },
    on=[{"1,0": "1/2"}],
    equal=[{"0,1": "1", "0,0": "-1"}],
    products=[[], [0]],
    multiplier={"0,0": "1", "2,0": "1"},
)

# x²·(y² − y + 1) = bᵀQb with b = (x, xy − x/3): the multiplier vanishes on x = 0, by its terms or as a square
THIN = polynomial_file(
    "xy",
    {"0,2": "1", "0,1": "-1", "0,0": "1"},
    "sos",
    {
        "squares": [square([[1, 0], {"1,1": "1", "1,0": "-1/3"}], "7/9", "-1/6", "1")],
        "cofactors": [],
        "multiplier": [],
    },
    multiplier={"2,0": "1"},
)
THIN_SQUARE = json.loads(json.dumps(THIN))
THIN_SQUARE["sos"]["multiplier"] = [square([[1, 0]], "1")]

# x² − 2 at x = 4/3, where x − 1 ≥ 0 and 3xy = 8
NEGATIVE = polynomial_file(
    "xy",
    {"2,0": "1", "0,0": "-2"},
    "negative",
    {"point": ["4/3", "2"]},
    on=[{"1,0": "1", "0,0": "-1"}],
    equal=[{"1,1": "3", "0,0": "-8"}],
)


def loop_file():
    """x' = -2β sign x + d with V = 3/4 x²: every obligation is c·u^n, which is u^(n mod 2) times a square."""
    raw = {
        "format": 1,
        "law": "by-hand",
        "gains": {"k": "2"},
        "constants": {},
        "states": {"x": 1},
        "domain": "cells",
        "uncertain": {"beta": ["1", "3/2"], "d": ["-1/2", "1/2"]},
        "roots": {},
        "lifts": {},
        "field": {"x": [["-1", ["beta", "k"], [["x", "0", "s"]]], ["1", ["d"], []]]},
        "V": [["3/4", [], [["x", "2", "a"]]]],
        "claims": {"positive": "1/2", "decrease": "1/4"},
        "witnesses": [],
    }
    bare = evidence_of(raw)
    for one in different(claimed(bare.loop, bare.lyapunov, bare.claims)):
        (((n,), c),) = one.polynomial.items()
        squares = [{"times": [n % 2], "basis": [[n // 2]], "gram": [str(c)]}]
        rest = {"equalities": [], "inequalities": []}
        raw["witnesses"].append({"obligation": one.name, "multiplier": {"0": "1"}, "squares": squares, **rest})
    return raw


# x' = -x + x³ and V = x² below 3/4: V = (x)², −V̇ = 2x² − 2x⁴ = x²/2 + (3/4 − x²)·2x²
ATTRACTION = {
    "format": 1,
    "kind": "attraction",
    "variables": ["x"],
    "field": [{"1": "-1", "3": "1"}],
    "V": {"2": "1"},
    "level": ["3/4"],
    "multiplier": {"0": "1"},
    "positive": {"squares": [square([[1]], "1")], "cofactors": [], "multiplier": []},
    "decrease": {
        "squares": [square([[1]], "1/2"), square([[1]], "2", product=[0])],
        "cofactors": [],
        "multiplier": [],
    },
}

BY_HAND = {
    "Loop": loop_file(),
    "Constrained": CONSTRAINED,
    "Thin": THIN,
    "ThinSquare": THIN_SQUARE,
    "Negative": NEGATIVE,
    "Attraction": ATTRACTION,
}


def compiled(text, folder, name="certificate"):
    """Compile a file in a folder and return what coqc says."""
    path = folder / f"{name}.v"
    path.write_text(text, encoding="utf-8")
    run = subprocess.run([COQC, path.name], cwd=folder, capture_output=True, text=True, check=False)
    return run.returncode, run.stdout, run.stderr


def axioms_of(said):
    """Names of the axioms that Print Assumptions lists."""
    return set(re.findall(r"^(\S+)(?=\s*:|\n  :)", said, re.MULTILINE)) - {"Axioms"}


def module(name, text):
    return f"Module {name}.\nLocal Open Scope nat_scope.\n{text}\nEnd {name}.\n"


def goal_fails(text):
    """The data of a certificate, and that its checks do not all come out as true."""
    checks = re.findall(r"^Lemma \S+ : (.*) = true\.$", text, re.MULTILINE)
    goal = f"Goal forallb (fun b : bool => b) [{'; '.join(checks)}] = true."
    return f"{data_of(text)}\n{goal}\nFail (vm_compute; reflexivity).\nAbort."


def data_of(text):
    """Definitions of a certificate without what follows from its checks."""
    sentences = re.split(r"^(?=Definition |Lemma |Theorem |Proof|Print |\(\*)", text, flags=re.MULTILINE)
    return "".join(s for s in sentences if re.match(r"Definition (?!holds_|everything)", s))


def changed_digits(text):
    """The text with each digit of its numbers replaced, one at a time."""
    numbers = re.finditer(r"(?<![A-Za-z_0-9])\d+", text)
    for place in (place for number in numbers for place in range(*number.span())):
        changed = text[:place] + ("2" if text[place] == "1" else "1") + text[place + 1 :]
        if data_of(changed) != data_of(text):
            yield changed


# ---------------------------------------------------------------- without coqc


@pytest.mark.parametrize("raw", [CONSTRAINED, THIN])
def test_the_identity_in_integers_holds_at_rational_points(raw):
    asked, proof = read(json.loads(json.dumps(raw)))
    witness = in_integers(asked, proof.squares, proof.cofactors)
    whole = {c.denominator for s in witness.squares for b in s.basis for c in map(F, b.values())}
    assert whole == {1}
    for point in ([F(2, 3), F(-5, 7)], [F(-1, 9), F(4)], [F(11, 2), F(3, 8)]):
        cleared = [evaluate(g, point) * witness.clearing for g in asked.inequalities]
        equal = [evaluate(h, point) * witness.clearing for h in asked.equalities]
        right = sum(evaluate(q, point) * h for q, h in zip(witness.cofactors, equal, strict=True))
        for s in witness.squares:
            b, weight = [evaluate(as_polynomial(e), point) for e in s.basis], F(1)
            for i in s.product:
                weight *= cleared[i]
            form = sum(
                (1 if j == 0 else 2) * q * b[i] * b[i + j] for i, row in enumerate(s.gram) for j, q in enumerate(row)
            )
            right += weight * form
        left = evaluate(witness.multiplier, point) * evaluate(asked.polynomial, point) * witness.clearing
        assert witness.left * left == witness.right * right
        assert left != 0


def test_the_same_certificate_gives_the_same_bytes_in_another_process():
    path = CERTIFICATES / "super-twisting_1.5_1.1.json"
    code = (
        "import sys; from pathlib import Path; from quakedesign.lyapunov.exact.certificate_files import read_json; "
        "from quakedesign.rocq import rocq_text; sys.stdout.write(rocq_text(read_json(Path(sys.argv[1]))))"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "271828", "PYTHONIOENCODING": "utf-8"}
    told = subprocess.run([sys.executable, "-c", code, path], capture_output=True, check=True, env=environment).stdout
    assert told.decode() == rocq_text(read_json(path))


NO_THEOREM = ("guarantee", "sliding", "uncertain_plant", "stick_slip_aperiodic")
KINDS = {
    "motzkin_not-sos": "kind not-sos",
    "guarantee_lab-fault": "kind guarantee",
    "sliding_crustal-patch": "kind slow_sliding",
    "uncertain_plant_pendulum": "kind uncertain_plant",
}


@pytest.mark.parametrize(("name", "kind"), KINDS.items())
def test_a_kind_without_theorem_is_refused(name, kind):
    with pytest.raises(UnsupportedError, match=f"Received {kind}"):
        rocq_text(read_json(CERTIFICATES / f"{name}.json"))


def test_an_aperiodic_stick_slip_loop_is_refused():
    with pytest.raises(UnsupportedError, match="only periodic sampling"):
        rocq_text(read_json(CERTIFICATES / "stick_slip_aperiodic_real-fault.json"))


def test_a_point_that_refutes_an_attraction_is_refused():
    refuted = {key: ATTRACTION[key] for key in ("format", "kind", "variables", "field", "V")}
    with pytest.raises(UnsupportedError, match="Received a refutation of an attraction"):
        rocq_text(refuted | {"level": ["2"], "negative": {"point": ["1"]}})


def test_names_are_those_of_modules():
    assert module_name("cta_7_5_2.3_1.1") == "cta_7_5_2_3_1_1"
    assert module_name("2-cta") == "certificate_2_cta"


def test_two_certificates_of_one_name_are_refused_before_anything_is_written(tmp_path):
    paths = [tmp_path / "a.1.json", tmp_path / "a_1.json"]
    with pytest.raises(OutputError, match="twice"):
        write_rocq(paths, tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_the_command_writes_beside_its_verdict_and_replaces_only_by_force(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    source = CERTIFICATES / "motzkin_multiplier_sos.json"

    def run(*arguments):
        with pytest.raises(SystemExit) as ended:
            main(["check", str(source), *arguments])
        return ended.value.code, *capsys.readouterr()

    code, out, _ = run("--rocq", "--json")
    written = Path("quakedesign-rocq/motzkin_multiplier_sos.v")
    assert (code, json.loads(out)["rocq"]) == (0, {str(source): str(written)})
    assert written.read_text() == rocq_text(read_json(source))
    written.write_text("mine")
    assert run("--rocq")[0] == 2
    assert written.read_text() == "mine"
    assert run("--rocq", "--force")[0] == 0
    assert written.read_text() != "mine"
    assert run("--out", "elsewhere")[0] == 2
    code, out, _ = run(str(CERTIFICATES / "guarantee_lab-fault.json"), "--rocq", "--out", "both", "--json")
    assert code == 1
    assert None in json.loads(out)["rocq"].values()


# ---------------------------------------------------------------- with coqc

WRONG = """
Definition p := [term (1 # 1) [2; 0]; term (4 # 1) [1; 1]; term (1 # 1) [0; 2]].
Definition by_gram g := Witness 1 1 1 (power [0; 0]) [Square [] [power [1; 0]; power [0; 1]] g] [].
Definition odd := [term (1 # 1) [1; 0]].
Definition minus := [term (-1 # 1) [0; 0]].
Goal accepts (Question p [] []) (by_gram [[1; 1]; [1]]%Z) = false. Proof. vm_compute. reflexivity. Qed.
Goal is_zero (add (whole 1 p) (scale (-1) (expanded [[1; 2]; [1]]%Z [power [1; 0]; power [0; 1]]))) = true.
Proof. vm_compute. reflexivity. Qed.
Goal accepts (Question p [] []) (by_gram [[1; 2]; [1]]%Z) = false. Proof. vm_compute. reflexivity. Qed.
Goal square_definite (Square [] [power [1; 0]; power [0; 1]] [[1; 0]; []]%Z) = false. Proof. reflexivity. Qed.
Goal square_definite (Square [] [power [1; 0]; power [0; 1]] [[0; 0]; [1]]%Z) = false. Proof. reflexivity. Qed.
Goal square_definite (Square [] [power [1; 0]] [[1; 0]; [1]]%Z) = false. Proof. reflexivity. Qed.
Goal accepts (Question minus [] []) (Witness 1 1 1 Zero [] []) = true. Proof. reflexivity. Qed.
Goal nonnegative (Question minus [] []) (Witness 1 1 1 Zero [] []) Terms = false. Proof. vm_compute. reflexivity. Qed.
Goal on_cell (Question minus [] []) (Witness 1 1 1 Zero [] []) = false. Proof. vm_compute. reflexivity. Qed.
Definition x_times_x := Witness 1 1 1 (power [1; 0]) [Square [] [power [1; 0]] [[1]]%Z] [].
Goal accepts (Question odd [] []) x_times_x = true. Proof. vm_compute. reflexivity. Qed.
Goal nonnegative (Question odd [] []) x_times_x Terms = false. Proof. vm_compute. reflexivity. Qed.
Goal nonnegative (Question odd [odd] []) x_times_x Terms = true. Proof. vm_compute. reflexivity. Qed.
Goal nonnegative (Question odd [odd] [odd]) x_times_x Terms = false. Proof. vm_compute. reflexivity. Qed.
Goal nonnegative (Question odd [minus; odd] []) x_times_x Terms = false. Proof. vm_compute. reflexivity. Qed.
Goal negative (Question minus [odd] []) [(-1 # 2)%Q] [(-1 # 1)%Q; (-1 # 2)%Q] = false. Proof. reflexivity. Qed.
Goal negative (Question minus [] [odd]) [(1 # 2)%Q] [(-1 # 1)%Q] = false. Proof. vm_compute. reflexivity. Qed.
Goal negative (Question odd [] []) [0%Q] [0%Q] = false. Proof. vm_compute. reflexivity. Qed.
"""


@needs_coqc
def test_coqc_accepts_what_holds_and_no_changed_digit(tmp_path):
    """A loop, a polynomial on a set, thin multipliers, a point; each digit of them changed; what proves nothing."""
    parts = {name: statement_text(json.loads(json.dumps(raw))) for name, raw in BY_HAND.items()}
    changed = [goal_fails(other) for text in parts.values() for other in changed_digits(text)]
    modules = [module(name, text) for name, text in parts.items()]
    modules += [module(f"Changed{i}", text) for i, text in enumerate(changed)]
    code, out, err = compiled("\n".join([*library(), *modules, module("Wrong", WRONG)]), tmp_path)
    assert (code, err) == (0, "")
    loop, *others = out.split("Axioms:")[1:]
    assert axioms_of(loop) == ANALYSIS
    assert [axioms_of(other) for other in others] == [REALS] * 5
    assert len(changed) > 250


def by_hand(name):
    """A file that is made by hand for the standalone checker."""
    path = Path(__file__).parents[1] / "proofs" / "test_check.py"
    specification = importlib.util.spec_from_file_location("rocq_by_hand", path)
    made = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(made)
    return getattr(made, name)()


@needs_coqc
@pytest.mark.slow
def test_coqc_accepts_a_root_in_a_sign_and_no_changed_digit(tmp_path):
    text = statement_text(by_hand("nested_root_sign"))
    same = "Column 1 false; Column 1 false; Column 2 false]"  # the last is known by its sign alone, whatever its weight
    changed = [goal_fails(other) for other in changed_digits(text) if same not in other]
    modules = [module(f"Changed{i}", other) for i, other in enumerate(changed)]
    code, out, err = compiled("\n".join([*library(), module("Rooted", text), *modules]), tmp_path)
    assert (code, err) == (0, "")
    assert axioms_of(out) == ANALYSIS
    assert len(changed) > 300


@needs_coqc
@pytest.mark.parametrize(
    ("name", "axioms"),
    [("comparison", ANALYSIS), ("small_gain", ANALYSIS - {"Classical_Prop.classic"})],
)
def test_steps_of_the_argument_are_proved_from_the_same_axioms(name, axioms, tmp_path):
    text = (CERTIFICATES.parent / "rocq" / f"{name}.v").read_text(encoding="utf-8")
    code, out, err = compiled(text, tmp_path, name)
    assert (code, err) == (0, "")
    assert axioms_of(out) == axioms
    assert "Admitted" not in text


@needs_coqc
@pytest.mark.parametrize(
    ("stated", "wrong"),
    [
        ("0 < p -> solved (map", "p < 0 -> solved (map"),
        (
            "Forall (fun v => 0 <= v) (fst g)) gains ->\n  (forall",
            "Forall (fun v => v <= 0) (fst g)) gains ->\n  (forall",
        ),
        ("(b - dot r y) / p :: y", "(b + dot r y) / p :: y"),
    ],
    ids=["pivots", "signs of M", "solution"],
)
def test_another_statement_of_the_small_gain_is_refused(stated, wrong, tmp_path):
    text = (CERTIFICATES.parent / "rocq" / "small_gain.v").read_text(encoding="utf-8")
    assert text.count(stated) == 1
    assert compiled(text.replace(stated, wrong), tmp_path, "small_gain")[0] != 0


@needs_coqc
@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(CERTIFICATES.glob("*.json")), ids=lambda p: p.stem)
def test_coqc_accepts_the_catalogue(path, tmp_path):
    try:
        text = rocq_text(read_json(path))
    except UnsupportedError:
        assert path.stem == "motzkin_not-sos" or path.stem.startswith(NO_THEOREM)
        return
    code, out, err = compiled(text, tmp_path)
    assert (code, err) == (0, "")
    assert axioms_of(out) == (REALS if path.stem.startswith(("elqr", "motzkin")) else ANALYSIS)


def test_a_full_disk_leaves_no_folder(tmp_path, monkeypatch):
    def full(*_):
        raise OutputError("no space")

    monkeypatch.setattr(rocq_files, "write_whole", full)
    with pytest.raises(OutputError, match="no space"):
        write_rocq([CERTIFICATES / "super-twisting_1.5_1.1.json"], tmp_path / "a" / "b")
    assert list(tmp_path.iterdir()) == []
