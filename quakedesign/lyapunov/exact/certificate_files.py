"""Certificate files (proofs/FORMAT.md): numbers, sums of terms, strict reading, writing.

The module also determines the kind of claim of a file without loading the code that checks the claim.
"""

import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, Literal

from msgspec import Meta

from quakedesign.errors import CertificateError, UnsupportedError
from quakedesign.exact import LowerBound, UpperBound
from quakedesign.files import Json, read_text
from quakedesign.lyapunov.exact.claim import Equilibrium, Evidence, Loop, Witness
from quakedesign.sos.exact.proofs import Square
from quakedesign.sos.exact.strict import (
    LARGEST_FILE,
    Entries,
    Name,
    PolynomialEntries,
    common_grid,
    headed,
    made,
    need,
    parse,
    read_as,
    require_polynomial,
    write_readable,
    written,
)
from quakedesign.symbolic.terms import Term

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
"""Largest number of entries of each kind in a file."""

Numbers = dict[Name, Fraction]
Exponents = tuple[Annotated[int, Meta(ge=0, le=999)], ...]
FactorEntries = tuple[str, Fraction, Literal["s", "a"]]
TermEntries = tuple[Fraction, Annotated[tuple[str, ...], Meta(max_length=32)], tuple[FactorEntries, ...]]
Terms = Annotated[tuple[TermEntries, ...], Meta(max_length=LIMITS["terms"])]


class LoopEntries(Entries):
    """A closed loop, see `Loop`."""

    law: Annotated[str, Meta(pattern=r"\A[A-Za-z0-9_-]{1,40}\Z")]
    gains: Numbers
    constants: Numbers
    states: Annotated[dict[Name, int], Meta(min_length=1, max_length=LIMITS["states"])]
    domain: Literal["cells", "reals"]
    uncertain: Annotated[dict[Name, tuple[Fraction, Fraction]], Meta(max_length=LIMITS["uncertain"])]
    roots: Annotated[dict[Name, tuple[str, Fraction, Fraction]], Meta(max_length=LIMITS["roots"])]
    lifts: Annotated[dict[Name, Terms], Meta(max_length=LIMITS["lifts"])]
    field: dict[Name, Terms]

    def loop(self) -> Loop:
        """Loop of the entries, after checks that its names are distinct and that its terms contain no other names."""
        names = [*self.gains, *self.constants, *self.states, *self.uncertain, *self.roots, *self.lifts]
        few = len(self.gains) + len(self.constants) <= LIMITS["parameters"]
        need(len(set(names)) == len(names) and few, f"names must differ, parameters at most {LIMITS['parameters']}")
        top = 12 if self.domain == "cells" else 1
        need(all(1 <= w <= top for w in self.states.values()), f"weights must be integers from 1 to {top}")
        for name, (low, high) in self.uncertain.items():
            need(low <= high, f"the range of {name} is not ordered")
        symbols = {*self.gains, *self.constants}
        need(
            all(of in symbols for of, *_ in self.roots.values()), "a root must be the square root of a gain or constant"
        )
        roots = {name: (of, (low, high)) for name, (of, low, high) in self.roots.items()}
        bare = made(Loop, self, field={}, roots=roots, lifts={})
        powers = (*self.states, *self.lifts)
        need(self.domain == "cells" or not self.lifts, "lifts require the domain 'cells'")
        lifts = {
            lift: terms_of(self.lifts[lift], bare, powers[: len(self.states) + i]) for i, lift in enumerate(self.lifts)
        }
        need(set(self.field) == set(self.states), "field must have a list of terms for every state")
        return replace(
            bare, lifts=lifts, field={state: terms_of(self.field[state], bare, powers) for state in self.states}
        )


def terms_of(entries: tuple[TermEntries, ...], loop: Loop, powers: Sequence[str]) -> tuple[Term, ...]:
    """Sum of terms in powers of the given names; gains, constants, uncertain parameters and roots are parameters."""
    parameters = {*loop.gains, *loop.constants, *loop.ranges}
    for coefficient, names, factors in entries:
        need(coefficient != 0, "a term must not be zero")
        need(parameters.issuperset(names), "a term has an unknown parameter")
        need(len({f[0] for f in factors}) == len(factors), "a state occurs twice in a term")
        for state, power, kind in factors:
            need(state in powers, "a factor has an unknown state")
            need(0 <= power <= 24 and (kind == "s" or power > 0), f"exponent {power} of {state} is outside its range")
            whole = (power * loop.states.get(state, 0)).denominator == 1
            need(whole, f"the exponent {power} times the weight of {state} is not an integer")
    return tuple(Term(*entry) for entry in entries)


def term_entries(terms: Iterable[Term]) -> tuple[TermEntries, ...]:
    """Entries of a sum of terms."""
    return tuple((term.coefficient, term.parameters, term.factors) for term in terms)  # type: ignore[misc]


class SquareEntries(Entries):
    """A square and the variables that multiply it."""

    times: Exponents
    basis: Annotated[tuple[Exponents, ...], Meta(max_length=LIMITS["basis"])]
    gram: tuple[Fraction, ...]


class WitnessEntries(Entries):
    """Squares and cofactors of one obligation."""

    obligation: str
    multiplier: PolynomialEntries
    squares: tuple[SquareEntries, ...]
    equalities: Annotated[tuple[PolynomialEntries, ...], Meta(max_length=LIMITS["lifts"] + 1)]
    inequalities: Annotated[tuple[tuple[SquareEntries, ...], ...], Meta(max_length=LIMITS["lifts"])]

    def witness(self, loop: Loop) -> Witness:
        """Witness; its sizes must match the loop."""
        most = LIMITS["basis"]
        need(self.multiplier != {} and len(self.multiplier) <= most, f"a multiplier must have 1 to {most} terms")
        n, states = len(next(iter(self.multiplier))), len(loop.states)
        most_variables = states + len(loop.lifts) + 1
        need(states <= n <= most_variables, f"a multiplier must have {states} to {most_variables} variables, got {n}")
        for cofactor in self.equalities:
            require_polynomial(cofactor, "a cofactor", n, 20_000)
        squares = _squares(self.squares, n, loop, ())
        for k, entries in enumerate(self.inequalities):
            squares += _squares(entries, n, loop, (n + k,))
        return Witness(
            multiplier=dict(self.multiplier),
            squares=squares,
            cofactors=tuple(dict(q) for q in self.equalities),
            conditions=len(self.inequalities),
        )


def _squares(
    entries: tuple[SquareEntries, ...], variables: int, loop: Loop, condition: tuple[int, ...]
) -> tuple[Square, ...]:
    need(len(entries) <= 1 << variables, f"a witness must have at most {1 << variables} squares, got {len(entries)}")
    top = 1 if loop.domain == "cells" else 0
    for entry in entries:
        need(len(entry.times) == variables and max(entry.times) <= top, f"times must be integers from 0 to {top}")
        common_grid(entry.gram)
        size = len(entry.basis)
        fit = all(len(b) == variables for b in entry.basis) and 0 < size == len(set(entry.basis))
        need(fit, f"a basis must be a nonempty list of distinct exponents of {variables} variables")
        need(len(entry.gram) == size * (size + 1) // 2, "gram must have one entry per pair of basis monomials")
    return tuple(
        Square(product=(*(i for i, x in enumerate(e.times) if x), *condition), basis=e.basis, gram=e.gram)
        for e in entries
    )


class RefutationEntries(Entries):
    """An equilibrium away from the origin."""

    parameters: Annotated[Numbers, Meta(max_length=LIMITS["uncertain"])]
    point: Annotated[Numbers, Meta(max_length=LIMITS["states"])]
    weights: Annotated[dict[str, Fraction], Meta(max_length=64)]


class ProofFile(LoopEntries):
    """Entries of a file with a proof, without its entry ``format``."""

    V: Terms
    claims: Annotated[Numbers, Meta(max_length=3 + LIMITS["states"])]
    witnesses: Annotated[tuple[WitnessEntries, ...], Meta(max_length=LIMITS["witnesses"])]


class RefutationFile(LoopEntries):
    """Entries of a file with a refutation, without its entry ``format``."""

    refutation: RefutationEntries


# ----------------------------------------------------------------------
# The certificate file (proofs/FORMAT.md): read strictly, written atomically.


def read_json(path: str | Path) -> Any:
    """JSON value of a file of bounded size.

    Raises
    ------
    CertificateError
        If the file is not readable, or is not strict JSON.
    """
    text = read_text(path, "certificate", largest=LARGEST_FILE, refusal=CertificateError, marked=False)
    return parse(text)


def evidence_of(raw: object) -> Evidence:
    """Evidence from a parsed file, without a check of the proof.

    Raises
    ------
    CertificateError
        When the file breaks a rule of FORMAT.md.
    UnsupportedError
        For the obsolete file kind with bounds of outputs under inputs, which the kind ``guarantee`` replaces.
    """
    if isinstance(raw, dict) and {"inputs", "outputs"} <= raw.keys():
        raise UnsupportedError(
            "a file must contain a proof, a refutation or a guarantee. Received an obsolete bound under inputs. "
            "Write a new file with certify elqr FAULT --gains K1 K2 K3 K4 --peaks CLASS --out FILE."
        )
    entries = headed(raw)
    if "refutation" in entries:
        refuted = read_as(RefutationFile, entries)
        return Evidence(loop=refuted.loop(), refutation=made(Equilibrium, refuted.refutation))
    file = read_as(ProofFile, entries)
    loop, names = file.loop(), [witness.obligation for witness in file.witnesses]
    need(len(set(names)) == len(names), "an obligation must have only one witness")
    return Evidence(
        loop=loop,
        lyapunov=terms_of(file.V, loop, tuple(loop.states)),
        claims=file.claims,
        witnesses={witness.obligation: witness.witness(loop) for witness in file.witnesses},
    )


def certificate_text(certificate: Evidence) -> str:
    """Text of the file, reproducible for a given certificate."""
    loop, refutation = certificate.loop, certificate.refutation
    parts: Json = {
        "roots": {name: (of, *ends) for name, (of, ends) in loop.roots.items()},
        "lifts": {lift: term_entries(terms) for lift, terms in loop.lifts.items()},
        "field": {state: term_entries(terms) for state, terms in loop.field.items()},
    }
    if refutation is not None:
        file: LoopEntries = made(RefutationFile, loop, refutation=made(RefutationEntries, refutation), **parts)
    else:
        witnesses = tuple(_witness_entries(name, one) for name, one in certificate.witnesses.items())
        parts |= {"V": term_entries(certificate.lyapunov), "claims": certificate.claims, "witnesses": witnesses}
        file = made(ProofFile, loop, **parts)
    return json.dumps({"format": 1} | written(file), ensure_ascii=True, separators=(",", ":")) + "\n"


def _witness_entries(name: str, witness: Witness) -> WitnessEntries:
    n = len(next(iter(witness.multiplier)))

    def squares(condition: int | None) -> tuple[SquareEntries, ...]:
        chosen = (s for s in witness.squares if next((i - n for i in s.product if i >= n), None) == condition)
        return tuple(made(SquareEntries, s, times=tuple(int(i in s.product) for i in range(n))) for s in chosen)

    return WitnessEntries(
        obligation=name,
        multiplier=PolynomialEntries(witness.multiplier),
        squares=squares(None),
        equalities=tuple(map(PolynomialEntries, witness.cofactors)),
        inequalities=tuple(squares(k) for k in range(witness.conditions)),
    )


def save_certificate(certificate: Evidence, path: str | Path) -> None:
    """Write a certificate file atomically, and only if it can be read back.

    Raises
    ------
    OutputError
        When the folder is not writable.
    CertificateError
        If the certificate exceeds a limit of the format, such as 400 digits per number.
    """
    write_readable(path, certificate_text(certificate), lambda text: evidence_of(parse(text)))


# ----------------------------------------------------------------------
# The kind of claim of a parsed file, determined without loading the code that checks it.

GUARANTEE, SLOW_SLIDING, STICK_SLIP, ATTRACTION = "guarantee", "slow_sliding", "stick_slip", "attraction"
UNCERTAIN_PLANT = "uncertain_plant"
_KINDS = GUARANTEE, SLOW_SLIDING, STICK_SLIP, ATTRACTION, UNCERTAIN_PLANT
POLYNOMIAL, LOOP = "polynomial", "loop"


def kind_of(raw: object) -> str:
    """Kind that a parsed file states; if it states none, ``polynomial`` or ``loop``, by its keys."""
    if not isinstance(raw, dict):
        return LOOP
    named = next((kind for kind in _KINDS if raw.get("kind") == kind), None)
    return named or (POLYNOMIAL if "polynomial" in raw else LOOP)


# ----------------------------------------------------------------------
# Lines printed below the sentence of a guarantee: every entry on which it depends. proofs/check.py prints the same.

_HEADED = {"format", "kind", "claims"}
_NAMED = {"name", "states"}  # claims do not depend on them
_MOST_LISTED = 64
_MOST_CHARACTERS = 24
_DIGITS = 6


def entry_lines(document: Json) -> list[str]:
    """Lines with the entries of a guarantee file except names: one per part, then the claims and the SHA-256.

    Parameters
    ----------
    document : mapping
        Parsed file, the very document from which the claim was read.
    """
    stated = {key: _without_names(part) for key, part in document.items() if key not in _HEADED}
    claims = []
    for name, value in sorted(document["claims"].items()):
        bound = LowerBound if name.startswith("least") else UpperBound
        claims.append(f"{name} {bound(value):.{_DIGITS}g}")
    exact = json.dumps(stated, sort_keys=True, separators=(",", ":")).encode()
    lines = ["entries in SI units, see FORMAT.md; ~ marks rounding to nearest, claims are rounded outward:"]
    lines += [f"{key}: {_part(part)}" for key, part in sorted(stated.items())]
    lines.append("claims: " + ", ".join(claims))
    return [*lines, f"SHA-256 of the entries without claims: {sha256(exact).hexdigest()}"]


def _without_names(part: object) -> object:
    if not isinstance(part, dict):
        return part
    return {key: _without_names(entry) for key, entry in part.items() if key not in _NAMED}


def _part(part: object) -> str:
    return "; ".join(_phrases(part, ())) if isinstance(part, dict) else _entry(part)


def _phrases(part: Json, path: tuple[str, ...]) -> list[str]:
    """Phrase of the path and all plain entries of a part, then the phrases of its nested objects."""
    inner = {key: entry for key, entry in sorted(part.items()) if isinstance(entry, dict)}
    own = ", ".join(f"{key} {_entry(entry)}" for key, entry in sorted(part.items()) if key not in inner)
    phrases = [" ".join((*path, own))] if own else []
    return phrases + [phrase for key, entry in inner.items() for phrase in _phrases(entry, (*path, key))]


def _entry(value: object) -> str:
    match value:
        case dict():
            return "{" + _part(value) + "}"
        case list():
            count = _leaves(value)
            return f"({count} entries)" if count > _MOST_LISTED else f"[{', '.join(map(_entry, value))}]"
        case str() if value.lstrip("-")[:1].isdigit():
            return _number(value)
    return str(value)


def _leaves(value: object) -> int:
    """Number of plain entries of nested lists and objects; an empty list counts as one."""
    match value:
        case dict():
            return sum(map(_leaves, value.values()))
        case list():
            return sum(map(_leaves, value)) or 1
    return 1


def _number(text: str) -> str:
    """Rational as an exact decimal of at most 15 digits or short fraction if possible, otherwise rounded."""
    value = Fraction(text)
    about = Decimal(value.numerator) / Decimal(value.denominator)
    decimal = f"{float(about):.15g}"
    if "inf" not in decimal and Fraction(decimal) == value:
        return decimal
    return text if len(text) <= _MOST_CHARACTERS else f"~{about:.{_DIGITS}g}"
