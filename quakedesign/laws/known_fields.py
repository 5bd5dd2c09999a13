"""Closed loops of laws as plain data, and the cached loops of the package's laws.

The cached loops are in `derived.json` and are derived again by a test; other loops are derived with SymPy.
"""

import json
from collections.abc import Mapping
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from quakedesign import laws
from quakedesign.cache import shipped
from quakedesign.files import Json
from quakedesign.laws.field_terms import FieldTerms
from quakedesign.symbolic.terms import Term, plain

if TYPE_CHECKING:
    from quakedesign.laws.catalogue import Subject


FILE = Path(__file__).parent / "derived.json"
_NAMES = ("gains", "constants", "uncertain")
_SUMS = ("field", "lifts")


def field_of(subject: "Subject") -> tuple[str, FieldTerms]:
    """Name and closed loop of the subject of a claim; a bare loop is called ``custom``.

    Raises
    ------
    UnknownNameError
        For a name that the package does not know.
    CertificateError
        For parts that certificates cannot express.
    """
    if isinstance(subject, str) and subject in _stored():
        return subject, _stored()[subject]
    name, model = laws.model_of(subject)
    return name, model.terms


def is_law(name: str) -> bool:
    """Whether the package has a law of this name."""
    return name in _stored() or name in laws.laws()


def derived_again() -> str:
    """New content of `derived.json`, derived from the laws of the package."""
    lines = (f"{json.dumps(n)}: {json.dumps(_plain(law.loop_field().terms))}" for n, law in laws.laws().items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


@cache
def _stored() -> Mapping[str, FieldTerms]:
    return {name: _read(raw) for name, raw in shipped(FILE).items()}


def _plain(terms: FieldTerms) -> Json:
    sums = {part: {name: plain(own) for name, own in getattr(terms, part).items()} for part in _SUMS}
    names = {part: list(getattr(terms, part)) for part in _NAMES}
    return {"states": dict(terms.states), "domain": terms.domain, **names, "roots": dict(terms.roots), **sums}


def _read(raw: Mapping[str, Any]) -> FieldTerms:
    sums = {part: {name: tuple(map(_read_term, own)) for name, own in raw[part].items()} for part in _SUMS}
    return FieldTerms(**{**raw, **{part: tuple(raw[part]) for part in _NAMES}, **sums})


def _read_term(raw: Any) -> Term:
    number, parameters, factors = raw
    return Term(Fraction(number), tuple(parameters), tuple((s, Fraction(e), k) for s, e, k in factors))
