"""Files that state different things never print the same text: every entry of every kind of file, in both checkers."""

import copy
import importlib.util
import json
import re
from fractions import Fraction as F
from pathlib import Path

import pytest
from standalone_guarantee import CHECK
from stick_slip_box import box
from thinned import some_or_all

from quakedesign.checking import check_files
from quakedesign.errors import CertificateError
from quakedesign.guarantees import guarantee_document, read_guarantee
from quakedesign.lyapunov.exact import certificate as checking
from quakedesign.lyapunov.exact.certificate_files import entry_lines

CERTIFICATES = Path(__file__).parents[2] / "proofs" / "certificates"
RATIONAL = re.compile(r"-?\d+(/\d+)?")


def beside(name):
    """Another module of tests, with the files that it makes by hand."""
    specification = importlib.util.spec_from_file_location(f"{name}_differ", Path(__file__).with_name(f"{name}.py"))
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


LOOPS, POLYNOMIALS = beside("test_check"), beside("test_check_polynomials")
REGIONS, GUARANTEES = beside("test_check_attraction"), beside("test_guarantee_reading")
entries = CHECK.beside("guarantee.reading").entries


def numbers(value, path=()):
    """Every rational but 0 and every integer of a document, with the path to it."""
    if isinstance(value, dict | list):
        for key, entry in value.items() if isinstance(value, dict) else enumerate(value):
            yield from numbers(entry, (*path, key))
    elif (isinstance(value, str) and RATIONAL.fullmatch(value) and F(value)) or type(value) is int:
        yield path, value


def others(value):
    """Two per cent more and less; of an integer the next one."""
    return [value + 1] if type(value) is int else [str(F(value) * share) for share in (F(51, 50), F(49, 50))]


def changed(document, path, new):
    document = copy.deepcopy(document)
    holder = document
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = new
    return document


def variants(document):
    return [(path, changed(document, path, new)) for path, value in numbers(document) for new in others(value)]


def tried(document, most):
    """Every number changed once; in every way if there is no bound."""
    return variants(document) if most is None else dict(variants(document)).items()


def standalone(document):
    try:
        found = CHECK.check(json.dumps(document))
    except CHECK.Refused:
        return None
    return found.verdict, found.statement


def package(document, folder):
    (folder / "file.json").write_text(json.dumps(document))
    ((verdict, said),) = check_files([folder / "file.json"]).values()
    return (verdict, said) if verdict in ("proved", "refuted") else None


BY_HAND = [*LOOPS.PROOFS, *LOOPS.REFUTATIONS, *POLYNOMIALS.ALL,
           REGIONS.cubic, REGIONS.everywhere, REGIONS.refuted, REGIONS.turning]  # fmt: skip


@pytest.mark.parametrize("make", BY_HAND, ids=lambda make: make.__name__)
@some_or_all
def test_a_proof_with_another_number_is_refused_or_says_so(make, most, tmp_path, monkeypatch):
    monkeypatch.setattr(checking, "_same_field", lambda loop, law: None)
    document = make()
    said = standalone(document), package(document, tmp_path)
    assert None not in said
    for path, other in tried(document, most):
        assert standalone(other) != said[0], path
        assert package(other, tmp_path) != said[1], path


def start(raw):
    return raw | {"start": {"slip": "1/9", "rate": "1/7"}}


FREE = GUARANTEES.changed(GUARANTEES.HELD, (("loop", "longest"), "2")) | {
    "reach": {"inputs": ["1", "2"], "facets": [["1", "1/3", "1"]], "at_samples": [[[0]]], "between": [[[0]]]}
}
SLIDING = json.loads((CERTIFICATES / "sliding_crustal-patch.json").read_text())
SLIDING["fault"]["density"] = "1"
SLIDING["reference"]["swing"] = "1/10"
GIVEN = {
    "jitter": GUARANTEES.changed(GUARANTEES.JITTERY, (("loop", "jitter", "mean"), "1/9")),
    "start": start(GUARANTEES.changed(GUARANTEES.HELD, (("loop", "first"), [["1", "2"]]))),
    "limits": GUARANTEES.changed(GUARANTEES.PUMPED, (("loop", "applied"), ["1/7"])),
    "sliding": SLIDING,
    "sticking": box(),
    "stored": json.loads((CERTIFICATES / "guarantee_real-fault.json").read_text()),
} | {name.lower(): getattr(GUARANTEES, name) for name in ("ROOTED", "BEHIND", "CONTINUOUS", "LAYERED", "NOISY", "BOTH")}


def reread(document):
    """Entries as the package reads them; None where it refuses the file."""
    try:
        return entry_lines(guarantee_document(read_guarantee(document)))
    except CertificateError:
        return None


@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize("document", GIVEN.values(), ids=GIVEN)
@some_or_all
def test_every_entry_of_a_guarantee_stands_below_it_whatever_is_proved(document, most, monkeypatch):
    said = entries(document)
    assert reread(document) == said
    for path, other in tried(document, most):
        if path == ("format",):
            continue
        assert entries(other) != said, path
        assert reread(other) in (None, entries(other)), path


coarse = GUARANTEES.coarse


def test_names_are_no_entries():
    other = GUARANTEES.changed(GUARANTEES.HELD, (("fault", "name"), "another"), (("loop", "states"), ["y"]))
    assert entries(other) == entries(GUARANTEES.HELD)
    assert "another" not in " ".join(reread(other))


def test_numbers_are_themselves_or_marked_and_claims_lie_outside():
    document = GUARANTEES.changed(
        GUARANTEES.HELD,
        (("disturbance", "amplitude"), "1/" + "3" * 40),
        (("fault", "density"), "7" * 30),
        (("fault", "length"), "1" + "0" * 399),
        (("claims", "slip_error"), "1/3"),
        (("claims", "least_pressure"), "-1/3"),
    )
    said = "\n".join(reread(document))
    assert "disturbance: amplitude ~3.00000e-40, change 1/7; growths rate -1/9, slip 1/9\n" in said
    assert "density ~7.77778e+29, length ~1.00000e+399, normal_stress 9, " in said
    assert "least_pressure -0.333334" in said
    assert "slip_error 0.333334" in said


@pytest.mark.parametrize("many", [1, 70])
@some_or_all
def test_long_lists_are_counted_and_still_tell_files_apart(many, most):
    document = changed(FREE, ("reach", "facets"), [["1", "1/3", "1"]] * many)
    document = changed(document, ("reach", "at_samples"), [[[0]]] * many)
    said = entries(document)
    assert entry_lines(document) == said
    assert any("at_samples (70 entries), between [[[0]]], facets (210 entries)" in line for line in said) is (many > 1)
    for path, other in tried(document, most):
        if path != ("format",):
            assert entries(other) != said, path
            assert entry_lines(other) == entries(other), path


def on(inequalities=(), equalities=(), squares=(), polynomial=None):
    """x >= 0, as c(-1 - x²) + (c + x + c x²) on the set of the first inequality for c = 1."""
    plain = {"product": [], "basis": [[0], [1]], "gram": ["1", "1/2", "1"]}
    document = {"format": 1, "variables": ["x"], "polynomial": polynomial or {"1": "1"},
                "inequalities": [*inequalities], "equalities": [*equalities], "products": [[], [0]][: 1 + len(squares)],
                "degree": 2, "multiplier": {"0": "1"}}  # fmt: skip
    cofactors = [{"0": "1"}] * len(equalities)
    return document | {"sos": {"squares": [plain, *squares], "cofactors": cofactors, "multiplier": []}}


ON_FIRST = {"product": [0], "basis": [[0]], "gram": ["1"]}
VACUOUS = "the set is empty, so the statement holds trivially"
SETS = [
    (on([{"0": "-1", "2": "-1"}], squares=[ON_FIRST]), True),
    (on(equalities=[{"0": "-1", "2": "-1"}]), True),
    (on([{"0": "1", "2": "-1"}], squares=[ON_FIRST], polynomial={"0": "2", "1": "1"}), False),
    (on([{"2": "-1"}], squares=[ON_FIRST], polynomial={"0": "1", "1": "1"}), False),
    (on([{"0": "-1", "1": "-1"}], squares=[ON_FIRST], polynomial={"2": "1"}), False),
]


@pytest.mark.parametrize(("document", "empty"), SETS)
def test_a_proof_on_a_set_without_points_says_so(document, empty, tmp_path):
    for verdict, said in (standalone(document) or ("", []), package(document, tmp_path) or ("", [])):
        if verdict:
            assert (verdict, VACUOUS in said) == ("proved", empty)
        else:
            assert not empty


def test_a_guarantee_without_disturbance_or_distance_says_so():
    still = GUARANTEES.changed(GUARANTEES.HELD, (("disturbance", "amplitude"), "0"))
    claims = dict.fromkeys(GUARANTEES.CLAIMS, F(1))
    said = CHECK.beside("guarantee.tracking").statement(still, GUARANTEES.checker.read_task(still), claims, F(1, 3))
    assert "disturbance: none (amplitude 0); from rest" in "".join(said)
    assert "without disturbance" in read_guarantee(still).sentence()
    sliding = CHECK.beside("guarantee.slow_sliding")
    for distance, stress in (("0", "1"), ("1", "0"), ("1", "1")):
        given = changed(changed(SLIDING, ("reference", "distance"), distance), ("stress",), stress)
        bounds = {name: F(value) for name, value in given["claims"].items()}
        text = " ".join(sliding.statement(given, sliding.read_fault(given), bounds, 1, F(1, 2)))
        sentence = read_guarantee(given).sentence()
        assert ("vacuous" in text, "vacuous" in sentence) == (distance == "0",) * 2
        assert ("none (stress 0)" in text, "without disturbance" in sentence) == (stress == "0",) * 2


@pytest.mark.slow
@pytest.mark.parametrize("name", ["guarantee_lab-fault", "sliding_crustal-patch"])
def test_a_stored_guarantee_with_another_number_is_refused_or_says_so(name, tmp_path):
    document = json.loads((CERTIFICATES / f"{name}.json").read_text())
    said = standalone(document), package(document, tmp_path)
    for path, other in variants(document):
        assert standalone(other) != said[0], path
        assert package(other, tmp_path) != said[1], path
