"""What searches have found before is decided anew, answers what the presets ask, and is what they find."""

from dataclasses import replace
from fractions import Fraction

import pytest

from quakedesign import cache, load_fault, published
from quakedesign.laws import control_law
from quakedesign.lyapunov import Verdict, certificate_text, load_certificate
from quakedesign.lyapunov.search import lyapunov_search as kept
from quakedesign.lyapunov.search import lyapunov_search as search
from quakedesign.synthesis import assess
from quakedesign.synthesis.method import GainProblem
from quakedesign.synthesis.sliding_mode_design import _proved_base

FILES = sorted(kept.FOLDER.glob("*.json"))
PROOFS = [path for path in FILES if path.read_text(encoding="utf-8") != "null\n"]
SEARCH = search._of_degree.__wrapped__
PRESETS = ("real-fault", "lab-fault")


@pytest.mark.slow
@pytest.mark.parametrize("path", PROOFS, ids=lambda path: path.stem)
def test_every_certificate_that_is_kept_proves_its_claim_in_the_place_of_its_question(path):
    certificate = load_certificate(path)
    assert certificate.check() is Verdict.PROVED
    assert kept.path_of(certificate.loop, degree(certificate.loop)) == path


def degree(loop):
    """The first that a search tries."""
    return search.candidate_degrees(loop)[0]


def asked(monkeypatch):
    """Questions that the comparisons of the presets ask, and what they are answered."""
    found = []

    def noted(loop, degree, subject, answered=search._of_degree):
        found.append((kept.path_of(loop, degree), loop, answered(loop, degree, subject)))
        return found[-1][2]

    monkeypatch.setattr(search, "_of_degree", noted)
    monkeypatch.setattr(GainProblem, "judged", lambda self, controller, certificate=None, **more: certificate)
    for fault in map(load_fault, PRESETS):
        for name, controller in published(fault.name).items():
            assess(fault, controller)
            if control_law(name).loop_field().domain == "cells":
                _proved_base(fault, control_law(name))
    return found


@pytest.mark.slow
def test_what_the_presets_ask_is_kept_and_nothing_else(monkeypatch):
    monkeypatch.setattr(search, "family_of", lambda *_: pytest.fail("a search was begun"))
    questions = asked(monkeypatch)
    assert sorted({path for path, *_ in questions}) == FILES
    assert {path for path, _, found in questions if found} == set(PROOFS)


@pytest.mark.slow
def test_a_search_finds_as_much_again(monkeypatch):
    """V is not the only one: another kernel of linear algebra finds another, of the same terms and nearly as good."""
    for path, loop, known in asked(monkeypatch):
        again = SEARCH(loop, degree(loop), None)
        assert (again is None) == (known is None), path
        if known is not None:
            assert again.check() is Verdict.PROVED, path
            assert [t.factors for t in again.lyapunov] == [t.factors for t in known.lyapunov], path
            assert again.claims.keys() == known.claims.keys(), path
            assert all(2 / 3 < again.claims[name] / value < 3 / 2 for name, value in known.claims.items()), path


def test_a_file_that_proves_nothing_is_not_believed(monkeypatch, tmp_path):
    known = load_certificate(next(path for path in PROOFS if path.stem.startswith("cta")))
    monkeypatch.setattr(kept, "FOLDER", tmp_path)
    searched = kept.cached(lambda loop, degree, subject: "searched")
    assert searched(known.loop, 5, None) == "searched"
    kept.store(known.loop, 5, known)
    assert searched(known.loop, 5, None) == known
    place = kept.path_of(known.loop, 5)
    text = place.read_text(encoding="utf-8")
    for wrong in (text.replace('"positive":"', '"positive":"9', 1), text[: len(text) // 2], "", "{}"):
        assert wrong != text
        place.write_text(wrong, encoding="utf-8")
        assert searched(known.loop, 5, None) == "searched"


def test_another_degree_or_number_is_another_question():
    loop = load_certificate(PROOFS[0]).loop
    assert kept.path_of(loop, 5) != kept.path_of(loop, 7)
    assert kept.path_of(loop, 5) != kept.path_of(load_certificate(PROOFS[1]).loop, 5)


def test_what_was_searched_for_on_this_machine_is_decided_anew(monkeypatch, tmp_path):
    monkeypatch.setenv(cache.PLACE, str(tmp_path / "kept"))
    known = load_certificate(next(path for path in PROOFS if path.stem.startswith("cta")))
    searches = []

    def searched(loop, degree, subject):
        searches.append(loop)
        return known

    monkeypatch.setattr(kept, "FOLDER", tmp_path)
    answered = kept.cached(searched)
    assert [answered(known.loop, 5, None) for _ in range(2)] == [known, known]
    assert len(searches) == 1
    other = replace(known.loop, uncertain={**known.loop.uncertain, "d": (Fraction(-1, 9), Fraction(1, 9))})
    text = certificate_text(known).replace('"law": "cta"', '"law": "dia"')
    for planted in (certificate_text(known), text, "{"):
        monkeypatch.setattr(kept, "search_once", lambda *_, planted=planted: planted)
        answered(other, 5, None)
    assert searches[1:] == [other] * 3
