"""Numbers and sums of terms in a certificate file, read and written."""

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any

from quakedesign.certificates.claim import Loop
from quakedesign.rationals import exact_text
from quakedesign.sos.exact.strict import listed, need, read_rational
from quakedesign.symbolic.terms import Term

LIMITS = {
    "roots": 4,
    "lifts": 4,
    "states": 6,
    "uncertain": 8,
    "parameters": 64,
    "terms": 200,
    "basis": 200,
    "witnesses": 4096,
}
"""Largest number of each in a file."""


def read_terms(raw: Any, loop: Loop, powers: Sequence[str]) -> tuple[Term, ...]:
    """Sum of terms with powers of the given names; parameters are all others of the loop."""
    return tuple(_term(entry, loop, powers) for entry in listed(raw, "terms", LIMITS["terms"]))


def _term(raw: Any, loop: Loop, powers: Sequence[str]) -> Term:
    number, names, entries = listed(raw, "a term", length=3)
    coefficient = read_rational(number)
    need(coefficient != 0, "a term must not be zero")
    known = {*loop.gains, *loop.constants, *loop.ranges}
    parameters = tuple(listed(names, "parameters", 32))
    need(all(isinstance(n, str) and n in known for n in parameters), "a term has an unknown parameter")
    factors = tuple(_factor(entry, powers) for entry in listed(entries, "factors", len(powers)))
    need(len({f[0] for f in factors}) == len(factors), "a state occurs twice in a term")
    scaled = [power * loop.states.get(state, 0) for state, power, _ in factors]
    need(all(power.denominator == 1 for power in scaled), "an exponent times the weight of its state is no integer")
    return Term(coefficient, parameters, factors)


def _factor(raw: Any, powers: Sequence[str]) -> tuple[str, Fraction, str]:
    state, exponent, kind = listed(raw, "a factor", length=3)
    power = read_rational(exponent)
    need(state in powers, "a factor has an unknown state")
    need(
        kind in ("s", "a") and 0 <= power <= 24 and (kind == "s" or power > 0), "a factor has a wrong kind or exponent"
    )
    return state, power, kind


def texts(values: Mapping[str, Fraction]) -> dict[str, str]:
    """Numbers by name."""
    return {name: exact_text(v) for name, v in values.items()}
