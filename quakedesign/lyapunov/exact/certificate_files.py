"""Certificate files (proofs/FORMAT.md): numbers, sums of terms, strict reading, writing.

The last chapter reads the kind of claim of a file without loading the code that decides it.
"""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from hashlib import sha256
from pathlib import Path
from typing import Any

from quakedesign.errors import CertificateError, UnsupportedError
from quakedesign.exact import LowerBound, UpperBound, exact_text
from quakedesign.files import read_text
from quakedesign.lyapunov.exact.claim import Equilibrium, Evidence, Loop, Witness
from quakedesign.sos.exact.proofs import Square
from quakedesign.sos.exact.strict import (
    LARGEST_FILE,
    NAME,
    common_grid,
    headed,
    listed,
    need,
    objected,
    parse,
    polynomial_text,
    read_ends,
    read_exponents,
    read_polynomial,
    read_rational,
    read_rationals,
    read_row,
    with_keys,
    write_readable,
)
from quakedesign.symbolic.terms import Term, plain

# ----------------------------------------------------------------------
# Numbers and sums of terms in a certificate file, read and written.

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


# ----------------------------------------------------------------------
# The certificate file (proofs/FORMAT.md): read strictly, written whole.

_LAW = re.compile(r"[A-Za-z0-9_-]{1,40}")


def read_json(path: str | Path) -> Any:
    """JSON value of a file of bounded size.

    Raises
    ------
    CertificateError
        When it cannot be read, or is no strict JSON.
    """
    text = read_text(path, "certificate", largest=LARGEST_FILE, refusal=CertificateError, marked=False)
    return parse(text)


def evidence_of(raw: Any) -> Evidence:
    """Evidence from a parsed file; reading verifies nothing.

    Raises
    ------
    CertificateError
        When it breaks a rule of FORMAT.md.
    UnsupportedError
        For a bound of outputs under inputs, which files of the kind ``guarantee`` have replaced.
    """
    if isinstance(raw, dict) and "inputs" in raw:
        raise UnsupportedError(
            "a file must be a proof, a refutation or of the kind guarantee. Received a bound under inputs, which is no "
            "longer read. Make the new file with certify elqr FAULT --gains K1 K2 K3 K4 --peaks CLASS --out FILE."
        )
    refutes = isinstance(raw, dict) and "refutation" in raw
    return _evidence(with_keys(headed(raw), _REFUTATION if refutes else _PROOF))


_COMMON = {"law", "gains", "constants", "states", "domain", "uncertain", "roots", "lifts", "field"}
_WITNESS = {"obligation", "multiplier", "squares", "equalities", "inequalities"}
_PROOF = _COMMON | {"V", "claims", "witnesses"}
_REFUTATION = _COMMON | {"refutation"}


def _evidence(raw: dict[str, Any]) -> Evidence:
    loop = _loop(raw)
    if "refutation" in raw:
        return Evidence(loop=loop, refutation=_equilibrium(raw["refutation"]))
    witnesses: dict[str, Witness] = {}
    for entry in listed(raw["witnesses"], "witnesses", LIMITS["witnesses"]):
        name = with_keys(entry, _WITNESS)["obligation"]
        need(isinstance(name, str) and name not in witnesses, "an obligation must be named once, by a text")
        witnesses[name] = _witness(entry, loop)
    return Evidence(
        loop=loop,
        lyapunov=read_terms(raw["V"], loop, tuple(loop.states)),
        claims=read_rationals(raw["claims"], "claims", 3 + LIMITS["states"]),
        witnesses=witnesses,
    )


def _loop(raw: dict[str, Any]) -> Loop:
    need(isinstance(raw["law"], str) and _LAW.fullmatch(raw["law"]) is not None, "law must be a short name")
    need(raw["domain"] in ("cells", "reals"), "domain must be cells or reals")
    gains = read_rationals(raw["gains"], "gains", LIMITS["parameters"])
    constants = read_rationals(raw["constants"], "constants", LIMITS["parameters"])
    states = objected(raw["states"], "states", LIMITS["states"])
    uncertain = objected(raw["uncertain"], "uncertain", LIMITS["uncertain"])
    lifts = objected(raw["lifts"], "lifts", LIMITS["lifts"])
    roots = objected(raw["roots"], "roots", LIMITS["roots"])
    names = [*gains, *constants, *states, *uncertain, *roots, *lifts]
    need(len(set(names)) == len(names) and len(gains) + len(constants) <= LIMITS["parameters"], "names must differ")
    need(all(NAME.fullmatch(n) for n in names) and states != {}, "states and uncertain need names")
    top = 12 if raw["domain"] == "cells" else 1
    need(all(type(w) is int and 1 <= w <= top for w in states.values()), f"weights must be integers from 1 to {top}")
    ranges: dict[str, tuple[Fraction, Fraction]] = {}
    for name, ends in uncertain.items():
        low, high = read_ends(ends, "a range")
        need(low <= high, f"the range of {name} is not ordered")
        ranges[name] = (low, high)
    known = {**gains, **constants}
    bare = Loop(
        law=raw["law"],
        gains=gains,
        constants=constants,
        states=states,
        domain=raw["domain"],
        uncertain=ranges,
        field={},
        roots={name: _root(entry, known) for name, entry in roots.items()},
    )
    powers = (*states, *lifts)
    arguments = {lift: read_terms(lifts[lift], bare, powers[: len(states) + i]) for i, lift in enumerate(lifts)}
    need(bare.domain == "cells" or not lifts, "lifts belong on cells")
    rates = with_keys(raw["field"], set(states))
    return replace(bare, lifts=arguments, field={state: read_terms(rates[state], bare, powers) for state in states})


def _root(raw: Any, known: dict[str, Fraction]) -> tuple[str, tuple[Fraction, Fraction]]:
    of, low, high = listed(raw, "a root", length=3)
    need(isinstance(of, str) and of in known, "a root must be one of a gain or constant")
    return of, (read_rational(low), read_rational(high))


def _witness(raw: dict[str, Any], loop: Loop) -> Witness:
    multiplier = read_polynomial(raw["multiplier"], "multiplier", None, LIMITS["basis"])
    need(multiplier != {}, "a multiplier must not be empty")
    variables = len(next(iter(multiplier)))
    need(len(loop.states) <= variables <= len(loop.states) + len(loop.lifts) + 1, "a multiplier has a wrong key")
    squares = _squares(raw["squares"], variables, loop, ())
    conditions = listed(raw["inequalities"], "inequalities", LIMITS["lifts"])
    for k, entries in enumerate(conditions):
        squares += _squares(entries, variables, loop, (variables + k,))
    cofactors = listed(raw["equalities"], "equalities", LIMITS["lifts"] + 1)
    return Witness(
        multiplier=multiplier,
        squares=tuple(squares),
        cofactors=tuple(read_polynomial(q, "a cofactor", variables, 20_000) for q in cofactors),
        conditions=len(conditions),
    )


def _squares(raw: Any, variables: int, loop: Loop, condition: tuple[int, ...]) -> list[Square]:
    squares = []
    for entry in listed(raw, "squares", 1 << variables):
        square = with_keys(entry, {"times", "basis", "gram"})
        times = read_exponents(square["times"], variables, 1 if loop.domain == "cells" else 0)
        gram = list(read_row(square["gram"], "gram"))
        common_grid(gram)
        basis = tuple(read_exponents(b, variables, 999) for b in listed(square["basis"], "basis", LIMITS["basis"]))
        size = len(basis)
        need(0 < size == len(set(basis)), "a basis must be a list of different exponents")
        squares.append(
            Square(
                product=(*(i for i, x in enumerate(times) if x), *condition),
                basis=basis,
                gram=tuple(listed(gram, "gram", length=size * (size + 1) // 2)),
            )
        )
    return squares


def _equilibrium(raw: Any) -> Equilibrium:
    entries = with_keys(raw, {"parameters", "point", "weights"})
    weights = objected(entries["weights"], "weights", 64)
    return Equilibrium(
        parameters=read_rationals(entries["parameters"], "parameters", LIMITS["uncertain"]),
        point=read_rationals(entries["point"], "point", LIMITS["states"]),
        weights={cell: read_rational(w) for cell, w in weights.items()},
    )


def certificate_text(certificate: Evidence) -> str:
    """Text of the file, the same for the same certificate."""
    return json.dumps(_plain(certificate), ensure_ascii=True, separators=(",", ":"), indent=None) + "\n"


def _plain(certificate: Evidence) -> dict[str, Any]:
    loop = certificate.loop
    document: dict[str, Any] = {
        "format": 1,
        "law": loop.law,
        "gains": texts(loop.gains),
        "constants": texts(loop.constants),
        "states": dict(loop.states),
        "domain": loop.domain,
        "uncertain": {name: list(map(exact_text, (low, high))) for name, (low, high) in loop.uncertain.items()},
        "roots": {name: [of, str(low), str(high)] for name, (of, (low, high)) in loop.roots.items()},
        "lifts": {lift: plain(terms) for lift, terms in loop.lifts.items()},
        "field": {state: plain(terms) for state, terms in loop.field.items()},
    }
    if certificate.refutation is not None:
        equilibrium = certificate.refutation
        parts = {"parameters": equilibrium.parameters, "point": equilibrium.point, "weights": equilibrium.weights}
        return document | {"refutation": {key: texts(values) for key, values in parts.items()}}
    witnesses = [_plain_witness(name, witness) for name, witness in certificate.witnesses.items()]
    return document | {
        "V": plain(certificate.lyapunov),
        "claims": texts(certificate.claims),
        "witnesses": witnesses,
    }


def _plain_witness(name: str, witness: Witness) -> dict[str, Any]:
    variables = len(next(iter(witness.multiplier)))

    def squares(condition: int | None) -> list[dict[str, Any]]:
        return [_plain_square(s, variables) for s in witness.squares if _condition(s, variables) == condition]

    return {
        "obligation": name,
        "multiplier": polynomial_text(witness.multiplier),
        "squares": squares(None),
        "equalities": [polynomial_text(q) for q in witness.cofactors],
        "inequalities": [squares(k) for k in range(witness.conditions)],
    }


def _condition(square: Square, variables: int) -> int | None:
    return next((i - variables for i in square.product if i >= variables), None)


def _plain_square(square: Square, variables: int) -> dict[str, Any]:
    times = [int(i in square.product) for i in range(variables)]
    return {"times": times, "basis": [list(b) for b in square.basis], "gram": list(map(exact_text, square.gram))}


def save_certificate(certificate: Evidence, path: str | Path) -> None:
    """Write a certificate file whole or not at all, and only if it can be read again.

    Raises
    ------
    OutputError
        When the folder cannot be written.
    CertificateError
        When the certificate is beyond the limits of the format, such as numbers of more than 400 digits.
    """
    write_readable(path, certificate_text(certificate), lambda text: evidence_of(parse(text)))


# ----------------------------------------------------------------------
# Which claim a parsed file makes: told without loading what decides each of them.

GUARANTEE, SLOW_SLIDING, STICK_SLIP, ATTRACTION = "guarantee", "slow_sliding", "stick_slip", "attraction"
UNCERTAIN_PLANT = "uncertain_plant"
_KINDS = GUARANTEE, SLOW_SLIDING, STICK_SLIP, ATTRACTION, UNCERTAIN_PLANT
POLYNOMIAL, LOOP = "polynomial", "loop"


def kind_of(raw: Any) -> str:
    """What a parsed file says that it is, else what its keys say: about a polynomial, or a closed loop."""
    if not isinstance(raw, dict):
        return LOOP
    said = next((kind for kind in _KINDS if raw.get("kind") == kind), None)
    return said or (POLYNOMIAL if "polynomial" in raw else LOOP)


# ----------------------------------------------------------------------
# All that a claim about a loop that runs depends on, as lines below its sentence; those of proofs/check.py.

_HEADED = {"format", "kind", "claims"}
_NAMED = {"name", "states"}  # nothing depends on them
_MOST_LISTED = 64
_MOST_CHARACTERS = 24
_DIGITS = 6


def entry_lines(document: Mapping[str, Any]) -> list[str]:
    """Every entry of a file of `guarantee_text` but names: a line for each of its parts, its claims and its SHA-256.

    Parameters
    ----------
    document : mapping
        Parsed file; a claim is worth as much as it was read from, so that its own document is the one to give.
    """
    stated = {key: _without_names(part) for key, part in document.items() if key not in _HEADED}
    claims = []
    for name, value in sorted(document["claims"].items()):
        bound = LowerBound if name.startswith("least") else UpperBound
        claims.append(f"{name} {bound(value):.{_DIGITS}g}")
    exact = json.dumps(stated, sort_keys=True, separators=(",", ":")).encode()
    lines = ["entries, in SI units of FORMAT.md; ~ is rounded to nearest, claims outward:"]
    lines += [f"{key}: {_part(part)}" for key, part in sorted(stated.items())]
    lines.append("claims: " + ", ".join(claims))
    return [*lines, f"SHA-256 of the entries without claims: {sha256(exact).hexdigest()}"]


def _without_names(part: Any) -> Any:
    if not isinstance(part, dict):
        return part
    return {key: _without_names(entry) for key, entry in part.items() if key not in _NAMED}


def _part(part: Any) -> str:
    return "; ".join(_phrases(part, ())) if isinstance(part, dict) else _entry(part)


def _phrases(part: dict[str, Any], path: tuple[str, ...]) -> list[str]:
    """Entries that are no objects behind the path to them, then those of every object."""
    inner = {key: entry for key, entry in sorted(part.items()) if isinstance(entry, dict)}
    own = ", ".join(f"{key} {_entry(entry)}" for key, entry in sorted(part.items()) if key not in inner)
    found = [" ".join((*path, own))] if own else []
    return found + [phrase for key, entry in inner.items() for phrase in _phrases(entry, (*path, key))]


def _entry(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + _part(value) + "}"
    if isinstance(value, list):
        count = _leaves(value)
        return f"({count} entries)" if count > _MOST_LISTED else f"[{', '.join(map(_entry, value))}]"
    return _number(value) if isinstance(value, str) and value.lstrip("-")[:1].isdigit() else str(value)


def _leaves(value: Any) -> int:
    """Entries of nested lists; an empty one counts as one."""
    if isinstance(value, dict):
        return sum(map(_leaves, value.values()))
    return sum(map(_leaves, value)) or 1 if isinstance(value, list) else 1


def _number(text: str) -> str:
    """A rational as a decimal of at most 15 digits or a short fraction, if it is one, else rounded."""
    value = Fraction(text)
    about = Decimal(value.numerator) / Decimal(value.denominator)
    decimal = f"{float(about):.15g}"
    if "inf" not in decimal and Fraction(decimal) == value:
        return decimal
    return text if len(text) <= _MOST_CHARACTERS else f"~{about:.{_DIGITS}g}"
