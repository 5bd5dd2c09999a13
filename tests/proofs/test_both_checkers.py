"""The files made by hand for the standalone checker, and every way to break them, decided by the package."""

import importlib.util
import json
from pathlib import Path

import pytest
from thinned import some_or_all, spread

from quakedesign.errors import CertificateError
from quakedesign.lyapunov import parse_certificate
from quakedesign.lyapunov.exact import certificate as checking
from quakedesign.lyapunov.exact import certificate_files as term_files
from quakedesign.lyapunov.exact.certificate_files import read_json
from quakedesign.sos.exact import polynomial_files as files
from quakedesign.sos.exact import proofs, strict
from quakedesign.sos.exact import work_budget as work
from quakedesign.sos.exact.polynomial_files import load
from quakedesign.sos.exact.proofs import SumOfSquares, holds


def by_hand(name):
    """Tests of `proofs/check.py`, with their files and the checker."""
    specification = importlib.util.spec_from_file_location(f"{name}_by_hand", Path(__file__).with_name(f"{name}.py"))
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


FILES = Path(__file__).parents[2] / "proofs" / "certificates"
LOOPS, POLYNOMIALS = by_hand("test_check"), by_hand("test_check_polynomials")
REFUTATIONS = LOOPS.REFUTATIONS + POLYNOMIALS.FUNCTIONALS + POLYNOMIALS.POINTS
MADE = [(LOOPS, make) for make in LOOPS.PROOFS + LOOPS.REFUTATIONS] + [(POLYNOMIALS, make) for make in POLYNOMIALS.ALL]
BROKEN = [(kind, case) for kind in (LOOPS, POLYNOMIALS) for case in kind.BROKEN]
BROKEN.remove((POLYNOMIALS, "reduced basis too large"))  # which bounds the time of the standalone checker alone


def name(value):
    return getattr(value, "__name__", str(value))


@pytest.fixture(autouse=True)
def any_field(monkeypatch):
    """The laws made by hand are not laws of the package, so that their fields cannot be derived again."""
    monkeypatch.setattr(checking, "_same_field", lambda loop, law: None)


def by_package(document):
    text = json.dumps(document)
    try:
        if "polynomial" not in document:
            return str(parse_certificate(text).check())
        statement, proof = load(text)
    except CertificateError:
        return "refused"
    return ("proved" if isinstance(proof, SumOfSquares) else "refuted") if holds(statement, proof) else "refused"


def by_itself(kind, document):
    try:
        return kind.verify(document).verdict
    except kind.checker.Refused:
        return "refused"


@pytest.mark.parametrize(("kind", "make"), MADE, ids=name)
def test_what_is_made_by_hand_is_decided(kind, make):
    assert by_package(make()) == ("refuted" if make in REFUTATIONS else "proved")


@pytest.mark.parametrize(("kind", "case"), BROKEN, ids=name)
def test_what_breaks_a_rule_is_refused(kind, case):
    make, steps, _ = kind.BROKEN[case]
    assert by_package(kind.edited(make(), *steps)) == "refused"


@some_or_all
@pytest.mark.parametrize(("kind", "make"), MADE, ids=name)
def test_a_changed_number_is_decided_alike(kind, make, most):
    document = make()
    for path, value in spread(kind.leaves(document), most and 6):
        for new in kind.other_numbers(value):
            changed = kind.edited(document, (*path, new))
            assert by_package(changed) == by_itself(kind, changed), (path, new)


@pytest.mark.parametrize(
    "path", sorted(FILES.glob("*.json"), key=lambda file: file.stat().st_size)[:3], ids=lambda file: file.name
)
def test_a_byte_order_mark_is_refused_by_both(path, tmp_path, capsys):
    marked = tmp_path / "marked.json"
    marked.write_text(path.read_text(encoding="utf-8"), encoding="utf-8-sig")
    assert LOOPS.checker.report(str(marked)) != 0
    with pytest.raises(CertificateError, match="JSON"):
        read_json(marked)


LIMITS = {
    "ROOTS": "roots", "LIFTS": "lifts", "STATES": "states", "UNCERTAIN": "uncertain", "NUMBERS": "parameters",
    "TERMS": "terms", "BASIS": "basis", "OBLIGATIONS": "witnesses",
}  # fmt: skip


def test_both_checkers_have_the_same_limits():
    limits = {}
    for module in (
        "numbers",
        "squares",
        "polynomials",
        "functionals",
        "attraction",
        "lyapunov.loop",
        "lyapunov.stability",
    ):
        limits |= vars(LOOPS.checker.beside(module))

    def standalone(*names):
        return [limits[f"MAX_{name}"] for name in names]

    assert standalone(*LIMITS) == [term_files.LIMITS[name] for name in LIMITS.values()]
    assert standalone("POLYNOMIAL", "VARIABLES", "CONSTRAINTS", "PRODUCTS", "REDUCED") == [
        files.TERMS, files._VARIABLES, files._CONSTRAINTS, files._PRODUCTS, files._BASIS
    ]  # fmt: skip
    assert standalone("BYTES", "DENOMINATOR_BITS", "NESTING") == [strict.LARGEST_FILE, strict._GRID_BITS, strict._DEPTH]
    assert standalone("STEPS", "POLYNOMIAL", "MONOMIALS") == [work.STEPS, work.TERMS, proofs._MONOMIALS]
